//! A short stretch of an output whose line is a band over the whole recording: so many periods stand side by side
//! that none of them can be seen.

use crate::identification::assemble::{ExperimentTrajectory, OutputTrajectory};
use greybox_numerics::digits::short;
use std::ops::Range;

/// Points of a line at the most; the extremes of each stretch are kept.
pub const POINTS: usize = 1500;

/// A line is a band where it goes up and down more often than this.
const BAND_SWINGS: f64 = 60.0;

/// A stretch has this share of the samples, or so many fewer that its line goes up and down no more often.
const SHARE: f64 = 0.03;
const MOST_SWINGS: f64 = 24.0;

/// A stretch has this many samples at the least.
const FEWEST: usize = 20;

/// The stretch of an output in which it moves most.
#[derive(Debug, PartialEq, Eq)]
pub struct DenseStretch {
    /// The samples of the stretch.
    pub samples: Range<usize>,
    /// The samples of the recording.
    of: usize,
}

impl DenseStretch {
    /// The instants at which the stretch begins and ends `[s]`.
    pub fn ends(&self, times: &[f64]) -> [f64; 2] {
        [times[self.samples.start], times[self.samples.end - 1]]
    }

    /// A sentence on the stretch, and on why it is this one.
    pub fn words(&self, times: &[f64]) -> String {
        let [from, to] = self.ends(times).map(|time| short(time, 5));
        let share = short(100.0 * self.samples.len() as f64 / self.of as f64, 2);
        format!(
            "{from} to {to} s: of all stretches of {share} % of the recording the one in which the simulated output \
             moves most."
        )
    }
}

/// The stretch in which a simulated output moves most where it was measured; none where the line of the whole
/// recording is no band.
pub fn busiest(
    experiment: &ExperimentTrajectory,
    output: &OutputTrajectory,
) -> Option<DenseStretch> {
    let of = experiment.time.len();
    if of <= POINTS {
        return None;
    }
    let path = Path::of(output);
    if path.swings(0..of) < BAND_SWINGS {
        return None;
    }
    let mut length = (SHARE * of as f64) as usize;
    loop {
        let samples = path.longest(length);
        if path.swings(samples.clone()) <= MOST_SWINGS || length < 2 * FEWEST {
            return Some(DenseStretch { samples, of });
        }
        length /= 2;
    }
}

/// The way that a simulated output goes up and down.
struct Path<'a> {
    values: &'a [f64],
    /// The way from the first sample to each; samples that were not measured add nothing.
    so_far: Vec<f64>,
}

impl Path<'_> {
    fn of(output: &OutputTrajectory) -> Path<'_> {
        let values = &output.simulated;
        let mut way = 0.0;
        let mut so_far = vec![way];
        for (pair, measured) in values.windows(2).zip(output.measured.windows(2)) {
            let step = (pair[1] - pair[0]).abs();
            if step.is_finite() && measured.iter().all(|value| value.is_finite()) {
                way += step;
            }
            so_far.push(way);
        }
        Path { values, so_far }
    }

    fn way(&self, samples: &Range<usize>) -> f64 {
        self.so_far[samples.end - 1] - self.so_far[samples.start]
    }

    /// How often the output goes from its lowest to its highest value or back.
    fn swings(&self, samples: Range<usize>) -> f64 {
        let values = self.values[samples.clone()].iter();
        let finite = values.filter(|value| value.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(*value), high.max(*value))
        });
        match high > low {
            true => self.way(&samples) / (high - low),
            false => 0.0,
        }
    }

    /// The stretch of so many samples with the longest way; of equal ones the first.
    fn longest(&self, length: usize) -> Range<usize> {
        let starts = 0..=self.so_far.len() - length;
        let stretches = starts.map(|start| start..start + length);
        let longest =
            stretches.reduce(|longest, next| match self.way(&next) > self.way(&longest) {
                true => next,
                false => longest,
            });
        longest.unwrap_or(0..length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn busiest_of(samples: usize, output: impl Fn(f64) -> f64) -> Option<(DenseStretch, Vec<f64>)> {
        let time: Vec<f64> = (0..samples).map(|k| 0.01 * k as f64).collect();
        let simulated: Vec<f64> = time.iter().map(|time| output(*time)).collect();
        let mut measured = simulated.clone();
        measured[samples - 1] = f64::NAN;
        let output = OutputTrajectory {
            name: "position".to_owned(),
            unit: "m".to_owned(),
            residual: vec![0.0; samples],
            deviation: None,
            measured,
            simulated,
        };
        let experiment = ExperimentTrajectory {
            outputs: vec![output],
            ..crate::report::tests::experiment(time)
        };
        let stretch = busiest(&experiment, &experiment.outputs[0])?;
        Some((stretch, experiment.time))
    }

    #[test]
    fn the_inset_of_a_dense_line_is_where_it_moves_most() {
        // 120 s at 2 Hz whose amplitude is largest at 70 s.
        let beat = |t: f64| (12.6 * t).sin() * (0.2 + (-((t - 70.0) / 8.0).powi(2)).exp());
        let (stretch, times) = busiest_of(12_000, beat).expect("a band");
        let [from, to] = stretch.ends(&times);
        assert!(from < 70.0 && 70.0 < to, "{from} to {to}");
        assert_eq!(stretch.samples.len(), 360);
        let words = stretch.words(&times);
        assert!(
            words.starts_with(&format!("{} to ", short(from, 5))),
            "{words}"
        );
        assert!(
            words.contains(" s: of all stretches of 3 % of the recording"),
            "{words}"
        );
    }

    #[test]
    fn the_inset_of_fast_oscillations_is_shorter_so_that_each_is_seen() {
        let (stretch, times) = busiest_of(60_000, |t| (31.4 * t).sin()).expect("a band");
        let [from, to] = stretch.ends(&times);
        assert!((to - from) * 5.0 <= 12.5, "{from} to {to}");
        assert!((to - from) * 5.0 >= 5.0, "{from} to {to}");
    }

    #[test]
    fn a_short_recording_and_a_slow_one_have_no_inset() {
        assert_eq!(busiest_of(1000, |t| (31.4 * t).sin()), None);
        assert_eq!(busiest_of(12_000, |t| (0.5 * t).sin()), None);
        assert_eq!(busiest_of(12_000, |_| 1.0), None);
    }
}
