//! Simulated results that were shown lately: a plot that is looked at closer and closer asks for the
//! same simulation again and again.

use std::sync::Arc;

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use greybox::identification::JobId;
use greybox::identification::assemble::ExperimentTrajectory;

/// Numbers that are kept at the most, all results together: 128 MB.
const MOST_NUMBERS: u64 = 16 << 20;

/// The experiments of one result.
pub type Simulated = Arc<Vec<ExperimentTrajectory>>;

/// Results by job, each with the revision of the job.
pub struct SimulatedCache(Cache<JobId, (i64, Simulated), Numbers>);

impl Default for SimulatedCache {
    fn default() -> Self {
        // One large result may fill the only shard.
        let options = OptionsBuilder::new()
            .shards(1)
            .estimated_items_capacity(100)
            .weight_capacity(MOST_NUMBERS)
            .build()
            .expect("all that an option needs is given");
        let (hasher, lifecycle) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
        Self(Cache::with_options(options, Numbers, hasher, lifecycle))
    }
}

impl SimulatedCache {
    /// What was simulated for this revision of a job, if it is kept.
    pub fn get(&self, job: JobId, revision: i64) -> Option<Simulated> {
        let (kept, simulated) = self.0.get(&job)?;
        (kept == revision).then_some(simulated)
    }

    /// Keeps what was simulated, in the place of what is asked for less.
    pub fn keep(&self, job: JobId, revision: i64, simulated: &Simulated) {
        self.0.insert(job, (revision, simulated.clone()));
    }
}

/// Counts the numbers of a result.
#[derive(Clone)]
struct Numbers;

impl Weighter<JobId, (i64, Simulated)> for Numbers {
    fn weight(&self, _job: &JobId, (_revision, simulated): &(i64, Simulated)) -> u64 {
        let of = |experiment: &ExperimentTrajectory| {
            experiment.time.len() * (1 + 4 * experiment.outputs.len())
        };
        simulated.iter().map(of).sum::<usize>() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox::identification::DatasetId;

    fn simulated(samples: usize) -> Simulated {
        Arc::new(vec![ExperimentTrajectory {
            dataset: DatasetId::new(),
            time: vec![0.0; samples],
            estimation_samples: samples,
            outputs: Vec::new(),
        }])
    }

    #[test]
    fn a_result_is_kept_until_its_job_changes() {
        let (cache, job) = (SimulatedCache::default(), JobId::new());
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
        let cache = SimulatedCache::default();
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
