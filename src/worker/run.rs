//! The seam between the service and the method: what a slice needs of the run of a job.
//!
//! A run is synchronous and seeded. It owns all that it needs, goes on in units, and can be saved
//! after any unit and resumed with the same bits.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use greybox::estimation::Finding;
pub use greybox::estimation::{Advance, Share, StopReason};

use crate::job::event::{DesignEvent, PosteriorEvent, SelectionEvent};
use crate::job::{Candidate, CandidateColumn, Failure, GenerationEvent, ResultOfJob};
use crate::store::{JobRow, ModelRow, SharedPart};
use greybox::estimation::Progress;
use greybox::identification::{JobSpec, Outcome};
use greybox::recording::{Recording, RowSignal, Rows};

/// Begins the runs of jobs.
pub trait Method: Send + Sync + 'static {
    /// Begins the run of a job, or resumes it where it was saved.
    fn begin(&self, assignment: Assignment) -> Result<Box<dyn Run>, Failure>;
}

/// All that a run is made of.
#[derive(Debug)]
pub struct Assignment {
    /// The job.
    pub job: JobRow,
    /// The stored model of the job, where a user wrote the model.
    pub model: Option<ModelRow>,
    /// The recordings that the job reads, each with its digest, one for each experiment.
    pub datasets: Vec<(String, Arc<Recording>)>,
    /// The finished job that it goes on from, where it does.
    pub past: Option<Past>,
    /// The stream whose windows it goes through, where it does.
    pub stream: Option<Arc<dyn StreamReader>>,
    /// Where the run was saved; nothing when it begins.
    pub checkpoint: Option<Vec<u8>>,
}

/// A finished job that another goes on from.
#[derive(Clone, Debug)]
pub struct Past {
    /// The specification of the job.
    pub spec: JobSpec,
    /// The result of the job.
    pub outcome: Outcome,
}

/// The stream whose windows a job goes through.
pub trait StreamReader: Send + Sync + std::fmt::Debug {
    /// The signals of the stream.
    fn signals(&self) -> &[RowSignal];

    /// The samples between two instants, nanoseconds since 1970, `most` at the most; nothing where there are more.
    ///
    /// # Errors
    /// The samples cannot be read.
    fn rows(&self, span: Range<i64>, most: usize) -> Result<Option<Rows>, Failure>;
}

/// The failure of a run whose stored checkpoint does not read back.
pub(super) fn unread(error: &dyn std::error::Error) -> Failure {
    let detail = format!("the stored checkpoint does not read back: {error}");
    Failure::cannot_run(detail, Vec::new())
}

/// Work that was done for the node that has a run.
#[derive(Debug, Default)]
pub struct Helped {
    /// The results of the work; empty where nothing was left to do.
    pub parts: Vec<SharedPart>,
    /// How many refits of an analysis were done.
    pub refits: usize,
    /// How many generations of searches were done.
    pub generations: usize,
}

/// The run of one job.
pub trait Run: Send {
    /// Does one unit of work. When `stop` is raised it may return at once, with nothing changed.
    fn advance(&mut self, stop: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance;

    /// How far it came.
    fn progress(&self) -> Progress;

    /// All that is needed to resume it.
    fn checkpoint(&self) -> Vec<u8>;

    /// Whether other nodes may do some of what is left to do just now.
    fn is_shareable(&self) -> bool {
        false
    }

    /// Has the refits of a share come first, because other nodes begin with the other shares, and so many
    /// in a unit at the most.
    fn share(&mut self, _share: Share, _at_most: u32) {}

    /// Takes over what other nodes did.
    fn take_parts(&mut self, _parts: Vec<SharedPart>) {}

    /// What others are to know of that was done here since this was asked for.
    fn new_parts(&mut self) -> Vec<SharedPart> {
        Vec::new()
    }

    /// Does so many refits or generations of a share at the most for the node that has the run; none where
    /// nothing is left of it, or none can be done yet.
    fn help(&mut self, _share: Share, _at_most: u32, _stop: &AtomicBool) -> Helped {
        Helped::default()
    }

    /// The result: final when the run has finished, else the best so far, which is nothing before
    /// the first candidate was judged. `stopped` is `TimeLimit`, `Cancelled` or `Paused`. When
    /// `hurry` is raised it answers soon, without what takes long to be found out about the
    /// estimate.
    fn outcome(
        &mut self,
        stopped: Option<StopReason>,
        hurry: &AtomicBool,
    ) -> Result<Option<ResultOfJob>, Failure>;
}

/// A line of the job's history.
#[derive(Clone, Debug, PartialEq)]
pub enum Row {
    /// What should be known before the search begins; reported with its first generation.
    Finding(Finding),
    /// The search finished a generation.
    Generation(GenerationEvent),
    /// The candidates that it simulated for it.
    Candidates {
        /// What each of their values stands for.
        columns: Arc<[CandidateColumn]>,
        /// The candidates; after an interruption some may have been reported of before.
        candidates: Vec<Candidate>,
    },
    /// The design of an experiment has a better one.
    Design(DesignEvent),
    /// A selection has looked at more windows.
    Selection(SelectionEvent),
    /// The refinement finished an iteration.
    Refinement {
        /// Counts from 1.
        iteration: u32,
        /// The cost that it reached.
        cost: f64,
    },
    /// The chains of a posterior were looked at.
    Posterior(PosteriorEvent),
}
