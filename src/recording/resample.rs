//! Samples at irregular instants onto a uniform grid.
//!
//! Between two neighbours the value is interpolated linearly. Where the neighbours are more than
//! [`LONGEST_BRIDGE`] sample times apart, or one of them is missing, the samples between them are
//! missing: nothing is invented.

use super::ExperimentError;
use crate::numerics::interpolation::linear;

/// The longest interval that is interpolated over, in sample times.
pub const LONGEST_BRIDGE: f64 = 2.0;

/// The most samples of a grid for each irregular one: a grid of gaps is no experiment.
const MOST_GRID_SAMPLES: usize = 20;

/// How far an instant may be from a grid point to be on it, in sample times. It covers rounding.
const ON_GRID: f64 = 1e-6;

/// Where the samples of a uniform grid lie among strictly increasing instants.
#[derive(Clone, Debug)]
pub(super) struct Grid<'a> {
    instants: &'a [f64],
    sample_time: f64,
    samples: usize,
}

impl<'a> Grid<'a> {
    /// The grid that begins at the first instant and ends at the last or within a sample before.
    ///
    /// # Errors
    /// When more than 19 in 20 samples of the grid would be missing.
    pub(super) fn over(instants: &'a [f64], sample_time: f64) -> Result<Self, ExperimentError> {
        let duration = match instants {
            [first, .., last] => last - first,
            _ => 0.0,
        };
        let samples = (duration / sample_time + ON_GRID).floor() as usize;
        let samples = samples.saturating_add(1);
        if samples > MOST_GRID_SAMPLES * instants.len() {
            return Err(ExperimentError::TooSparse {
                sample_time,
                samples: instants.len(),
                grid_samples: samples,
            });
        }
        Ok(Self {
            instants,
            sample_time,
            samples,
        })
    }

    /// The number of samples.
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// The values at the grid points of a signal that has `values` at the instants.
    pub(super) fn resample(&self, values: &[f64]) -> Vec<f64> {
        let first = self.instants[0];
        let mut right = 0;
        (0..self.samples)
            .map(|k| {
                let time = first + k as f64 * self.sample_time;
                while right + 1 < self.instants.len() && self.instants[right] < time {
                    right += 1;
                }
                self.value(values, right, time)
            })
            .collect()
    }

    /// The value at `time`, which lies at most at instant `right` and after the one before.
    fn value(&self, values: &[f64], right: usize, time: f64) -> f64 {
        let left = right.saturating_sub(1);
        let tolerance = ON_GRID * self.sample_time;
        for k in [left, right] {
            if (self.instants[k] - time).abs() <= tolerance {
                return values[k];
            }
        }
        let interval = self.instants[right] - self.instants[left];
        if interval > (LONGEST_BRIDGE + ON_GRID) * self.sample_time {
            return f64::NAN;
        }
        linear(
            (self.instants[left], values[left]),
            (self.instants[right], values[right]),
            time,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_gap_of_more_than_two_sample_times_stays_empty() {
        let instants = [0.0, 1.0, 2.0, 4.0, 7.0, 8.0];
        let values = Grid::over(&instants, 1.0).unwrap().resample(&instants);
        assert_eq!(values[..5], [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert!(values[5].is_nan() && values[6].is_nan());
        assert_eq!(values[7..], [7.0, 8.0]);
    }

    #[test]
    fn a_missing_sample_is_not_bridged() {
        let grid = Grid::over(&[0.0, 0.9, 2.1, 3.0], 1.0).unwrap();
        let values = grid.resample(&[0.0, f64::NAN, 2.0, 3.0]);
        assert_eq!((values[0], values[3]), (0.0, 3.0));
        assert!(values[1].is_nan() && values[2].is_nan());
    }

    #[test]
    fn a_grid_of_hardly_any_samples_is_refused_before_it_is_made() {
        let grid = Grid::over(&[0.0, 1e-9, 2e-9, 1e9], 1e-9);
        assert!(matches!(
            grid,
            Err(ExperimentError::TooSparse { samples: 4, .. })
        ));
    }

    proptest! {
        #[test]
        fn a_straight_line_stays_one(
            intervals in prop::collection::vec(0.5..1.5, 3..100), slope in -5.0..5.0_f64,
        ) {
            let mut instants = vec![0.0];
            for interval in intervals {
                instants.push(instants[instants.len() - 1] + interval);
            }
            let line: Vec<f64> = instants.iter().map(|t| slope * t).collect();
            let grid = Grid::over(&instants, 1.0).unwrap();
            let values = grid.resample(&line);
            prop_assert_eq!(values.len(), grid.samples());
            let last = instants[instants.len() - 1];
            prop_assert!((values.len() - 1) as f64 <= last + 1e-6 && values.len() as f64 > last);
            for (k, value) in values.iter().enumerate() {
                // An instant that is as good as on the grid is taken for it.
                let snapped = slope.abs() * ON_GRID;
                prop_assert!(f64::abs(value - slope * k as f64) < snapped + 1e-9 * (1.0 + last));
            }
        }
    }
}
