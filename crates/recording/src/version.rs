//! A version of a recording: the recording as it came, and what of it people marked as bad.

use super::ExcludedSpan;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A span of time that somebody marked as bad, both ends included; one sample where both ends are equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    /// The beginning of the span `[s]`, from the first sample of the recording.
    #[schema(minimum = 0)]
    pub from_s: f64,
    /// The end of the span `[s]`, from the first sample of the recording.
    #[schema(minimum = 0)]
    pub to_s: f64,
    /// The recording's signals that are bad there; all when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signals: Option<Vec<String>>,
    /// Why the span is bad, for people.
    #[schema(min_length = 1, max_length = 200, example = "sensor unplugged")]
    pub reason: String,
}

/// A version of a recording. An experiment does without the samples that the version marks, as without those that
/// it excludes itself.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordingVersion {
    /// Which version; 0 is the recording as it came.
    pub number: u32,
    /// The marks: every stretch that the version says is bad.
    pub marks: Vec<Mark>,
}

impl Mark {
    /// The span without its reason.
    #[must_use]
    pub fn span(&self) -> ExcludedSpan {
        ExcludedSpan {
            from_s: self.from_s,
            to_s: self.to_s,
            signals: self.signals.clone(),
        }
    }
}
