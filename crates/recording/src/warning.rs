//! What is odd about a recording, in words and with its place.

use super::TimeAxis;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Spans that a warning names.
pub(super) const MOST_SPANS: usize = 100;

/// One oddity.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Warning {
    /// The kind of the warning, e.g. `gap` or `saturated_signal`.
    pub code: String,
    /// The signal that the warning is about; `null` for the recording as a whole.
    pub signal: Option<String>,
    /// A sentence with the numbers.
    pub detail: String,
    /// Where the oddity is, where it has a place: the first hundred spans.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false)]
    pub spans: Vec<TimeSpan>,
}

/// A span of time, from its first to its last sample.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TimeSpan {
    /// The beginning of the span `[s]`, from the first sample of the recording.
    pub from_s: f64,
    /// The end of the span `[s]`, from the first sample of the recording.
    pub to_s: f64,
}

impl Warning {
    /// About the recording as a whole.
    #[must_use]
    pub fn of_recording(code: &str, detail: String) -> Self {
        Self {
            code: code.to_owned(),
            signal: None,
            detail,
            spans: Vec::new(),
        }
    }

    /// About one signal.
    #[must_use]
    pub fn of_signal(code: &str, signal: &str, detail: String) -> Self {
        Self {
            signal: Some(signal.to_owned()),
            ..Self::of_recording(code, detail)
        }
    }

    /// With where it is: samples by the index of the first and their number.
    pub(super) fn at(
        mut self,
        time: &TimeAxis,
        samples: impl Iterator<Item = (usize, usize)>,
    ) -> Self {
        let span = |(first, samples): (usize, usize)| TimeSpan {
            from_s: time.instant(first),
            to_s: time.instant(first + samples.max(1) - 1),
        };
        self.spans = samples.take(MOST_SPANS).map(span).collect();
        self
    }
}
