//! What a worker gets of a job for a slice, and what it writes.

use crate::job::{Event, GenerationEvent};
use crate::store::candidates::NewCandidates;
use crate::store::checkpoints::Checkpoint;
use crate::store::jobs::JobRow;
use crate::store::stop_request::StopRequest;
use crate::store::work_shares::SharedPart;
use greybox::estimation::Progress;
use greybox::identification::JobId;

/// The right to write about a job, until its next slice begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lease {
    /// The job.
    pub job: JobId,
    /// Which slice of the job.
    pub(super) epoch: i64,
}

impl Lease {
    /// Whether another lease is that of the next slice of the same job.
    #[must_use]
    pub fn is_followed_by(self, other: Self) -> bool {
        (other.job, other.epoch) == (self.job, self.epoch + 1)
    }
}

/// Whether a write with a lease took place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Hold {
    /// It did.
    Kept,
    /// Another slice has begun; nothing was written and nothing ever will be with this lease.
    Lost,
}

/// The outcome of handing a job on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum HandedOn {
    /// The job waits in the queue, with a new entry.
    ToTheQueue,
    /// No other job waits: the worker that has the job's entry goes on.
    Stays,
    /// Another slice has begun; nothing was written.
    Lost,
}

/// The outcome of an attempt to begin a slice.
#[derive(Clone, Debug)]
pub enum Begin {
    /// The slice began and is to be worked.
    Slice(Box<Slice>),
    /// The job ended, is paused, is gone or at work in another node, or the entry is stale: there is
    /// nothing to do.
    Nothing,
    /// Server processes ended while the job was at work: the next slice waits a little.
    NotYet,
    /// The job has ended now: the server always went down with it, or what is stored of it is damaged.
    Ended,
}

/// All that a worker needs to go on with a job.
#[derive(Clone, Debug)]
pub struct Slice {
    /// The lease that each write of the slice carries.
    pub lease: Lease,
    /// The job.
    pub job: JobRow,
    /// Where the last slice stopped; nothing in the first.
    pub checkpoint: Option<Checkpoint>,
    /// Time that the slices before worked `[ms]`.
    pub running_ms: u64,
    /// What events reported of so far.
    pub reported: Reported,
    /// The newest generation, if no event reported of it yet.
    pub unreported: Option<GenerationEvent>,
    /// Whether other nodes may help with what is left.
    pub is_shared: bool,
    /// Whether the job was never at work before: nothing is stored of it yet.
    pub is_first: bool,
}

/// How far the events of a job's search go.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reported {
    /// The last generation with an event, of a design how many experiments the last event told of;
    /// 0 for none.
    pub generation: u32,
    /// Iterations of the refinement and looks at the chains of a posterior with an event.
    pub refinements: u32,
    /// When the last generation's event was made [ms since 1970].
    pub at_ms: i64,
}

/// What a slice did since it last wrote.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Rows for the history.
    pub generations: Vec<GenerationEvent>,
    /// Candidates that none of the rows before reported of.
    pub candidates: Option<NewCandidates>,
    /// Events, in order.
    pub events: Vec<Event>,
    /// How far the events go now.
    pub reported: Reported,
    /// How far the job came.
    pub progress: Option<Progress>,
    /// The checkpoint from which the job can go on, at the end of a slice.
    pub checkpoint: Option<Checkpoint>,
    /// Time worked, at the end of a slice `[ms]`.
    pub worked_ms: u64,
    /// Finished parts of which other nodes are to know.
    pub parts: Vec<SharedPart>,
    /// Whether other nodes may help with what is left, at the end of a slice.
    pub is_shared: bool,
}

impl Slice {
    /// What the job was asked to do before the slice began.
    pub fn stop_request(&self) -> Option<StopRequest> {
        self.job.stop_request
    }
}
