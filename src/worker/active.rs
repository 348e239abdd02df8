//! Which jobs this server is working on right now, and the flag that stops each.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use parking_lot::Mutex;

use greybox::identification::JobId;

/// The jobs at work. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub(super) struct ActiveJobs {
    flags: Arc<Mutex<HashMap<JobId, Arc<AtomicBool>>>>,
    /// Raised once, when the server goes down.
    all_stop: Arc<AtomicBool>,
}

/// A job at work, until it is dropped.
#[derive(Debug)]
pub(super) struct ActiveJob {
    jobs: ActiveJobs,
    id: JobId,
    stop: Arc<AtomicBool>,
}

impl ActiveJobs {
    /// Takes a job for one slice; nothing if it is at work already.
    pub(super) fn take(&self, id: JobId) -> Option<ActiveJob> {
        let mut flags = self.flags.lock();
        if flags.contains_key(&id) {
            return None;
        }
        let stop = Arc::new(AtomicBool::new(self.all_stop.load(Ordering::Relaxed)));
        flags.insert(id, stop.clone());
        Some(ActiveJob {
            jobs: self.clone(),
            id,
            stop,
        })
    }

    /// Raises the flag of a job; says whether it is at work.
    pub(super) fn stop(&self, id: JobId) -> bool {
        let flags = self.flags.lock();
        let flag = flags.get(&id);
        if let Some(flag) = flag {
            flag.store(true, Ordering::Relaxed);
        }
        flag.is_some()
    }

    /// Whether the server goes down.
    pub(super) fn all_are_stopped(&self) -> bool {
        self.all_stop.load(Ordering::Relaxed)
    }

    /// Raises the flags of all jobs, now and to come.
    pub(super) fn stop_all(&self) {
        let flags = self.flags.lock();
        self.all_stop.store(true, Ordering::Relaxed);
        for flag in flags.values() {
            flag.store(true, Ordering::Relaxed);
        }
    }
}

impl ActiveJob {
    pub(super) fn id(&self) -> JobId {
        self.id
    }

    /// The flag that ends the slice.
    pub(super) fn stop_flag(&self) -> Arc<AtomicBool> {
        self.stop.clone()
    }
}

impl Drop for ActiveJob {
    fn drop(&mut self) {
        self.jobs.flags.lock().remove(&self.id);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raised(job: &ActiveJob) -> bool {
        job.stop_flag().load(Ordering::Relaxed)
    }

    #[test]
    fn a_job_is_at_work_once_at_a_time() {
        let jobs = ActiveJobs::default();
        let id = JobId::new();
        let first = jobs.take(id).expect("nobody works it");
        assert!(jobs.take(id).is_none());
        drop(first);
        assert!(jobs.take(id).is_some());
    }

    #[test]
    fn a_stop_reaches_its_job_only() {
        let jobs = ActiveJobs::default();
        let (a, b) = (JobId::new(), JobId::new());
        let (job_a, job_b) = (jobs.take(a).expect("free"), jobs.take(b).expect("free"));
        assert!(jobs.stop(a));
        assert!(!jobs.stop(JobId::new()));
        assert!(raised(&job_a) && !raised(&job_b));
    }

    #[test]
    fn a_job_taken_while_the_server_goes_down_stops_at_once() {
        let jobs = ActiveJobs::default();
        let before = jobs.take(JobId::new()).expect("free");
        jobs.stop_all();
        let after = jobs.take(JobId::new()).expect("free");
        assert!(raised(&before) && raised(&after));
    }
}
