//! What a plant delivered, and the experiments cut from it.
//!
//! A [`Recording`] is named signals over one time axis, in SI units; [`Received`] is the same on its
//! way to where it is kept, and need not be in memory. An [`Experiment`] is the part of it that one
//! estimation uses: uniform in time, cut to a window, under the model's signal names. A missing
//! sample is NaN in both and is never invented; outside this module it is `null` or an empty field.

mod axis;
pub(crate) mod columns;
mod decimate;
mod error;
mod experiment;
mod export;
mod profile;
mod quality;
mod received;
mod resample;
mod split;
mod summary;

pub use axis::TimeAxis;
pub use columns::{NewScratch, Scratch};
pub use decimate::{SampledSignal, Samples, kept_indices};
pub use error::ExperimentError;
pub use experiment::Experiment;
pub use quality::{QualityReport, Warning};
pub use received::{Named, Received};
pub use split::{Split, Window};
pub use summary::{SignalSummary, Summary};

/// The most signals one recording may have.
pub const MAX_SIGNALS: usize = 1000;

/// The longest signal name, in characters.
pub const MAX_NAME_CHARACTERS: usize = 200;

/// The fewest samples of a recording: two make a sample time.
pub const MIN_SAMPLES: usize = 2;

/// Signals that were recorded together, in SI units.
#[derive(Clone, Debug)]
pub struct Recording {
    /// A name for people.
    pub name: Option<String>,
    /// The instant of the first sample, where the source gave one.
    pub start: Option<jiff::Timestamp>,
    /// When the samples were taken.
    pub time: TimeAxis,
    /// The signals in the order of the source; each as long as `time`.
    pub signals: Vec<Signal>,
    /// What reading changed or assumed, e.g. rows that were dropped.
    pub notes: Vec<Warning>,
}

/// One recorded quantity.
#[derive(Clone, Debug)]
pub struct Signal {
    /// The name, unique in its recording.
    pub name: String,
    /// The SI unit of `values`; empty where the source gave no unit.
    pub unit: String,
    /// The unit as the source wrote it; empty where it gave none.
    pub recorded_unit: String,
    /// The samples in `unit`; NaN is a missing sample.
    pub values: Vec<f64>,
}

impl Recording {
    /// A recording with neither name nor start.
    #[must_use]
    pub fn new(time: TimeAxis, signals: Vec<Signal>) -> Self {
        Self {
            name: None,
            start: None,
            time,
            signals,
            notes: Vec::new(),
        }
    }

    /// The signal of that name.
    #[must_use]
    pub fn signal(&self, name: &str) -> Option<&Signal> {
        self.signals.iter().find(|signal| signal.name == name)
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
            values,
        }
    }

    /// How many samples are missing.
    #[must_use]
    pub fn missing(&self) -> usize {
        self.values.iter().filter(|value| value.is_nan()).count()
    }
}

/// Why `name` cannot name a signal or a recording: a code and a sentence.
pub(crate) fn name_fault(name: &str) -> Option<(&'static str, String)> {
    if name.is_empty() {
        Some(("empty_name", "the name is empty".to_owned()))
    } else if name.chars().count() > MAX_NAME_CHARACTERS {
        let start: String = name.chars().take(20).collect();
        let detail = format!(
            "the name starting with `{start}` is longer than {MAX_NAME_CHARACTERS} characters"
        );
        Some(("name_too_long", detail))
    } else if name.chars().any(char::is_control) {
        let detail = format!("the name {name:?} has a control character in it");
        Some(("control_character", detail))
    } else {
        None
    }
}
