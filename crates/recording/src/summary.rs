//! What a recording holds, in a few numbers.

use super::profile::SignalProfile;
use super::quality::{self, QualityReport};
use super::rows::RowSample;
use super::{
    ClassCounts, ClassSpan, Interpolation, NamedSignal, ReceivedRecording, Recording,
    RecordingSource, Signal, TimeAxis,
};
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use std::io;
use utoipa::ToSchema;

/// A recording as lists and pages show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Summary {
    /// When the first sample was taken; `null` where the source did not say.
    #[serde(default)]
    #[schema(value_type = Option<String>, format = DateTime)]
    pub start: Option<Timestamp>,
    /// The time zone that the source counted in: an IANA name or an offset; `null` where it said
    /// none, or UTC.
    #[serde(default)]
    #[schema(required = false)]
    pub zone: Option<String>,
    /// The format and the options that the recording was read with.
    #[serde(default)]
    #[schema(required = false)]
    pub source: RecordingSource,
    /// The number of samples of every signal.
    pub samples: usize,
    /// The time from the first to the last sample `[s]`.
    pub duration_s: f64,
    /// The sample time `[s]`; where `uniform` is false that of the grid that the samples are of but for
    /// jitter and gaps, or else the median interval.
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
    /// How values in the unit as it was recorded become SI; absent where no unit was said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub conversion: Option<Conversion>,
    /// How the signal goes on between samples; `null` where nothing said so.
    #[serde(default)]
    #[schema(required = false)]
    pub interpolation: Option<Interpolation>,
    /// How many samples are good, uncertain, substituted and bad, by the source; `null` where it
    /// said that of none.
    #[serde(default)]
    #[schema(required = false)]
    pub quality: Option<ClassCounts>,
    /// How many samples are missing.
    pub missing: usize,
    /// The smallest value; `null` when every sample is missing.
    pub min: Option<f64>,
    /// The largest value; `null` when every sample is missing.
    pub max: Option<f64>,
    /// The mean; `null` when every sample is missing.
    pub mean: Option<f64>,
}

/// How a recorded value becomes SI: `factor × value + offset`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Conversion {
    /// The factor that a recorded value is multiplied by.
    #[schema(example = 1e-3)]
    pub factor: f64,
    /// The offset that is added to the product, SI.
    #[schema(example = 0.0)]
    pub offset: f64,
}

impl Recording {
    /// The recording in a few numbers, with its quality report.
    #[must_use]
    pub fn summary(&self) -> Summary {
        let signals = self.signals.iter().enumerate();
        let signals: Vec<NamedSignal> = signals
            .map(|(column, signal)| NamedSignal::new(signal, column))
            .collect();
        let profile = |signal: &Signal| {
            SignalProfile::of(&mut signal.values.as_slice()).expect("memory can be read")
        };
        let profiles = self.signals.iter().map(profile);
        let profiled: Vec<_> = signals.iter().zip(profiles).collect();
        let summary = self.summary_of(&profiled);
        match self.own_instants {
            true => Summary {
                report: report_by_signal(self),
                ..summary
            },
            false => summary,
        }
    }
}

/// The quality report of a recording whose signals have instants of their own: each signal is
/// looked over at the instants at which it has samples.
fn report_by_signal(recording: &Recording) -> QualityReport {
    let mut warnings = recording.notes.clone();
    for signal in &recording.signals {
        let (from, alone) = alone(signal, &recording.time);
        let report = alone.summary().report;
        warnings.extend(report.warnings.into_iter().map(|mut warning| {
            warning.signal.get_or_insert_with(|| signal.name.clone());
            for span in &mut warning.spans {
                (span.from_s, span.to_s) = (span.from_s + from, span.to_s + from);
            }
            warning
        }));
    }
    QualityReport { warnings }
}

/// A signal as a recording of its own, and when that begins `[s]`: the samples that say something.
fn alone(signal: &Signal, time: &TimeAxis) -> (f64, Recording) {
    let classes = signal.class_of_each();
    let says = |k: &usize| {
        let sample = RowSample {
            value: signal.values[*k],
            class: classes[*k],
        };
        !sample.is_unsaid()
    };
    let kept: Vec<usize> = (0..signal.values.len()).filter(says).collect();
    let from = kept.first().map_or(0.0, |k| time.instant(*k));
    let instants = kept.iter().map(|k| time.instant(*k) - from).collect();
    let values = kept.iter().map(|k| signal.values[*k]).collect();
    let samples = Signal {
        classes: ClassSpan::of(kept.iter().map(|k| classes[*k])),
        ..NamedSignal::new(signal, 0).with_values(values)
    };
    (
        from,
        Recording::new(TimeAxis::from_instants(instants, 0.0), vec![samples]),
    )
}

impl ReceivedRecording {
    /// The recording in a few numbers, with its quality report.
    ///
    /// # Errors
    /// When the samples cannot be read back.
    pub fn summary(&mut self) -> io::Result<Summary> {
        let columns = &mut self.columns;
        let profiled = self.header.signals.iter().map(|signal| {
            let profile = SignalProfile::of(&mut columns.column(signal.column))?;
            Ok((signal, profile))
        });
        let profiled: Vec<_> = profiled.collect::<io::Result<_>>()?;
        Ok(self.header.summary_of(&profiled))
    }
}

impl<S> Recording<S> {
    /// The summary of signals that have been gone through.
    fn summary_of(&self, profiled: &[(&NamedSignal, SignalProfile)]) -> Summary {
        let time = &self.time;
        Summary {
            start: self.start,
            zone: self.zone.clone(),
            source: self.source.clone(),
            samples: time.samples(),
            duration_s: time.duration(),
            sample_time_s: time.sample_time(),
            uniform: time.is_uniform(),
            signals: profiled
                .iter()
                .map(|(signal, profile)| of_signal(signal, profile, time.samples()))
                .collect(),
            report: quality::report(time, &self.notes, profiled),
        }
    }
}

fn of_signal(signal: &NamedSignal, profile: &SignalProfile, samples: usize) -> SignalSummary {
    let values = profile.values.as_ref();
    let counts = ClassCounts::of(samples, &signal.classes);
    SignalSummary {
        name: signal.name.clone(),
        unit: signal.unit.clone(),
        recorded_unit: signal.recorded_unit.clone(),
        conversion: None,
        interpolation: signal.interpolation,
        quality: (!counts.all_good()).then_some(counts),
        missing: profile.missing,
        min: values.map(|values| values.min.value),
        max: values.map(|values| values.max.value),
        mean: values.map(|values| values.mean),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::TimeAxis;

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
