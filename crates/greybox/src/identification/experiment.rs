//! One recording and how the model sees it.

use greybox_recording::Recording;
use serde_json::{Map, Value, json};
use std::ops::RangeInclusive;

/// One recording that the model shall explain, and what is known of it alone.
///
/// What is not said is taken by name: signals of the recording that are called as the model calls
/// them. A [`Recording`] by itself is an experiment of which nothing more is known.
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
    /// What the job's document says of it.
    pub(super) document: Map<String, Value>,
}

impl Experiment {
    /// All of a recording.
    #[must_use]
    pub fn new(recording: Recording) -> Experiment {
        Experiment {
            recording,
            document: Map::new(),
        }
    }

    /// The recorded signal that one of the model's inputs or outputs is. As soon as one is named,
    /// all that are used have to be.
    #[must_use]
    pub fn signal(self, of_model: &str, recorded: &str) -> Experiment {
        self.with("signals", of_model, json!(recorded))
    }

    /// The part of the recording to use, seconds from its first sample.
    #[must_use]
    pub fn window(mut self, seconds: RangeInclusive<f64>) -> Experiment {
        let window = json!({"from_s": seconds.start(), "to_s": seconds.end()});
        self.document.insert("window".to_owned(), window);
        self
    }

    /// Where a state starts, SI.
    #[must_use]
    pub fn start(self, state: &str, value: f64) -> Experiment {
        self.with("initial_state", state, json!({ "value": value }))
    }

    /// Between which values the unknown start of a state is looked for, SI.
    #[must_use]
    pub fn free_start(self, state: &str, range: RangeInclusive<f64>) -> Experiment {
        self.with("initial_state", state, estimated(&range))
    }

    /// The value of a parameter in this experiment alone, SI.
    #[must_use]
    pub fn fix(self, parameter: &str, value: f64) -> Experiment {
        self.with("parameters", parameter, json!({ "value": value }))
    }

    /// A parameter with an unknown value of its own in this experiment, SI.
    #[must_use]
    pub fn free(self, parameter: &str, range: RangeInclusive<f64>) -> Experiment {
        self.with("parameters", parameter, estimated(&range))
    }

    /// Nothing is estimated from it: it only checks the estimate.
    #[must_use]
    pub fn only_validates(mut self) -> Experiment {
        self.document.insert("role".to_owned(), json!("validation"));
        self
    }

    fn with(mut self, section: &str, name: &str, value: Value) -> Experiment {
        let section = self.document.entry(section).or_insert_with(|| json!({}));
        section[name] = value;
        self
    }
}

impl From<Recording> for Experiment {
    fn from(recording: Recording) -> Experiment {
        Experiment::new(recording)
    }
}

/// A search range as documents write it.
pub(super) fn estimated(range: &RangeInclusive<f64>) -> Value {
    json!({"estimate": {"lower": range.start(), "upper": range.end()}})
}
