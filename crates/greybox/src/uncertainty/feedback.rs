//! Whether an input is moved by what an output does.
//!
//! Where nobody looks at an output to move an input, the input moves later as it would have moved anyway: residuals
//! that are white are independent of the input's later changes, whatever those are. Where a controller makes the input,
//! the changes follow the residuals (L. Ljung, *System Identification*, 1999, section 16.6, with future inputs). A
//! model that is wrong leaves residuals that follow earlier changes, and those may resemble later ones: so an input
//! follows an output only where its later changes are closer to the residuals than its earlier ones.

use greybox_numerics::statistics;

/// Samples that a change of the input is looked for after a residual, and before it.
pub const LAGS: usize = 10;
/// Scores of so many standard deviations are no chance.
const BEYOND_CHANCE: f64 = 4.5;

/// An input that follows an output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following {
    /// After how many samples the input follows most.
    pub lag: usize,
    /// The correlation as standard deviations of what chance makes of it.
    pub score: f64,
}

/// The correlations of residuals with the changes of an input, 1 to 10 samples later and 1 to 10 samples earlier, each as
/// standard deviations of what chance makes of it; nothing where the input does not change or too few samples are there.
/// A missing residual is NaN.
#[must_use]
pub fn scores(residuals: &[f64], input: &[f64]) -> Option<[f32; 2 * LAGS]> {
    let white = whitened(residuals);
    let changes: Vec<f64> = input.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut scores = [0.0; 2 * LAGS];
    for (place, score) in scores.iter_mut().enumerate() {
        // `white` and `changes` begin with the second sample.
        let (later, earlier) = match place < LAGS {
            true => (&changes[..], &white[..]),
            false => (&white[..], &changes[..]),
        };
        let lag = place % LAGS + 1;
        let pairs = later.get(lag..)?.iter().zip(earlier);
        let pairs = pairs.filter(|(later, earlier)| !later.is_nan() && !earlier.is_nan());
        let (mut product, mut squares) = (0.0, [0.0, 0.0]);
        for (later, earlier) in pairs {
            product += later * earlier;
            squares = [squares[0] + later * later, squares[1] + earlier * earlier];
        }
        let count = later.len().saturating_sub(lag) as f64;
        let size = (squares[0] * squares[1]).sqrt();
        if size <= 0.0 {
            return None;
        }
        *score = (product / size * count.sqrt()) as f32;
    }
    Some(scores)
}

/// What follows from the scores of windows together; nothing where the input follows the output no more than by chance.
#[must_use]
pub fn following<'a>(windows: impl Iterator<Item = &'a [f32; 2 * LAGS]>) -> Option<Following> {
    let (mut sums, mut count) = ([0.0; 2 * LAGS], 0.0);
    for window in windows {
        sums.iter_mut()
            .zip(window)
            .for_each(|(sum, score)| *sum += f64::from(*score));
        count += 1.0;
    }
    let largest = |sums: &[f64]| {
        let sums = sums.iter().enumerate();
        sums.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))
            .map(|(place, sum)| (place + 1, sum / f64::sqrt(count)))
    };
    let (lag, score) = largest(&sums[..LAGS])?;
    let (_, earlier) = largest(&sums[LAGS..])?;
    let follows = score.abs() > BEYOND_CHANCE && score.abs() > earlier.abs();
    follows.then_some(Following { lag, score })
}

/// Residuals without what each has of the one before, from the second on.
fn whitened(residuals: &[f64]) -> Vec<f64> {
    let mean = statistics::mean(residuals.iter().copied().filter(|value| !value.is_nan()));
    let mean = mean.unwrap_or_default();
    let (mut product, mut square) = (0.0, 0.0);
    let pairs = residuals
        .windows(2)
        .map(|pair| (pair[0] - mean, pair[1] - mean));
    for (before, after) in pairs.clone().filter(|(a, b)| !a.is_nan() && !b.is_nan()) {
        product += before * after;
        square += before * before;
    }
    let share = if square > 0.0 { product / square } else { 0.0 };
    pairs
        .map(|(before, after)| after - share * before)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{self, Purpose};

    const SAMPLES: usize = 400;

    /// What moves the input of a lag.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Hand {
        /// An operator who does not look.
        Blind,
        /// A controller of the noisy output, with a set point that moves too.
        Controller,
    }

    /// The input, and the residuals of a model with so many times the true gain; the disturbance has a memory.
    fn window(hand: Hand, gain: f64, seed: u64) -> ([f32; 2 * LAGS], bool) {
        let mut random = rng::stream(seed, 0, Purpose::Noise);
        let (mut x, mut simulated, mut disturbance, mut integral, mut u) =
            (0.0, 0.0, 0.0, 0.0, 0.0);
        let (mut residuals, mut inputs) = (Vec::new(), Vec::new());
        for k in 0..SAMPLES {
            let y = x + disturbance + 0.01 * rng::normal(&mut random);
            let wanted = [0.0, 1.0][k / 50 % 2];
            inputs.push(u);
            residuals.push(y - simulated);
            x += 0.1 * (u - x);
            simulated += 0.1 * (gain * u - simulated);
            disturbance = 0.9 * disturbance + 0.02 * rng::normal(&mut random);
            integral += 0.05 * (wanted - y);
            u = match hand {
                Hand::Blind => wanted,
                Hand::Controller => integral + 0.5 * (wanted - y),
            };
        }
        let scores = scores(&residuals, &inputs).expect("the input moves");
        (scores, following(std::iter::once(&scores)).is_some())
    }

    #[test]
    fn a_controller_is_found_in_a_few_windows_and_a_hand_that_does_not_look_in_none() {
        let windows = |hand: Hand, gain: f64, first: u64| -> Vec<_> {
            (first..first + 20)
                .map(|seed| window(hand, gain, seed).0)
                .collect()
        };
        let controller = following(windows(Hand::Controller, 1.0, 0).iter()).expect("a controller");
        assert_eq!(controller.lag, 1);
        assert!(
            controller.score < 0.0,
            "the controller acts against the output: {controller:?}"
        );
        for first in (100..2100).step_by(20) {
            assert_eq!(following(windows(Hand::Blind, 1.0, first).iter()), None);
        }
        let alone = (0..2000).filter(|seed| window(Hand::Blind, 1.0, *seed).1);
        assert_eq!(alone.count(), 0);
    }

    #[test]
    fn a_wrong_gain_is_no_controller() {
        for first in (0..400).step_by(20) {
            let windows: Vec<_> = (first..first + 20)
                .map(|seed| window(Hand::Blind, 1.3, seed).0)
                .collect();
            assert_eq!(following(windows.iter()), None);
        }
    }

    #[test]
    fn an_input_that_stands_still_and_a_short_window_have_no_scores() {
        assert_eq!(scores(&[1.0, 2.0, 1.0, 2.0], &[0.0, 1.0, 0.0, 1.0]), None);
        let residuals: Vec<f64> = (0..SAMPLES).map(|k| (k as f64 * 1e3).sin()).collect();
        assert_eq!(scores(&residuals, &[1.0; SAMPLES]), None);
        let mut missing = residuals.clone();
        missing
            .iter_mut()
            .step_by(7)
            .for_each(|residual| *residual = f64::NAN);
        let steps: Vec<f64> = (0..SAMPLES).map(|k| [0.0, 1.0][k / 9 % 2]).collect();
        let scores = scores(&missing, &steps).expect("the input moves");
        assert!(scores.iter().all(|score| score.abs() < 4.5), "{scores:?}");
    }
}
