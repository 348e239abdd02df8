//! What a job does.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a job does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobKind {
    /// It estimates the parameters of a model from recordings.
    Identification,
    /// It looks for the next experiment.
    Design,
    /// It looks for the windows of a stream that fix the parameters of a finished job.
    Selection,
}
