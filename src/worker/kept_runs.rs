//! Runs that stay in memory between two slices of their jobs.
//!
//! A checkpoint is all that a run needs to be resumed. A run that is still in memory need not read its
//! recordings again, and knows which candidates it has simulated and which of them are stored. Both ways give
//! the same bits. At most as many runs are kept as jobs may be at work; of more, the runs that have waited the
//! longest go.

use std::collections::VecDeque;
use std::sync::Arc;

use parking_lot::Mutex;

use super::candidates::Candidates;
use super::run::Run;
use crate::store::Lease;

/// A run, at the checkpoint with which a slice of its job ended.
pub(super) struct KeptRun {
    pub(super) run: Box<dyn Run>,
    /// Which candidates of the run are stored.
    pub(super) candidates: Candidates,
    /// The number of the last part of other nodes that the run has.
    pub(super) last_part: i64,
}

/// The runs that are kept, each with the lease of the slice that left it. Cheap to clone.
#[derive(Clone)]
pub(super) struct KeptRuns {
    runs: Arc<Mutex<VecDeque<(Lease, KeptRun)>>>,
    at_most: usize,
}

impl KeptRuns {
    pub(super) fn new(at_most: usize) -> Self {
        Self {
            runs: Arc::default(),
            at_most,
        }
    }

    /// Keeps the run that the slice of a lease leaves.
    pub(super) fn put(&self, lease: Lease, run: KeptRun) {
        let mut runs = self.runs.lock();
        runs.push_back((lease, run));
        if runs.len() > self.at_most {
            runs.pop_front();
        }
    }

    /// The run that the slice before left; nothing where the run is gone, or another slice has come between.
    pub(super) fn take(&self, lease: Lease) -> Option<KeptRun> {
        let mut runs = self.runs.lock();
        let index = runs.iter().position(|(left, _)| left.job == lease.job)?;
        let (left, run) = runs.remove(index)?;
        left.is_followed_by(lease).then_some(run)
    }
}
