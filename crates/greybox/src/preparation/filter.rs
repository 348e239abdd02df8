//! Filters without a delay: Butterworth of second order, once forwards and once backwards, and the running median.

use std::f64::consts::PI;

/// What a Butterworth filter lets pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FilterPass {
    Low,
    High,
}

/// A filter of second order: y = b0·x + b1·x₁ + b2·x₂ − a1·y₁ − a2·y₂, where ₁ and ₂ are one and two samples before.
#[derive(Clone, Copy, Debug)]
pub(super) struct Butterworth {
    b: [f64; 3],
    a: [f64; 2],
    /// How the filter answers a constant: 1 or 0.
    gain: f64,
    /// The samples after which little is left of what came before.
    memory: usize,
}

impl Butterworth {
    /// The filter that, run forwards and backwards, leaves 1/√2 of an oscillation at `cutoff`, in oscillations a
    /// sample, below 0.5: each run leaves 2^(−1/4).
    pub(super) fn new(pass: FilterPass, cutoff: f64) -> Self {
        // |H|² = 1/(1 + r⁴), with r the ratio of frequencies after the bilinear transform, is 1/√2 at this r.
        let ratio = (2.0_f64.sqrt() - 1.0).powf(0.25);
        let warped = (PI * cutoff).tan();
        let scale = match pass {
            FilterPass::Low => warped / ratio,
            FilterPass::High => warped * ratio,
        };
        let square = scale * scale;
        let norm = 1.0 + 2.0_f64.sqrt() * scale + square;
        let (b, gain) = match pass {
            FilterPass::Low => ([square, 2.0 * square, square], 1.0),
            FilterPass::High => ([1.0, -2.0, 1.0], 0.0),
        };
        Self {
            b: b.map(|b| b / norm),
            a: [
                2.0 * (square - 1.0) / norm,
                (1.0 - 2.0_f64.sqrt() * scale + square) / norm,
            ],
            gain,
            memory: (3.0 / cutoff).ceil().min(1e9) as usize,
        }
    }

    /// Filters samples. What is missing stays missing, and is a straight line to the filter.
    pub(super) fn apply(&self, values: &mut [f64]) {
        let missing: Vec<bool> = values.iter().map(|value| value.is_nan()).collect();
        if !bridge(values) {
            return;
        }
        let padding = self.memory.min(values.len() - 1);
        let mut padded = with_reflected_ends(values, padding);
        self.run(padded.iter_mut());
        self.run(padded.iter_mut().rev());
        for ((value, missing), filtered) in values.iter_mut().zip(missing).zip(&padded[padding..]) {
            *value = if missing { f64::NAN } else { *filtered };
        }
    }

    /// Filters once, from rest at the first sample.
    fn run<'a>(&self, values: impl Iterator<Item = &'a mut f64>) {
        let Self { b, a, gain, .. } = *self;
        let mut memory: Option<[f64; 2]> = None;
        for value in values {
            let x = *value;
            let [first, second] = memory.unwrap_or_else(|| {
                let second = (b[2] - a[1] * gain) * x;
                [(b[1] - a[0] * gain) * x + second, second]
            });
            let y = b[0] * x + first;
            memory = Some([b[1] * x - a[0] * y + second, b[2] * x - a[1] * y]);
            *value = y;
        }
    }
}

/// Puts straight lines where samples are missing, and the nearest sample before the first and after the last. Says
/// whether there is any sample.
fn bridge(values: &mut [f64]) -> bool {
    let present: Vec<usize> = (0..values.len()).filter(|k| !values[*k].is_nan()).collect();
    let (Some(&first), Some(&last)) = (present.first(), present.last()) else {
        return false;
    };
    let (before, after) = (values[first], values[last]);
    values[..first].fill(before);
    values[last..].fill(after);
    for pair in present.windows(2) {
        let [left, right] = [pair[0], pair[1]];
        let step = (values[right] - values[left]) / (right - left) as f64;
        for k in left + 1..right {
            values[k] = values[left] + step * (k - left) as f64;
        }
    }
    true
}

/// The samples with their ends turned about the first and the last of them, `padding` samples each.
fn with_reflected_ends(values: &[f64], padding: usize) -> Vec<f64> {
    let (first, last) = (values[0], values[values.len() - 1]);
    let before = values[1..=padding]
        .iter()
        .rev()
        .map(|value| 2.0 * first - value);
    let after = values[values.len() - 1 - padding..values.len() - 1]
        .iter()
        .rev();
    let after = after.map(|value| 2.0 * last - value);
    before.chain(values.iter().copied()).chain(after).collect()
}

/// Replaces each sample by the median of `samples` around it: fewer towards the ends, and where some are missing. What
/// is missing stays missing.
pub(super) fn median(values: &mut [f64], samples: usize) {
    let original = values.to_vec();
    let reach = samples / 2;
    let mut around: Vec<f64> = Vec::with_capacity(samples);
    for (k, value) in values
        .iter_mut()
        .enumerate()
        .filter(|(_, value)| !value.is_nan())
    {
        let reach = reach.min(k).min(original.len() - 1 - k);
        around.clear();
        let window = original[k - reach..=k + reach].iter();
        around.extend(window.filter(|value| !value.is_nan()));
        let count = around.len();
        let (below, upper, _) = around.select_nth_unstable_by(count / 2, f64::total_cmp);
        let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        *value = match count % 2 {
            1 => *upper,
            _ => 0.5 * (lower + *upper),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The height of an oscillation of so many turns a sample that a filter leaves, and how far it moves in samples.
    fn left(filter: Butterworth, turns: f64) -> [f64; 2] {
        let mut values: Vec<f64> = (0..4000)
            .map(|k| (2.0 * PI * turns * f64::from(k)).cos())
            .collect();
        filter.apply(&mut values);
        let (mut cosine, mut sine) = (0.0, 0.0);
        for k in 1000..3000_u32 {
            let phase = 2.0 * PI * turns * f64::from(k);
            cosine += values[k as usize] * phase.cos() / 1000.0;
            sine += values[k as usize] * phase.sin() / 1000.0;
        }
        [cosine.hypot(sine), sine.atan2(cosine)]
    }

    #[test]
    fn the_cutoff_keeps_a_root_of_a_half_and_nothing_moves_in_time() {
        for (pass, cutoff, turns, height) in [
            (FilterPass::Low, 0.05, 0.05, 0.5_f64.sqrt()),
            (FilterPass::High, 0.05, 0.05, 0.5_f64.sqrt()),
            (FilterPass::Low, 0.05, 0.002, 1.0),
            (FilterPass::High, 0.05, 0.4, 1.0),
            (FilterPass::Low, 0.02, 0.4, 0.0),
            (FilterPass::High, 0.1, 0.005, 0.0),
        ] {
            let [kept, phase] = left(Butterworth::new(pass, cutoff), turns);
            assert!(
                (kept - height).abs() < 2e-3,
                "{pass:?} {cutoff} {turns}: {kept}"
            );
            assert!(
                kept < 0.01 || phase.abs() < 1e-6,
                "{pass:?} {cutoff} {turns}: {phase}"
            );
        }
    }

    #[test]
    fn a_straight_line_passes_a_low_pass_and_no_high_pass() {
        let line: Vec<f64> = (0..300).map(|k| 3.0 + 0.5 * f64::from(k)).collect();
        let mut passed = line.clone();
        Butterworth::new(FilterPass::Low, 0.05).apply(&mut passed);
        assert!(passed.iter().zip(&line).all(|(a, b)| (a - b).abs() < 0.05));
        let mut held_back = vec![7.0; 300];
        Butterworth::new(FilterPass::High, 0.05).apply(&mut held_back);
        assert!(held_back.iter().all(|value| value.abs() < 1e-9));
    }

    #[test]
    fn missing_samples_stay_missing_and_spoil_no_neighbours() {
        let mut values = vec![2.0; 100];
        values[40..50].fill(f64::NAN);
        values[0] = f64::NAN;
        Butterworth::new(FilterPass::Low, 0.1).apply(&mut values);
        for (k, value) in values.iter().enumerate() {
            match k {
                0 | 40..50 => assert!(value.is_nan()),
                _ => assert!((value - 2.0).abs() < 1e-9, "{k}: {value}"),
            }
        }
    }

    #[test]
    fn a_median_takes_a_spike_out_and_leaves_an_edge() {
        let mut values = vec![0.0, 0.0, 9.0, 0.0, 0.0, 5.0, 5.0, 5.0, f64::NAN, 5.0];
        median(&mut values, 3);
        assert_eq!(values[..8], [0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 5.0, 5.0]);
        assert!(values[8].is_nan() && values[9] == 5.0);
    }
}
