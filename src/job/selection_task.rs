//! A selection as a job: what is stored as its specification.

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{JobKind, RecordingOfPast};
use greybox::identification::DatasetId;
use greybox::identification::spec::LimitsSpec;
use greybox::identification::spec::design::PastJob;
use greybox::identification::spec::selection::SelectionRequest;

/// The specification of a job that selects windows of a stream.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SelectionTask {
    /// Always `selection`.
    kind: JobKind,
    /// The request as it came.
    #[schema(value_type = Object)]
    pub selection: SelectionRequest,
    /// Where the first window begins.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
    /// Where the last window ends.
    #[schema(value_type = String, format = DateTime)]
    pub to: Timestamp,
    /// The recordings of the job that the selection goes on from.
    experiments: Vec<RecordingOfPast>,
    /// When the selection stops at the latest.
    pub limits: LimitsSpec,
    /// What people should know of the job.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub note: Option<String>,
}

impl SelectionTask {
    /// The task of a document that goes on from a finished job, over a part of its stream.
    #[must_use]
    pub fn new(
        selection: SelectionRequest,
        past: &PastJob<'_>,
        (from, to): (Timestamp, Timestamp),
        max_duration_s: f64,
    ) -> SelectionTask {
        SelectionTask {
            kind: JobKind::Selection,
            selection,
            from,
            to,
            experiments: RecordingOfPast::all(past),
            limits: LimitsSpec { max_duration_s },
            note: None,
        }
    }
    /// The recordings of the job that the selection goes on from.
    #[must_use]
    pub fn datasets(&self) -> Vec<DatasetId> {
        RecordingOfPast::datasets(&self.experiments)
    }
}
