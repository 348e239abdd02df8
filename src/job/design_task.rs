//! A design as a job: what is stored as its specification.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::JobKind;
use greybox::identification::spec::LimitsSpec;
use greybox::identification::spec::design::{DesignSpec, PastJob};
use greybox::identification::{DatasetId, JobId};

/// The specification of a job that designs an experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DesignTask {
    /// Always `design`.
    kind: JobKind,
    /// What was asked for, as it came; a model that it brought along stands by its reference.
    #[schema(value_type = Object)]
    pub design: Value,
    /// The recordings of the job that the design goes on from.
    experiments: Vec<RecordingOfDesign>,
    /// When the design stops at the latest.
    limits: LimitsSpec,
}

/// A recording that a design reads.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RecordingOfDesign {
    /// The identifier of the recording.
    dataset: DatasetId,
}

impl DesignTask {
    /// The task of a document that goes on from a finished job, or from none.
    #[must_use]
    pub fn new(design: Value, past: Option<&PastJob<'_>>, max_duration_s: f64) -> DesignTask {
        let experiments = past.map_or(&[][..], |past| &past.spec.experiments);
        let experiments = experiments.iter().map(|experiment| RecordingOfDesign {
            dataset: experiment.dataset,
        });
        DesignTask {
            kind: JobKind::Design,
            design,
            experiments: experiments.collect(),
            limits: LimitsSpec { max_duration_s },
        }
    }

    /// The recordings that it reads, each once.
    #[must_use]
    pub fn datasets(&self) -> Vec<DatasetId> {
        let mut datasets: Vec<_> = self.experiments.iter().map(|own| own.dataset).collect();
        datasets.sort();
        datasets.dedup();
        datasets
    }

    /// The job that a stored specification goes on from, where it is one of a design that does.
    #[must_use]
    pub fn past_job(spec: &Value) -> Option<JobId> {
        DesignSpec::past_job(spec.get("design")?)
    }
}
