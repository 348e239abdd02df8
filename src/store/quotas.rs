//! How much a project may have.

use std::time::Duration;

/// What each project may have at the most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quotas {
    /// Recordings.
    pub datasets: u64,
    /// The bytes of all that [`StoredBytes`](super::StoredBytes) counts.
    pub stored_bytes: u64,
    /// Jobs that are queued, running or paused.
    pub unfinished_jobs: u64,
    /// The time that its jobs are at work in a day (UTC); nothing for no limit.
    pub work_per_day: Option<Duration>,
}

impl Default for Quotas {
    /// No limits.
    fn default() -> Self {
        Self {
            datasets: u64::MAX,
            stored_bytes: u64::MAX,
            unfinished_jobs: u64::MAX,
            work_per_day: None,
        }
    }
}
