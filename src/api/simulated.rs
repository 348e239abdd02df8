//! Results that were simulated lately: a plot that is looked at closer and closer asks for the same simulation
//! again and again.

use std::sync::Arc;

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use greybox::identification::JobId;
use greybox::identification::assemble::{ExperimentDisturbances, ExperimentTrajectory};

/// Numbers of one cache at the most, all results together: 128 MB.
const MOST_NUMBERS: u64 = 16 << 20;

/// An experiment of a result that a cache keeps.
pub trait CachedExperiment {
    /// The number of numbers that are kept.
    fn count_numbers(&self) -> usize;
}

impl CachedExperiment for ExperimentTrajectory {
    fn count_numbers(&self) -> usize {
        self.time.len() * (1 + 4 * self.outputs.len())
    }
}

impl CachedExperiment for ExperimentDisturbances {
    fn count_numbers(&self) -> usize {
        let columns = 3 * self.disturbances.len() + 2 * self.states.len() + 3 * self.outputs.len();
        self.time.len() * (1 + columns)
    }
}

/// Results by job, each with the revision of the job.
pub struct ComputedCache<T>(Cache<JobId, (i64, Arc<Vec<T>>), NumberCount>);

impl<T: CachedExperiment> Default for ComputedCache<T> {
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

impl<T: CachedExperiment> ComputedCache<T> {
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

impl<T: CachedExperiment> Weighter<JobId, (i64, Arc<Vec<T>>)> for NumberCount {
    fn weight(&self, _job: &JobId, (_revision, computed): &(i64, Arc<Vec<T>>)) -> u64 {
        let numbers = computed.iter().map(CachedExperiment::count_numbers);
        numbers.sum::<usize>() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox::identification::DatasetId;

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
