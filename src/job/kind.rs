//! What a job does.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

/// What a job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// It estimates the parameters of a model from recordings.
    Identification,
    /// It looks for the next experiment.
    Design,
}

impl JobKind {
    /// The kind of a job by its stored specification.
    #[must_use]
    pub fn of(spec: &Value) -> JobKind {
        let kind = spec.get("kind").map(JobKind::deserialize);
        match kind {
            Some(Ok(kind)) => kind,
            _ => JobKind::Identification,
        }
    }
}
