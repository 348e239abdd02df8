//! What a recording holds, in a few numbers.

use super::quality::{self, QualityReport};
use super::{Recording, Signal};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A recording as lists and pages show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Summary {
    /// The number of samples of every signal.
    pub samples: usize,
    /// The time from the first to the last sample [s].
    pub duration_s: f64,
    /// The sample time [s]; the median interval where `uniform` is false.
    pub sample_time_s: f64,
    /// Whether the samples lie on a uniform grid.
    pub uniform: bool,
    /// The signals in the order of the recording.
    pub signals: Vec<SignalSummary>,
    /// What is odd about the data.
    pub report: QualityReport,
}

/// A signal of a [`Summary`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SignalSummary {
    /// The name.
    pub name: String,
    /// The SI unit of `min`, `max` and `mean`.
    pub unit: String,
    /// The unit as it was recorded.
    pub recorded_unit: String,
    /// How many samples are missing.
    pub missing: usize,
    /// The smallest value; `null` when every sample is missing.
    pub min: Option<f64>,
    /// The largest value; `null` when every sample is missing.
    pub max: Option<f64>,
    /// The mean; `null` when every sample is missing.
    pub mean: Option<f64>,
}

impl Recording {
    /// The recording in a few numbers, with its quality report.
    #[must_use]
    pub fn summary(&self) -> Summary {
        Summary {
            samples: self.time.samples(),
            duration_s: self.time.duration(),
            sample_time_s: self.time.sample_time(),
            uniform: self.time.is_uniform(),
            signals: self.signals.iter().map(summarise).collect(),
            report: quality::report(self),
        }
    }
}

fn summarise(signal: &Signal) -> SignalSummary {
    let present = || {
        signal
            .values
            .iter()
            .copied()
            .filter(|value| !value.is_nan())
    };
    let count = present().count() as f64;
    SignalSummary {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        recorded_unit: signal.recorded_unit.clone(),
        missing: signal.missing(),
        min: present().reduce(f64::min),
        max: present().reduce(f64::max),
        // Each term is divided first: the sum of large finite values need not be finite.
        mean: (count > 0.0).then(|| present().map(|value| value / count).sum()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::TimeAxis;

    fn recording(values: Vec<f64>) -> Recording {
        let time = TimeAxis::Uniform {
            sample_time: 0.5,
            samples: values.len(),
        };
        Recording::new(time, vec![Signal::new("a", "m", values)])
    }

    #[test]
    fn missing_samples_do_not_enter_the_statistics() {
        let summary = recording(vec![1.0, f64::NAN, 3.0]).summary();
        let signal = &summary.signals[0];
        assert_eq!(
            (signal.min, signal.max, signal.mean),
            (Some(1.0), Some(3.0), Some(2.0))
        );
        assert_eq!(
            (signal.missing, summary.samples, summary.duration_s),
            (1, 3, 1.0)
        );
    }

    #[test]
    fn a_signal_without_any_value_has_null_statistics_in_json() {
        let summary = recording(vec![f64::NAN; 3]).summary();
        let json = serde_json::to_value(&summary).unwrap();
        assert!(json["signals"][0]["mean"].is_null());
        let back: Summary = serde_json::from_value(json).unwrap();
        assert_eq!(back, summary);
    }

    #[test]
    fn the_mean_of_the_largest_numbers_is_finite() {
        let mean = recording(vec![f64::MAX; 4]).summary().signals[0].mean;
        assert_eq!(mean, Some(f64::MAX));
    }
}
