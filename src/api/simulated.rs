//! Simulated results that were shown lately: a plot that is looked at closer and closer asks for the
//! same simulation again and again.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use greybox::identification::JobId;
use greybox::identification::assemble::ExperimentTrajectory;

/// Numbers that are kept at the most, all results together: 128 MB.
const MOST_NUMBERS: usize = 16 << 20;

/// The experiments of one result.
pub type Simulated = Arc<Vec<ExperimentTrajectory>>;

/// Results by job and revision, the latest last.
#[derive(Default)]
pub struct SimulatedCache(Mutex<VecDeque<(JobId, i64, Simulated)>>);

impl SimulatedCache {
    /// What was simulated for this revision of a job, if it is kept.
    pub fn get(&self, job: JobId, revision: i64) -> Option<Simulated> {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().position(|(id, _, _)| *id == job)?;
        let entry = kept.remove(place)?;
        if entry.1 != revision {
            return None;
        }
        let simulated = entry.2.clone();
        kept.push_back(entry);
        Some(simulated)
    }

    /// Keeps what was simulated, in the place of what was not asked for the longest.
    pub fn keep(&self, job: JobId, revision: i64, simulated: &Simulated) {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        kept.retain(|(id, _, _)| *id != job);
        kept.push_back((job, revision, simulated.clone()));
        let mut numbers: usize = kept.iter().map(|(_, _, of)| numbers(of)).sum();
        while numbers > MOST_NUMBERS
            && let Some((_, _, oldest)) = kept.pop_front()
        {
            numbers -= self::numbers(&oldest);
        }
    }
}

fn numbers(simulated: &Simulated) -> usize {
    let of = |experiment: &ExperimentTrajectory| {
        experiment.time.len() * (1 + 4 * experiment.outputs.len())
    };
    simulated.iter().map(of).sum()
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
        assert!(cache.get(job, 3).is_none(), "the older one is given up");
    }

    #[test]
    fn what_was_not_asked_for_the_longest_makes_room() {
        let cache = SimulatedCache::default();
        let jobs = [JobId::new(), JobId::new(), JobId::new()];
        let half = simulated(MOST_NUMBERS / 2);
        cache.keep(jobs[0], 1, &half);
        cache.keep(jobs[1], 1, &half);
        assert!(cache.get(jobs[0], 1).is_some());
        cache.keep(jobs[2], 1, &half);
        assert!(cache.get(jobs[1], 1).is_none());
        assert!(cache.get(jobs[0], 1).is_some() && cache.get(jobs[2], 1).is_some());
    }
}
