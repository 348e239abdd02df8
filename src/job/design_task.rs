//! A design as a job: what is stored as its specification.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{JobKind, RecordingOfPast};
use greybox::identification::DatasetId;
use greybox::identification::spec::LimitsSpec;
use greybox::identification::spec::design::{DesignRequest, PastJob};

/// The specification of a job that designs an experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DesignTask {
    /// Always `design`.
    kind: JobKind,
    /// The request as it came; a model that came along stands by its reference.
    #[schema(value_type = Object)]
    pub design: DesignRequest,
    /// The recordings of the job that the design goes on from.
    experiments: Vec<RecordingOfPast>,
    /// When the design stops at the latest.
    pub limits: LimitsSpec,
    /// What people should know of the job.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub note: Option<String>,
}

impl DesignTask {
    /// The task of a document that goes on from a finished job, or from none.
    #[must_use]
    pub fn new(
        design: DesignRequest,
        past: Option<&PastJob<'_>>,
        max_duration_s: f64,
    ) -> DesignTask {
        DesignTask {
            kind: JobKind::Design,
            design,
            experiments: past.map_or_else(Vec::new, RecordingOfPast::all),
            limits: LimitsSpec { max_duration_s },
            note: None,
        }
    }

    /// The recordings that the design reads, one for each experiment of the job that the design goes
    /// on from.
    #[must_use]
    pub fn datasets(&self) -> Vec<DatasetId> {
        RecordingOfPast::datasets(&self.experiments)
    }
}
