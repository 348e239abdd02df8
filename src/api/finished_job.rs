//! A finished job with all that its result was made from, for whoever shows it again.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use axum::http::{StatusCode, header};

use super::ApiState;
use super::error::{Answer, Kind, Problem};
use super::jobs::{no_job, retry_after};
use super::work::stopped;
use crate::admission::Permit;
use crate::job::{JobKind, Status};
use crate::store::{JobRow, Results, StoredResult};
use greybox::identification::assemble::{
    self, ExperimentDisturbances, ExperimentTrajectory, PastResult,
};
use greybox::identification::spec::design::PastJob;
use greybox::identification::{JobId, JobSpec, Outcome};
use greybox::model::Model;
use greybox::parsing::Fault;
use greybox::recording::Recording;

/// A job that has a result, its recordings and its model.
pub struct FinishedJob {
    /// The job as it is stored.
    pub row: Arc<JobRow>,
    /// The specification of the job.
    pub spec: JobSpec,
    /// The result of the job.
    pub outcome: Outcome,
    recordings: Vec<Arc<Recording>>,
    model: Arc<Model>,
    /// Recordings take memory: only so many at once.
    _permit: Permit,
}

impl FinishedJob {
    /// Read from the store.
    ///
    /// # Errors
    ///
    /// There is no such job, it is a design or a selection, it has no result or not yet, or its recording has been
    /// removed.
    pub async fn read(state: &ApiState, id: JobId) -> Answer<FinishedJob> {
        let row = state
            .store
            .jobs()
            .find(id)
            .await?
            .ok_or_else(|| no_job(id))?;
        let Some(spec) = row.task.identification().cloned() else {
            let detail = match row.task.kind() {
                JobKind::Selection => "the job selects windows of a stream: it estimates nothing",
                _ => "the job designs an experiment: it estimates nothing",
            };
            return Err(Problem::new(Kind::WrongState, detail));
        };
        let result = result_of(state.store.results(), &row).await?;
        let permit = state.work.recording_permit().await?;
        let outcome = result.outcome().map_err(unreadable)?;
        let recordings = state.recordings(&spec).await?.map_err(removed)?;
        let model = state.library.model(&row.project, &spec.model).await?;
        Ok(FinishedJob {
            row,
            spec,
            outcome,
            recordings,
            model,
            _permit: permit,
        })
    }

    /// The model that the result was made with.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// A shared reference to the model, for a caller that keeps the model.
    pub fn shared_model(&self) -> Arc<Model> {
        Arc::clone(&self.model)
    }

    /// The job and the noise that the job found, as the document of a next job is read against.
    pub fn as_past_job(&self) -> PastJob<'_> {
        PastJob::new(&self.spec, &self.outcome)
    }

    /// What the design of a next experiment begins from.
    pub fn as_past(&self) -> PastResult<'_> {
        PastResult {
            spec: &self.spec,
            outcome: &self.outcome,
            recordings: &self.recordings,
        }
    }

    /// The experiments measured and simulated at the estimate: computing, not for the runtime's
    /// own threads.
    ///
    /// # Errors
    ///
    /// The simulation fails or was stopped, or the recordings no longer fit the job.
    pub fn trajectory(&self, stop: &AtomicBool) -> Answer<Vec<ExperimentTrajectory>> {
        let (spec, outcome) = (&self.spec, &self.outcome);
        let shown = assemble::trajectory(spec, &self.model, &self.recordings, outcome, stop);
        shown.map_err(Problem::of_document)?.ok_or_else(stopped)
    }

    /// What acted on the plant over the recordings: computing, not for the runtime's own threads.
    ///
    /// # Errors
    ///
    /// The result has no process noise, the filter fails or was stopped, or the recordings no longer fit the job.
    pub fn disturbances(&self, stop: &AtomicBool) -> Answer<Vec<ExperimentDisturbances>> {
        let report = self.outcome.process_noise.as_ref();
        let report = report.filter(|report| !report.disturbances.is_empty());
        let report = report.ok_or_else(|| self.without_disturbance())?;
        let shown = assemble::disturbances(&self.as_past(), &self.model, report, stop);
        shown.map_err(Problem::of_document)?.ok_or_else(stopped)
    }

    /// Why the result has no disturbance.
    fn without_disturbance(&self) -> Problem {
        let detail = match (
            &self.outcome.process_noise,
            self.spec.looks_for_disturbances(),
        ) {
            (Some(_), _) => {
                "the result has no disturbance: of the noise models that were compared, `none` was chosen"
            }
            (None, false) => {
                "the result has no process noise: the job says that nothing acts; submit the job with \
                 `\"process_noise\": \"auto\"`"
            }
            (None, true) => {
                "the result has no process noise: the residuals of the free run are white, or the job ended \
                 before noise models were compared"
            }
        };
        Problem::new(Kind::WrongState, detail)
    }
}

/// The result of a job that has one.
pub async fn result_of(results: &Results, row: &JobRow) -> Answer<StoredResult> {
    let finished = row.status.is_terminal() || row.status == Status::Paused;
    if finished && let Some(result) = results.find(row.id).await? {
        return Ok(result);
    }
    let detail = match row.status {
        Status::Failed => "the job failed, its `error` says why".to_owned(),
        status if finished => format!("the job was {status} before it had an estimate"),
        status => format!("the job is {status} and has no result yet"),
    };
    let problem = Problem::new(Kind::WrongState, detail);
    Err(match retry_after(row) {
        Some(retry) => problem.with_header(header::RETRY_AFTER, retry),
        None => problem,
    })
}

/// The stored text does not read back: the server is at fault.
pub fn unreadable(error: serde_json::Error) -> Problem {
    tracing::error!(%error, "a stored job does not read back");
    Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR)
}

/// The job has its result, but what it was made from has been removed since.
fn removed(faults: Vec<Fault>) -> Problem {
    Problem::of_faults(Kind::WrongState, faults)
}
