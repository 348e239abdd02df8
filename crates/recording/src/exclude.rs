//! What an experiment leaves out of a recording: classes of samples and spans of time.

use super::columns::SampleSeries;
use super::profile::SignalProfile;
use super::{Class, Recording, Signal, TimeAxis, quality};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Samples that an experiment does without: an output is not compared there, an input keeps the
/// value before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Exclude {
    /// Kinds of samples.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub classes: Vec<ExcludedClass>,
    /// Spans of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub spans: Vec<ExcludedSpan>,
}

/// A kind of samples: what their source said of them, or what the quality report found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ExcludedClass {
    /// Measured, but not to be relied on, by the source.
    Uncertain,
    /// Put in, not measured, by the source.
    Substituted,
    /// Where the signal is frozen, by the report.
    Frozen,
    /// Single samples far from their neighbours, by the report.
    Spike,
}

/// A span of time, both ends included.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExcludedSpan {
    /// The beginning of the span `[s]`, from the first sample of the recording.
    pub from_s: f64,
    /// The end of the span `[s]`, from the first sample of the recording.
    pub to_s: f64,
    /// The recording's signals that it is left out of; all when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signals: Option<Vec<String>>,
}

impl Exclude {
    /// Makes the samples of a recording missing that are left out. Answers how many they are.
    pub fn leave_out_of(&self, recording: &mut Recording) -> usize {
        let mut left_out = 0;
        for signal in &mut recording.signals {
            let mut values = signal.values.clone();
            left_out += self.apply(signal, &recording.time, 0, &mut values);
            signal.values = values;
        }
        left_out
    }

    /// Makes the samples missing that are left out of a signal, whose samples from the index
    /// `start` on are `values`. Answers how many they are.
    pub(super) fn apply(
        &self,
        signal: &Signal,
        time: &TimeAxis,
        start: usize,
        values: &mut [f64],
    ) -> usize {
        let mut left_out = 0;
        let mut leave_out = |first: usize, samples: usize| {
            let from = first.max(start) - start;
            let to = (first + samples).saturating_sub(start).min(values.len());
            for value in values.get_mut(from..to).into_iter().flatten() {
                left_out += usize::from(!value.is_nan());
                *value = f64::NAN;
            }
        };
        let class = |class: Class| match class {
            Class::Uncertain => self.classes.contains(&ExcludedClass::Uncertain),
            Class::Substituted => self.classes.contains(&ExcludedClass::Substituted),
            Class::Good | Class::Bad => false,
        };
        for span in signal.classes.iter().filter(|span| class(span.class)) {
            leave_out(span.first, span.samples);
        }
        for span in &self.spans {
            let is_meant = |names: &Vec<String>| names.contains(&signal.name);
            if span.signals.as_ref().is_none_or(is_meant) {
                let samples = time.between(Some(span.from_s), Some(span.to_s));
                leave_out(samples.start, samples.len());
            }
        }
        let excludes = |class| self.classes.contains(&class);
        let (frozen, spike) = (
            excludes(ExcludedClass::Frozen),
            excludes(ExcludedClass::Spike),
        );
        if frozen || spike {
            let series: &mut dyn SampleSeries = &mut signal.values.as_slice();
            let profile = SignalProfile::of(series).expect("memory can be read");
            if frozen {
                let runs = quality::frozen_runs(&profile);
                runs.for_each(|run| leave_out(run.start, run.samples));
            }
            if spike {
                profile.spikes.iter().for_each(|k| leave_out(*k, 1));
            }
        }
        left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClassSpan;

    const TIME: TimeAxis = TimeAxis::Uniform {
        sample_time: 0.5,
        samples: 8,
    };

    /// What is left of eight samples, of which a window begins at the second.
    fn left(exclude: &Exclude) -> Vec<f64> {
        let mut signal = Signal::new("p", "Pa", (0..8_u8).map(f64::from).collect());
        signal.classes = vec![ClassSpan {
            class: Class::Uncertain,
            first: 0,
            samples: 3,
        }];
        let mut values = signal.values[1..].to_vec();
        let count = exclude.apply(&signal, &TIME, 1, &mut values);
        values.retain(|value| !value.is_nan());
        assert_eq!(count, 7 - values.len());
        values
    }

    #[test]
    fn classes_and_spans_that_are_excluded_are_missing_and_nothing_else() {
        let mut exclude = Exclude {
            classes: vec![ExcludedClass::Uncertain],
            spans: vec![],
        };
        assert_eq!(left(&exclude), [3.0, 4.0, 5.0, 6.0, 7.0]);
        let span = |signals| ExcludedSpan {
            from_s: 2.0,
            to_s: 2.5,
            signals,
        };
        exclude.spans = vec![span(None)];
        assert_eq!(left(&exclude), [3.0, 6.0, 7.0]);
        exclude.spans = vec![span(Some(vec!["x".to_owned()]))];
        assert_eq!(left(&exclude), [3.0, 4.0, 5.0, 6.0, 7.0]);
    }
}
