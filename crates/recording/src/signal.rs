//! A recorded quantity: its name, unit and samples, how it goes on between samples, and how good
//! its source said that they are.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One recorded quantity.
#[derive(Clone, Debug)]
pub struct Signal {
    /// The name, unique in its recording.
    pub name: String,
    /// The SI unit of `values`; empty where the source gave no unit.
    pub unit: String,
    /// The unit as the source wrote it; empty where it gave none.
    pub recorded_unit: String,
    /// How the signal goes on between samples, where the source or its options said so.
    pub interpolation: Option<Interpolation>,
    /// Samples that are not good, in their order; the others are.
    pub classes: Vec<ClassSpan>,
    /// The samples in `unit`; NaN is a missing sample.
    pub values: Vec<f64>,
}

/// What a signal is called and measured in: all but its samples.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NamedSignal {
    /// The name, unique in its recording.
    pub name: String,
    /// The SI unit of the samples; empty where the source gave no unit.
    pub unit: String,
    /// The unit as the source wrote it; empty where it gave none.
    pub recorded_unit: String,
    /// How the signal goes on between samples, where the source or its options said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolation: Option<Interpolation>,
    /// Samples that are not good, in their order; the others are.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub classes: Vec<ClassSpan>,
    /// The column that holds the samples.
    #[serde(skip)]
    pub(crate) column: usize,
}

impl NamedSignal {
    pub(crate) fn new(signal: &Signal, column: usize) -> Self {
        Self {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            recorded_unit: signal.recorded_unit.clone(),
            interpolation: signal.interpolation,
            classes: signal.classes.clone(),
            column,
        }
    }

    /// The signal that has these samples.
    #[must_use]
    pub fn with_values(self, values: Vec<f64>) -> Signal {
        Signal {
            name: self.name,
            unit: self.unit,
            recorded_unit: self.recorded_unit,
            interpolation: self.interpolation,
            classes: self.classes,
            values,
        }
    }
}

/// What a signal goes on like from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// It keeps its value until the next sample: commands, switches, what is stored on change.
    Hold,
    /// It goes straight to the next sample.
    Linear,
}

/// How good a sample is, by its source.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Measured.
    Good,
    /// Measured, but not to be relied on.
    Uncertain,
    /// Put in by hand or computed, not measured.
    Substituted,
    /// Not measured; its value is missing.
    Bad,
}

/// Samples in a row that are of one class.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ClassSpan {
    /// The class of all samples of the span.
    pub class: Class,
    /// The index of the first sample.
    pub first: usize,
    /// How many samples the span has.
    pub samples: usize,
}

/// How many samples of a signal are of each class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ClassCounts {
    /// Measured.
    pub good: usize,
    /// Measured, but not to be relied on; they are used unless a job excludes them.
    pub uncertain: usize,
    /// Put in, not measured; they are used unless a job excludes them.
    pub substituted: usize,
    /// Not measured; they are missing.
    pub bad: usize,
}

impl ClassCounts {
    /// The counts of so many samples of which some are not good.
    #[must_use]
    pub fn of(samples: usize, spans: &[ClassSpan]) -> Self {
        let count = |class| {
            let of_class = spans.iter().filter(|span| span.class == class);
            of_class.map(|span| span.samples).sum::<usize>()
        };
        let (uncertain, substituted) = (count(Class::Uncertain), count(Class::Substituted));
        let bad = count(Class::Bad);
        Self {
            good: samples.saturating_sub(uncertain + substituted + bad),
            uncertain,
            substituted,
            bad,
        }
    }

    /// Whether every sample is good.
    #[must_use]
    pub fn all_good(&self) -> bool {
        self.uncertain + self.substituted + self.bad == 0
    }
}

impl ClassSpan {
    /// The spans of samples that are not good, of classes in the order of the samples.
    pub fn of(classes: impl Iterator<Item = Class>) -> Vec<Self> {
        let mut spans: Vec<Self> = Vec::new();
        for (k, class) in classes.enumerate() {
            match spans.last_mut() {
                _ if class == Class::Good => {}
                Some(last) if last.class == class && last.first + last.samples == k => {
                    last.samples += 1;
                }
                _ => spans.push(Self {
                    class,
                    first: k,
                    samples: 1,
                }),
            }
        }
        spans
    }
}

impl ClassSpan {
    /// How many spans samples of these classes make.
    pub(crate) fn count(classes: &[Class]) -> usize {
        let begins = |k: &usize| {
            let class = classes[*k];
            class != Class::Good && (*k == 0 || classes[*k - 1] != class)
        };
        (0..classes.len()).filter(begins).count()
    }
}

impl Signal {
    /// A signal that is in SI already.
    #[must_use]
    pub fn new(name: impl Into<String>, unit: impl Into<String>, values: Vec<f64>) -> Self {
        let unit = unit.into();
        Self {
            name: name.into(),
            recorded_unit: unit.clone(),
            unit,
            interpolation: None,
            classes: Vec::new(),
            values,
        }
    }

    /// The class of each sample.
    #[must_use]
    pub fn class_of_each(&self) -> Vec<Class> {
        let mut classes = vec![Class::Good; self.values.len()];
        for span in &self.classes {
            classes[span.first..span.first + span.samples].fill(span.class);
        }
        classes
    }

    /// How many samples are missing.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.values.iter().filter(|value| value.is_nan()).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_in_a_row_are_one_span_and_good_samples_none() {
        use Class::{Bad, Good, Uncertain};
        let classes = [Good, Uncertain, Uncertain, Bad, Good, Bad];
        let spans = ClassSpan::of(classes.into_iter());
        let span = |class, first, samples| ClassSpan {
            class,
            first,
            samples,
        };
        assert_eq!(
            spans,
            [span(Uncertain, 1, 2), span(Bad, 3, 1), span(Bad, 5, 1)]
        );
        let counts = ClassCounts::of(classes.len(), &spans);
        assert_eq!((counts.good, counts.uncertain, counts.bad), (2, 2, 2));
        assert!(!counts.all_good());
    }
}
