//! What a report is made from.

use crate::identification::JobSpec;
use crate::identification::assemble::{ExperimentDisturbances, ExperimentTrajectory};
use crate::identification::outcome::Outcome;
use greybox_simulation::model::ModelDescription;
use serde::Serialize;
use utoipa::ToSchema;

/// What a page is made from.
#[derive(Clone, Copy, Debug)]
pub struct Report<'a> {
    /// The job's name, or what else to call it.
    pub title: &'a str,
    /// The end of the job, as the report shows it.
    pub finished_at: Option<&'a str>,
    /// The specification of the job.
    pub spec: &'a JobSpec,
    /// The model.
    pub model: &'a ModelDescription,
    /// The recordings, one for each experiment.
    pub recordings: &'a [RecordingFacts],
    /// The result of the job.
    pub outcome: &'a Outcome,
    /// The history of the search.
    pub generations: &'a [GenerationCosts],
    /// Measured and simulated outputs.
    pub experiments: &'a [ExperimentTrajectory],
    /// What acted on the plant beside its inputs; empty where the result has no process noise.
    pub disturbances: &'a [ExperimentDisturbances],
}

/// What a generation of the search came to.
#[derive(Clone, Copy, Debug)]
pub struct GenerationCosts {
    /// Counts from 1.
    pub generation: u32,
    /// The lowest cost so far; absent while every candidate diverged.
    pub best: Option<f64>,
    /// The mean cost of the generation's candidates that did not diverge.
    pub mean: Option<f64>,
}

/// What a report says of a recording.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct RecordingFacts {
    /// The identifier of the recording.
    pub id: String,
    /// The name of the recording for people.
    pub name: Option<String>,
    /// The digest of the bytes of the recording.
    pub digest: String,
    /// When the first sample of the recording was taken, where its source said so.
    pub start: Option<String>,
    /// The zone that the source of the recording counted in, where it said one.
    pub zone: Option<String>,
    /// The samples of each signal.
    pub samples: usize,
    /// From the first to the last sample `[s]`.
    pub duration_s: f64,
}
