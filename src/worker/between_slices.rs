//! Runs that stay in memory between two slices of their jobs.
//!
//! A checkpoint is all that a run needs to be resumed; a run that is still there need not read its
//! recordings again, knows which candidates it has simulated, and which of them are stored. Both
//! ways give the same bits. As many runs stay as may be at work at the same time; of more, those
//! that have waited the longest go.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::candidates::Candidates;
use super::run::Run;
use crate::store::Lease;

/// What a slice leaves to the next one of its job.
pub(super) struct Left {
    /// The run, at the checkpoint with which the slice ended.
    pub(super) run: Box<dyn Run>,
    /// Which of its candidates are stored.
    pub(super) candidates: Candidates,
    /// The number of the last part of other nodes that the run has.
    pub(super) heard: i64,
}

/// The runs between two slices. Cheap to clone.
#[derive(Clone)]
pub(super) struct BetweenSlices {
    left: Arc<Mutex<VecDeque<(Lease, Left)>>>,
    at_most: usize,
}

impl BetweenSlices {
    /// Lets so many runs stay.
    pub(super) fn new(at_most: usize) -> Self {
        Self {
            left: Arc::default(),
            at_most,
        }
    }

    fn left(&self) -> MutexGuard<'_, VecDeque<(Lease, Left)>> {
        self.left.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps what the slice of a lease leaves.
    pub(super) fn put(&self, lease: Lease, left: Left) {
        let mut all = self.left();
        all.push_back((lease, left));
        if all.len() > self.at_most {
            all.pop_front();
        }
    }

    /// What the slice before left; nothing where it is gone, or another slice has come between.
    pub(super) fn take(&self, lease: Lease) -> Option<Left> {
        let mut all = self.left();
        let place = all.iter().position(|(own, _)| own.job == lease.job)?;
        let (own, left) = all.remove(place)?;
        own.is_followed_by(lease).then_some(left)
    }
}
