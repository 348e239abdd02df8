//! Trajectories and disturbances of finished jobs, computed when a client asks and kept for a while.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::ApiState;
use super::error::Answer;
use super::finished_job::FinishedJob;
use super::jobs::no_job;
use super::simulated::{CachedExperiment, ComputedCache};
use greybox::identification::assemble::{ExperimentDisturbances, ExperimentTrajectory};
use greybox::identification::{DatasetId, JobId};

/// A trajectory or disturbances of one experiment of a finished job.
pub trait ComputedExperiment: CachedExperiment + Send + Sync + Sized + 'static {
    /// The recording.
    fn dataset(&self) -> DatasetId;
    /// The results that were computed lately.
    fn cache(state: &ApiState) -> &ComputedCache<Self>;
    /// All experiments of a finished job: computing, not for the runtime's own threads.
    ///
    /// # Errors
    ///
    /// The simulation fails or was stopped, or the recordings no longer fit the job.
    fn compute(job: &FinishedJob, stop: &AtomicBool) -> Answer<Vec<Self>>;
}

impl ComputedExperiment for ExperimentTrajectory {
    fn dataset(&self) -> DatasetId {
        self.dataset
    }

    fn cache(state: &ApiState) -> &ComputedCache<Self> {
        &state.simulated
    }

    fn compute(job: &FinishedJob, stop: &AtomicBool) -> Answer<Vec<Self>> {
        job.trajectory(stop)
    }
}

impl ComputedExperiment for ExperimentDisturbances {
    fn dataset(&self) -> DatasetId {
        self.dataset
    }

    fn cache(state: &ApiState) -> &ComputedCache<Self> {
        &state.smoothed
    }

    fn compute(job: &FinishedJob, stop: &AtomicBool) -> Answer<Vec<Self>> {
        job.disturbances(stop)
    }
}

/// The experiments of a finished job, computed now or a moment ago.
///
/// # Errors
///
/// There is no such job, it has no result, its recording has been removed, or the computation fails.
pub async fn computed<T: ComputedExperiment>(state: &ApiState, id: JobId) -> Answer<Arc<Vec<T>>> {
    let row = state
        .store
        .jobs()
        .find(id)
        .await?
        .ok_or_else(|| no_job(id))?;
    if let Some(kept) = T::cache(state).get(id, row.revision) {
        let mut there = true;
        for experiment in kept.iter() {
            there &= state
                .store
                .datasets()
                .find(experiment.dataset())
                .await?
                .is_some();
        }
        if there {
            return Ok(kept);
        }
    }
    let job = FinishedJob::read(state, id).await?;
    let revision = job.row.revision;
    let computed = state
        .work
        .compute(move |stop| T::compute(&job, stop).map(Arc::new));
    let computed = computed.await?;
    T::cache(state).keep(id, revision, &computed);
    Ok(computed)
}
