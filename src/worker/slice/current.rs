//! The slice at work, and how its computation returns.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use crate::admission::Admission;
use crate::job::Failure;
use crate::store::{Lease, Store};
use crate::worker::active::ActiveJobs;
use crate::worker::between_slices::BetweenSlices;
use crate::worker::exchange::Exchange;
use crate::worker::run::{Method, Run};

/// For how long a job may go on with one entry of the queue, which takes one that is worked for long for
/// lost.
const ENTRY_LASTS: Duration = Duration::from_hours(1);

/// What is to be done with the entry of a slice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::worker) enum After {
    /// The job has more to do and nobody waits: another slice, now.
    Again,
    /// The job is at work already: look again soon.
    Later,
    /// The job has to wait a little, for lives of the server ended with it: look again later.
    NotYet,
    /// Nothing more to do with this entry.
    Done,
}

/// Works slices. Cheap to clone.
#[derive(Clone)]
pub(in crate::worker) struct SliceWorker {
    pub(in crate::worker) store: Store,
    pub(in crate::worker) method: Arc<dyn Method>,
    pub(in crate::worker) active: ActiveJobs,
    pub(in crate::worker) between_slices: BetweenSlices,
    /// Computations at the same time. More entries may have been taken from the queue: the next
    /// ones wait here, so that no permit is idle while the queue is asked or an end is written.
    pub(in crate::worker) admission: Admission,
    pub(in crate::worker) slice_length: Duration,
    pub(in crate::worker) max_candidates: u64,
}

/// Why the computation of a slice returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::worker) enum End {
    Finished,
    TimeIsUp,
    Stopped,
}

/// The slice at work.
pub(in crate::worker) struct Current {
    pub(in crate::worker) lease: Lease,
    pub(in crate::worker) started: Instant,
    /// When the entry was taken that it is worked for.
    pub(in crate::worker) entry_taken: Instant,
    /// The time that the job may still work, where it has a limit.
    pub(super) time_left: Option<Duration>,
    pub(super) stop: Arc<AtomicBool>,
    /// What it and other nodes that help have for each other.
    pub(super) exchange: Arc<Exchange>,
}

impl Current {
    pub(in crate::worker) fn is_out_of_time(&self) -> bool {
        self.time_left
            .is_some_and(|left| self.started.elapsed() >= left)
    }

    /// Whether the job needs a new entry to go on.
    pub(in crate::worker) fn entry_is_old(&self) -> bool {
        self.entry_taken.elapsed() >= ENTRY_LASTS
    }
}

/// The run and why its computation returned, or why the job cannot go on.
pub(in crate::worker) type Computed = Result<(Box<dyn Run>, End), Failure>;
