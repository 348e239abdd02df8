//! Results that were simulated lately: a plot that is looked at closer and closer asks for the same simulation
//! again and again.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use super::ApiState;
use super::error::Answer;
use super::finished_job::FinishedJob;
use super::jobs::no_job;
use greybox::identification::assemble::{ExperimentDisturbances, ExperimentTrajectory};
use greybox::identification::{DatasetId, JobId};

/// Numbers of one cache at the most, all results together: 128 MB.
const MOST_NUMBERS: u64 = 16 << 20;

/// What is computed of an experiment of a finished job for whoever looks at it.
pub trait ComputedExperiment: Send + Sync + Sized + 'static {
    /// The recording.
    fn dataset(&self) -> DatasetId;
    /// The number of numbers that are kept.
    fn count_numbers(&self) -> usize;
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

    fn count_numbers(&self) -> usize {
        self.time.len() * (1 + 4 * self.outputs.len())
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

    fn count_numbers(&self) -> usize {
        let columns = 3 * self.disturbances.len() + 2 * self.states.len() + 3 * self.outputs.len();
        self.time.len() * (1 + columns)
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

/// Results by job, each with the revision of the job.
pub struct ComputedCache<T>(Cache<JobId, (i64, Arc<Vec<T>>), NumberCount>);

impl<T: ComputedExperiment> Default for ComputedCache<T> {
    fn default() -> Self {
        // One large result may fill the only shard.
        let options = OptionsBuilder::new()
            .shards(1)
            .estimated_items_capacity(100)
            .weight_capacity(MOST_NUMBERS)
            .build()
            .expect("all that an option needs is given");
        let (hasher, lifecycle) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
        Self(Cache::with_options(options, NumberCount, hasher, lifecycle))
    }
}

impl<T: ComputedExperiment> ComputedCache<T> {
    /// The result of a revision of a job, where the cache has it.
    pub fn get(&self, job: JobId, revision: i64) -> Option<Arc<Vec<T>>> {
        let (kept, computed) = self.0.get(&job)?;
        (kept == revision).then_some(computed)
    }

    /// Keeps what was computed, in the place of what is asked for less.
    pub fn keep(&self, job: JobId, revision: i64, computed: &Arc<Vec<T>>) {
        self.0.insert(job, (revision, computed.clone()));
    }
}

/// Counts the numbers of a result.
#[derive(Clone)]
struct NumberCount;

impl<T: ComputedExperiment> Weighter<JobId, (i64, Arc<Vec<T>>)> for NumberCount {
    fn weight(&self, _job: &JobId, (_revision, computed): &(i64, Arc<Vec<T>>)) -> u64 {
        let numbers = computed.iter().map(ComputedExperiment::count_numbers);
        numbers.sum::<usize>() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn simulated(samples: usize) -> Arc<Vec<ExperimentTrajectory>> {
        Arc::new(vec![ExperimentTrajectory {
            dataset: DatasetId::new(),
            time: vec![0.0; samples],
            estimation_samples: samples,
            outputs: Vec::new(),
        }])
    }

    #[test]
    fn a_result_is_kept_until_its_job_changes() {
        let (cache, job) = (ComputedCache::default(), JobId::new());
        let first = simulated(10);
        cache.keep(job, 3, &first);
        assert!(cache.get(job, 3).is_some_and(|of| Arc::ptr_eq(&of, &first)));
        assert!(cache.get(JobId::new(), 3).is_none());
        assert!(cache.get(job, 4).is_none());
        let second = simulated(10);
        cache.keep(job, 4, &second);
        assert!(cache.get(job, 3).is_none(), "the older one is given up");
    }

    #[test]
    fn the_numbers_that_are_kept_are_bounded() {
        let cache = ComputedCache::default();
        let jobs: Vec<JobId> = (0..5).map(|_| JobId::new()).collect();
        let third = simulated(MOST_NUMBERS as usize / 3);
        for job in &jobs {
            cache.keep(*job, 1, &third);
        }
        let n_kept = jobs
            .iter()
            .filter(|job| cache.get(**job, 1).is_some())
            .count();
        assert!((1..=3).contains(&n_kept), "{n_kept}");
    }
}
