//! One recording and how the model sees it.

use super::spec::{
    ExperimentRole, FixedValue, FreeState, InitialStateSpec, ParameterSpec, StateRange, WindowSpec,
};
use greybox_recording::Recording;
use serde::Serialize;
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// One recording that the model shall explain, and what is known of it alone.
///
/// A signal of the model that is not assigned is the recording's signal of that name. A
/// [`Recording`] by itself is an experiment with every default.
///
/// ```
/// use greybox::{Experiment, Recording};
///
/// # let recording = Recording::from_samples(0.01, [("F", "N", vec![0.0]), ("position", "m", vec![0.0])]);
/// let second_run = Experiment::new(recording)
///     .signal("force", "F")
///     .window(0.5..=30.0)
///     .start("velocity", 0.0)
///     .fix("mass", 62.0);
/// ```
#[derive(Clone, Debug)]
pub struct Experiment {
    pub(super) recording: Recording,
    pub(super) section: ExperimentSection,
}

/// What a program says of an experiment beside its recording.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct ExperimentSection {
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    signals: BTreeMap<String, String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    window: Option<WindowSpec>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    initial_state: BTreeMap<String, InitialStateSpec>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    parameters: BTreeMap<String, GivenParameter>,
    role: ExperimentRole,
}

/// What a program says of a parameter.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub(super) enum GivenParameter {
    /// All that can be said.
    Whole(ParameterSpec),
    /// The bounds of the search alone, along the scale of the model.
    Range {
        /// The bounds.
        estimate: StateRange,
    },
}

impl GivenParameter {
    /// A known value.
    pub(super) fn fixed(value: f64) -> GivenParameter {
        GivenParameter::Whole(ParameterSpec::Fixed(known(value)))
    }

    /// An unknown value between two bounds.
    pub(super) fn free(range: &RangeInclusive<f64>) -> GivenParameter {
        GivenParameter::Range {
            estimate: bounds(range),
        }
    }
}

fn known(value: f64) -> FixedValue {
    FixedValue {
        value,
        tolerance: None,
    }
}

fn bounds(range: &RangeInclusive<f64>) -> StateRange {
    StateRange {
        lower: *range.start(),
        upper: *range.end(),
    }
}

impl Experiment {
    /// All of a recording.
    #[must_use]
    pub fn new(recording: Recording) -> Experiment {
        Experiment {
            recording,
            section: ExperimentSection::default(),
        }
    }

    /// The recorded signal that one of the model's inputs or outputs is. As soon as one is named,
    /// all that are used have to be.
    #[must_use]
    pub fn signal(mut self, of_model: &str, recorded: &str) -> Experiment {
        self.section
            .signals
            .insert(of_model.to_owned(), recorded.to_owned());
        self
    }

    /// The part of the recording to use, seconds from its first sample.
    #[must_use]
    pub fn window(mut self, seconds: RangeInclusive<f64>) -> Experiment {
        self.section.window = Some(WindowSpec {
            from_s: Some(*seconds.start()),
            to_s: Some(*seconds.end()),
            from: None,
            to: None,
        });
        self
    }

    /// Where a state starts, SI.
    #[must_use]
    pub fn start(self, state: &str, value: f64) -> Experiment {
        self.with_start(state, InitialStateSpec::Fixed(known(value)))
    }

    /// Between which values the unknown start of a state is looked for, SI.
    #[must_use]
    pub fn free_start(self, state: &str, range: RangeInclusive<f64>) -> Experiment {
        let free = FreeState {
            estimate: bounds(&range),
            prior: None,
        };
        self.with_start(state, InitialStateSpec::Free(free))
    }

    fn with_start(mut self, state: &str, start: InitialStateSpec) -> Experiment {
        self.section.initial_state.insert(state.to_owned(), start);
        self
    }

    /// The value of a parameter in this experiment alone, SI.
    #[must_use]
    pub fn fix(self, parameter: &str, value: f64) -> Experiment {
        self.with_parameter(parameter, GivenParameter::fixed(value))
    }

    /// A parameter with an unknown value of its own in this experiment, SI.
    #[must_use]
    pub fn free(self, parameter: &str, range: RangeInclusive<f64>) -> Experiment {
        self.with_parameter(parameter, GivenParameter::free(&range))
    }

    fn with_parameter(mut self, name: &str, given: GivenParameter) -> Experiment {
        self.section.parameters.insert(name.to_owned(), given);
        self
    }

    /// Nothing is estimated from it: it only checks the estimate.
    #[must_use]
    pub fn only_validates(mut self) -> Experiment {
        self.section.role = ExperimentRole::Validation;
        self
    }
}

impl From<Recording> for Experiment {
    fn from(recording: Recording) -> Experiment {
        Experiment::new(recording)
    }
}
