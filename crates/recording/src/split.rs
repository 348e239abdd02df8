//! Which samples an experiment uses, and which of them judge the estimate.

use super::{ExperimentError, TimeAxis};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use utoipa::ToSchema;

/// A part of a recording, in seconds from its first sample: `from_s <= t <= to_s`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeWindow {
    /// The beginning of the part `[s]`; the first sample when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// The end of the part `[s]`, included; the last sample when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
}

impl TimeWindow {
    /// The samples in the window, at least two.
    ///
    /// # Errors
    /// When a bound is not finite, the end is not after the beginning, or fewer than two samples lie
    /// between them.
    pub fn samples(&self, time: &TimeAxis) -> Result<Range<usize>, ExperimentError> {
        let duration_s = time.duration();
        let from_s = self.from_s.unwrap_or(0.0);
        let to_s = self.to_s.unwrap_or(duration_s);
        let finite = from_s.is_finite() && to_s.is_finite();
        let ordered = finite && (self.to_s.is_none() || from_s < to_s);
        if !ordered {
            return Err(ExperimentError::NotAnInterval { from_s, to_s });
        }
        let range = time.between(Some(from_s), self.to_s);
        if range.len() < super::MIN_SAMPLES {
            let samples = range.len();
            return Err(ExperimentError::EmptyWindow {
                from_s,
                to_s,
                samples,
                duration_s,
            });
        }
        Ok(range)
    }
}

/// The two parts of an experiment: the estimate is made from the first and judged on the second.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Split {
    /// Samples that enter the cost.
    pub estimation: Range<usize>,
    /// Samples that do not; empty without validation. They come last, because a simulation runs
    /// through the estimation data to reach them.
    pub validation: Range<usize>,
}

impl Split {
    /// Keeps the last `fraction` of `samples` for validation.
    ///
    /// # Errors
    /// When the fraction is outside [0, 1) or leaves fewer than two samples to estimate from.
    pub fn new(samples: usize, fraction: f64) -> Result<Self, ExperimentError> {
        if !(0.0..1.0).contains(&fraction) {
            return Err(ExperimentError::ValidationFraction {
                fraction,
                left: 0,
                samples,
            });
        }
        let kept_back = (samples as f64 * fraction).round() as usize;
        let left = samples.saturating_sub(kept_back);
        if left < super::MIN_SAMPLES {
            return Err(ExperimentError::ValidationFraction {
                fraction,
                left,
                samples,
            });
        }
        Ok(Self {
            estimation: 0..left,
            validation: left..samples,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const AXIS: TimeAxis = TimeAxis::Uniform {
        sample_time: 0.01,
        samples: 12_000,
    };

    fn window(from_s: f64, to_s: f64) -> TimeWindow {
        TimeWindow {
            from_s: Some(from_s),
            to_s: Some(to_s),
        }
    }

    #[test]
    fn both_ends_of_a_window_belong_to_it() {
        assert_eq!(window(0.0, 60.0).samples(&AXIS), Ok(0..6001));
        assert_eq!(window(60.0, 200.0).samples(&AXIS), Ok(6000..12_000));
        assert_eq!(window(0.005, 0.025).samples(&AXIS), Ok(1..3));
        assert_eq!(window(-1.0, AXIS.duration()).samples(&AXIS), Ok(0..12_000));
        assert_eq!(TimeWindow::default().samples(&AXIS), Ok(0..12_000));
    }

    #[test]
    fn a_window_without_samples_is_refused() {
        assert!(matches!(
            window(120.0, 130.0).samples(&AXIS),
            Err(ExperimentError::EmptyWindow { samples: 0, .. })
        ));
        let late = TimeWindow {
            from_s: Some(130.0),
            to_s: None,
        };
        assert!(matches!(
            late.samples(&AXIS),
            Err(ExperimentError::EmptyWindow { samples: 0, .. })
        ));
        assert!(matches!(
            window(5.0, 5.0).samples(&AXIS),
            Err(ExperimentError::NotAnInterval { .. })
        ));
        assert!(matches!(
            window(f64::NAN, 5.0).samples(&AXIS),
            Err(ExperimentError::NotAnInterval { .. })
        ));
    }

    #[test]
    fn a_quarter_for_validation_is_the_last_quarter() {
        let split = Split::new(12_000, 0.25).unwrap();
        assert_eq!(
            split,
            Split {
                estimation: 0..9000,
                validation: 9000..12_000
            }
        );
        assert!(Split::new(100, 0.0).unwrap().validation.is_empty());
        for fraction in [-0.1, 1.0, f64::NAN, 0.99] {
            assert!(Split::new(100, fraction).is_err(), "{fraction}");
        }
    }

    proptest! {
        #[test]
        fn a_split_covers_every_sample_once(samples in 2_usize..10_000, fraction in 0.0..0.9) {
            if let Ok(split) = Split::new(samples, fraction) {
                prop_assert_eq!(split.estimation.start, 0);
                prop_assert_eq!(split.estimation.end, split.validation.start);
                prop_assert_eq!(split.validation.end, samples);
            }
        }
    }
}
