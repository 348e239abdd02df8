//! Set points of the position loop: sums of pseudo-random binary signals about mid-stroke.
//!
//! A binary signal of clock period T holds +1 or −1 for T and then draws again, each with
//! probability ½, from the ChaCha stream of the recording's seed named `Excitation`; the place of
//! the signal in the sum is the stream's second name. Its spectrum is T·sinc²(f·T), flat to about
//! 0.4/T.

use super::SAMPLE_TIME;
use greybox_numerics::rng::{self, Purpose};

/// The middle of the stroke [m].
const MIDDLE: f64 = 0.07;

/// One binary signal of a sum: amplitude [m] and clock period [s].
type Level = (f64, f64);

/// Large moves that turn the spring over, and small quick ones that ring the oil.
const TEXTBOOK: [Level; 2] = [(0.025, 0.5), (0.010, 0.05)];

/// The excitation of the paper.
const PAPER: [Level; 1] = [(0.010, 0.2)];

/// Set points of recordings A, C and D `[m]`.
#[must_use]
pub fn textbook(seed: u64, samples: usize) -> Vec<f64> {
    sum(&TEXTBOOK, seed, samples)
}

/// Set points of recording B `[m]`.
#[must_use]
pub fn as_in_the_paper(seed: u64, samples: usize) -> Vec<f64> {
    sum(&PAPER, seed, samples)
}

fn sum(levels: &[Level], seed: u64, samples: usize) -> Vec<f64> {
    let mut reference = vec![MIDDLE; samples];
    for (place, &(amplitude, period)) in (0..).zip(levels) {
        let signal = binary_signal(seed, place, period);
        for (value, sign) in reference.iter_mut().zip(signal) {
            *value += amplitude * sign;
        }
    }
    reference
}

/// +1 and −1 without end, a number a sample.
fn binary_signal(seed: u64, place: u64, period: f64) -> impl Iterator<Item = f64> {
    let held = (period / SAMPLE_TIME).round() as usize;
    let mut stream = rng::stream(seed, place, Purpose::Excitation);
    std::iter::repeat_with(move || {
        if rng::below(&mut stream, 2) == 1 {
            1.0
        } else {
            -1.0
        }
    })
    .flat_map(move |sign| std::iter::repeat_n(sign, held))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Levels in tenths of a millimetre and how often each occurs.
    fn levels(reference: &[f64]) -> BTreeMap<i64, usize> {
        let mut levels = BTreeMap::new();
        for value in reference {
            *levels.entry((value * 1e4).round() as i64).or_default() += 1;
        }
        levels
    }

    #[test]
    fn the_paper_moves_between_two_levels_every_two_tenths_of_a_second() {
        let reference = as_in_the_paper(1, 12_000);
        let found = levels(&reference);
        assert_eq!(found.keys().copied().collect::<Vec<_>>(), [600, 800]);
        for period in reference.chunks(20) {
            assert!(period.iter().all(|value| value == &period[0]));
        }
        // 600 draws of one half: five standard deviations of their number are 61.
        assert!(found[&600].abs_diff(6000) <= 61 * 20);
    }

    #[test]
    fn the_textbook_has_four_levels_and_changes_on_the_clock_of_the_quick_signal() {
        let reference = textbook(1, 12_000);
        let found = levels(&reference);
        let expected = [350, 550, 850, 1050];
        assert_eq!(found.keys().copied().collect::<Vec<_>>(), expected);
        // 240 draws of the slow signal: five standard deviations of its mean are 0.32.
        let high = found[&850] + found[&1050];
        assert!(high.abs_diff(6000) <= 1940);
        let changes = |at: usize| reference[at] != reference[at - 1];
        assert!((1..12_000).filter(|at| at % 5 != 0).all(|at| !changes(at)));
        let quick = (1..2400).filter(|draw| changes(draw * 5)).count();
        assert!(quick.abs_diff(1200) <= 160, "{quick} changes in 2399 draws");
    }

    #[test]
    fn the_two_signals_of_the_textbook_are_not_correlated() {
        let reference = textbook(9, 12_000);
        let product: f64 = reference
            .iter()
            .map(|value| {
                let slow = (value - MIDDLE).signum();
                let quick = (value - MIDDLE - 0.025 * slow).signum();
                slow * quick
            })
            .sum();
        // 2400 draws of the quick signal: five standard errors of their mean.
        assert!((product / 12_000.0).abs() < 5.0 / 2400f64.sqrt());
    }
}
