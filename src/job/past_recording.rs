//! The recordings of a finished job that another job goes on from.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use greybox::identification::DatasetId;
use greybox::identification::spec::design::PastJob;

/// A recording of the finished job that a job goes on from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RecordingOfPast {
    /// The identifier of the recording.
    dataset: DatasetId,
}

impl RecordingOfPast {
    /// One for each experiment of a finished job.
    #[must_use]
    pub fn all(past: &PastJob<'_>) -> Vec<RecordingOfPast> {
        let experiments = past.spec.experiments.iter();
        let recordings = experiments.map(|experiment| RecordingOfPast {
            dataset: experiment.dataset,
        });
        recordings.collect()
    }

    /// The identifiers of recordings.
    #[must_use]
    pub fn datasets(recordings: &[RecordingOfPast]) -> Vec<DatasetId> {
        recordings
            .iter()
            .map(|recording| recording.dataset)
            .collect()
    }
}
