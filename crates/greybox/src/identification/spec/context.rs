//! The context of a document: the models and recordings against which a job is read.

use std::collections::HashMap;

use super::version::RecordingVersions;
use crate::identification::DatasetId;
use greybox_recording::Summary;
use greybox_simulation::model::ModelDescription;

/// The models, recordings and limits against which a document is read.
pub struct Context<'a> {
    /// The models that there are.
    pub models: Vec<&'a ModelDescription>,
    /// The recordings that the document may name; see [`JobSpec::datasets_named`](super::JobSpec::datasets_named).
    pub datasets: &'a HashMap<DatasetId, Summary>,
    /// The versions of those recordings that have any; nothing where versions of recordings are not kept.
    pub versions: Option<&'a HashMap<DatasetId, RecordingVersions>>,
    /// The longest computing time that a job may ask for `[s]`.
    pub max_duration_s: f64,
}
