//! The worker's side: a slice begins, records what it did, and hands the job on or ends it (see
//! `endings`).
//!
//! `jobs.epoch` fences: the transaction that begins a slice raises it, and a write with an older
//! one changes no row and says [`Hold::Lost`], which ends that worker's slice.

mod beginning;
pub(super) mod endings;

use std::time::Duration;

use riverqueue::Client;

pub use endings::Ending;

use super::jobs::{self, JobRow};
use super::stop_request::StopRequest;
use super::writer::Tx;
use super::{
    Change, Checkpoint, NewCandidates, SharedPart, Store, StoreError, candidates, checkpoints,
    database, events, generations, queue, quotas, shared_parts,
};
use crate::job::{Event, GenerationEvent};
use greybox::estimation::Progress;
use greybox::identification::JobId;

/// The right to write about a job, until its next slice begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lease {
    /// The job.
    pub job: JobId,
    epoch: i64,
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
    /// What its writes carry.
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
    /// Refinements with an event.
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
    /// Where it can go on, at the end of a slice.
    pub checkpoint: Option<Checkpoint>,
    /// Time worked, at the end of a slice `[ms]`.
    pub worked_ms: u64,
    /// What was done that other nodes are to know of.
    pub parts: Vec<SharedPart>,
    /// Whether other nodes may help with what is left, at the end of a slice.
    pub is_shared: bool,
}

impl Store {
    /// Begins a slice for a queue entry, or, without one, for a job that was asked to stop.
    /// A job that `death_limit` lives of the server in a row ended with fails instead.
    pub async fn begin_slice(
        &self,
        job: JobId,
        entry: Option<i64>,
        death_limit: u32,
    ) -> Result<Begin, StoreError> {
        let now = beginning::Now {
            life: self.inner.node.life,
            age: self.inner.opened.elapsed(),
            death_limit,
            damage: self.inner.damage.clone(),
        };
        self.inner
            .writer
            .write(move |tx| Box::pin(beginning::begin(tx, job, entry, now)))
            .await
    }

    /// Writes what a slice did so far.
    pub async fn record(&self, lease: Lease, record: Record) -> Result<Hold, StoreError> {
        self.inner
            .writer
            .write(move |tx| Box::pin(write_record(tx, lease, record)))
            .await
    }

    /// Writes what a slice did last, with its checkpoint, and hands the job on: through the queue where
    /// other jobs wait there or `must` says so.
    pub async fn hand_on(
        &self,
        lease: Lease,
        record: Record,
        must: bool,
    ) -> Result<HandedOn, StoreError> {
        let queue = self.inner.queue.clone();
        self.inner
            .writer
            .write(move |tx| Box::pin(hand_on(queue, tx, lease, record, must)))
            .await
    }
}

async fn hand_on(
    queue: Client,
    tx: &mut Tx,
    lease: Lease,
    record: Record,
    must: bool,
) -> Result<HandedOn, StoreError> {
    if write_record(tx, lease, record).await? == Hold::Lost {
        return Ok(HandedOn::Lost);
    }
    if !must && !queue::is_waited_for(tx).await? {
        return Ok(HandedOn::Stays);
    }
    queue_again(&queue, tx, lease.job).await?;
    Ok(HandedOn::ToTheQueue)
}

/// Has the next slice of a job wait in the queue.
pub(super) async fn queue_again(queue: &Client, tx: &mut Tx, job: JobId) -> Result<(), StoreError> {
    let id = job.to_string();
    let project: String = database::query_scalar("select project from jobs where id = $1")
        .bind(&id)
        .fetch_one(&mut **tx)
        .await?;
    queue::renew(queue, tx, job, &jobs::project(&id, &project)?).await
}

pub(super) async fn write_record(
    tx: &mut Tx,
    lease: Lease,
    record: Record,
) -> Result<Hold, StoreError> {
    let last_event: Option<i64> = database::query_scalar(
        "update jobs set last_event = last_event + $1, revision = revision + 1, \
         running_ms = running_ms + $2, \
         told_generation = $3, told_refinements = $4, told_at_ms = $5, \
         progress = coalesce($6, progress) \
         where id = $7 and epoch = $8 and status = 'running' returning last_event",
    )
    .bind(i64::try_from(record.events.len()).expect("a record is small"))
    .bind(i64::try_from(record.worked_ms).unwrap_or(i64::MAX))
    .bind(record.reported.generation)
    .bind(record.reported.refinements)
    .bind(record.reported.at_ms)
    .bind(record.progress.as_ref().map(jobs::json))
    .bind(lease.job.to_string())
    .bind(lease.epoch)
    .fetch_optional(&mut **tx)
    .await?;
    let Some(last_event) = last_event else {
        return Ok(Hold::Lost);
    };
    if record.worked_ms > 0 {
        let worked_s = Duration::from_millis(record.worked_ms).as_secs_f64();
        metrics::histogram!("greybox_slice_duration_seconds").record(worked_s);
        quotas::note_work(tx, &lease.job.to_string(), record.worked_ms).await?;
    }
    let n_events = i64::try_from(record.events.len()).expect("a record is small");
    events::insert(tx, lease.job, last_event - n_events + 1, &record.events).await?;
    generations::insert(tx, lease.job, &record.generations).await?;
    if let Some(new) = &record.candidates {
        candidates::insert(tx, lease.job, new).await?;
    }
    shared_parts::insert(tx, lease.job, &record.parts).await?;
    if let Some(checkpoint) = &record.checkpoint {
        checkpoints::put(tx, lease.job, checkpoint).await?;
        shared_parts::set_shared(tx, lease.job, record.is_shared).await?;
    }
    tx.announce(Change::Job(lease.job));
    Ok(Hold::Kept)
}

impl Slice {
    /// What the job was asked to do before the slice began.
    pub fn stop_request(&self) -> Option<StopRequest> {
        self.job.stop_request
    }
}
