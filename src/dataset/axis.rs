//! When the samples of a recording were taken.

/// How far a sample may lie from its place on a uniform grid, in sample times.
pub const JITTER_TOLERANCE: f64 = 1e-3;

/// The instants of the samples, in seconds from the first one.
#[derive(Clone, Debug, PartialEq)]
pub enum TimeAxis {
    /// Sample k was taken at `k * sample_time`.
    Uniform {
        /// The sample time [s].
        sample_time: f64,
        /// The number of samples.
        samples: usize,
    },
    /// Sample k was taken at the k-th instant; strictly increasing from 0.
    Instants(Vec<f64>),
}

impl TimeAxis {
    /// The axis of strictly increasing instants that begin at 0: uniform where every instant is
    /// within [`JITTER_TOLERANCE`] of the grid between the first and the last.
    ///
    /// `scale` is the largest number that the source wrote for a time [s]; its rounding limits what
    /// the instants can tell about the sample time.
    #[must_use]
    pub fn from_instants(instants: Vec<f64>, scale: f64) -> Self {
        let samples = instants.len();
        let Some(last) = instants.last().copied().filter(|last| *last > 0.0) else {
            return Self::Instants(instants);
        };
        let intervals = (samples - 1) as f64;
        let rounding = 2.0 * f64::EPSILON * scale.abs().max(last) / intervals;
        let sample_time = shortest_decimal(last / intervals, rounding);
        let on_grid = |(k, instant): (usize, &f64)| {
            (instant - k as f64 * sample_time).abs() <= JITTER_TOLERANCE * sample_time
        };
        if instants.iter().enumerate().all(on_grid) {
            Self::Uniform {
                sample_time,
                samples,
            }
        } else {
            Self::Instants(instants)
        }
    }

    /// The number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        match self {
            Self::Uniform { samples, .. } => *samples,
            Self::Instants(instants) => instants.len(),
        }
    }

    /// When sample `k` was taken [s].
    ///
    /// # Panics
    /// When `k` is past the end of a non-uniform axis.
    #[must_use]
    pub fn instant(&self, k: usize) -> f64 {
        match self {
            Self::Uniform { sample_time, .. } => k as f64 * sample_time,
            Self::Instants(instants) => instants[k],
        }
    }

    /// The time from the first to the last sample [s].
    #[must_use]
    pub fn duration(&self) -> f64 {
        match self.samples() {
            0 => 0.0,
            samples => self.instant(samples - 1),
        }
    }

    /// Whether the samples lie on a uniform grid.
    #[must_use]
    pub fn is_uniform(&self) -> bool {
        matches!(self, Self::Uniform { .. })
    }

    /// The sample time [s]; the median interval where the samples are not uniform.
    #[must_use]
    pub fn sample_time(&self) -> f64 {
        match self {
            Self::Uniform { sample_time, .. } => *sample_time,
            Self::Instants(instants) => median_interval(instants),
        }
    }

    /// The first sample at or after `time` [s], which may be off by a millionth of a sample time.
    pub(super) fn first_from(&self, time: f64) -> usize {
        let early = time - 1e-6 * self.sample_time();
        match self {
            Self::Uniform {
                sample_time,
                samples,
            } => {
                let k = (early / sample_time).ceil().clamp(0.0, *samples as f64);
                k as usize
            }
            Self::Instants(instants) => instants.partition_point(|instant| *instant < early),
        }
    }
}

/// The decimal number of the fewest digits within `tolerance` of `value`: 0.01, not
/// 0.009999999999999998, where the difference is rounding.
fn shortest_decimal(value: f64, tolerance: f64) -> f64 {
    (0..15)
        .filter_map(|digits| format!("{value:.digits$e}").parse::<f64>().ok())
        .find(|decimal| (decimal - value).abs() <= tolerance)
        .unwrap_or(value)
}

fn median_interval(instants: &[f64]) -> f64 {
    let mut intervals: Vec<f64> = instants.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.is_empty() {
        return 0.0;
    }
    let middle = intervals.len() / 2;
    let (_, median, _) = intervals.select_nth_unstable_by(middle, f64::total_cmp);
    shortest_decimal(*median, 1e-9 * *median)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(instants: &[f64]) -> TimeAxis {
        TimeAxis::from_instants(instants.to_vec(), 0.0)
    }

    #[test]
    fn rounding_in_the_times_does_not_show_in_the_sample_time() {
        let instants: Vec<f64> = (0..1000).map(|k| f64::from(k) * 0.01).collect();
        assert_eq!(
            axis(&instants),
            TimeAxis::Uniform {
                sample_time: 0.01,
                samples: 1000
            }
        );
    }

    #[test]
    fn a_sample_time_that_is_no_short_decimal_is_kept() {
        let third = 1.0 / 3.0;
        let instants: Vec<f64> = (0..100).map(|k| f64::from(k) * third).collect();
        assert_eq!(axis(&instants).sample_time(), third);
    }

    #[test]
    fn jitter_above_a_thousandth_of_the_sample_time_is_not_uniform() {
        assert!(axis(&[0.0, 1.0009, 2.0, 3.0]).is_uniform());
        assert!(!axis(&[0.0, 1.0011, 2.0, 3.0]).is_uniform());
    }

    #[test]
    fn the_sample_time_of_a_non_uniform_axis_is_its_median_interval() {
        assert_eq!(axis(&[0.0, 1.0, 2.0, 10.0]).sample_time(), 1.0);
    }

    #[test]
    fn first_from_finds_the_same_sample_on_both_kinds_of_axis() {
        let uniform = TimeAxis::Uniform {
            sample_time: 0.1,
            samples: 11,
        };
        let instants = TimeAxis::Instants((0..11).map(|k| f64::from(k) * 0.1).collect());
        for (time, k) in [
            (-1.0, 0),
            (0.0, 0),
            (0.3, 3),
            (0.31, 4),
            (1.0, 10),
            (1.1, 11),
            (9.0, 11),
        ] {
            assert_eq!(uniform.first_from(time), k, "uniform, {time} s");
            assert_eq!(instants.first_from(time), k, "instants, {time} s");
        }
    }
}
