//! Taking in jobs: the row, first event, queue entry and idempotency record of each in one
//! transaction.
//!
//! Submissions that come while the writer is at work wait, and are written together in a few
//! statements of many rows. Each is answered for itself, after the commit.

pub(super) mod batch;
pub(super) mod comparison;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use riverqueue::Client;
use tokio::sync::oneshot;

use super::database::Connection;
use super::idempotency::{self, Earlier, Idempotency};
use super::jobs::{self, JobRow};
use super::writer::Tx;
use super::{QuotaExceeded, Quotas, Store, StoreError};
use crate::access::Project;
use crate::job::JobTask;
use greybox::identification::{DatasetId, JobId};

/// A job to be stored.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// Whose it is.
    pub project: Project,
    /// The name for people.
    pub name: Option<String>,
    /// Labels to find it by.
    pub labels: BTreeMap<String, String>,
    /// The model's name.
    pub model: String,
    /// What the job is asked to do.
    pub task: JobTask,
    /// The recordings that it reads.
    pub datasets: Vec<DatasetId>,
    /// Makes the submission safe to repeat.
    pub idempotency: Option<Idempotency>,
}

/// What became of a submission.
#[derive(Clone, Debug)]
pub enum Submitted<T = JobRow> {
    /// It is new.
    Created(T),
    /// What the same key and body made before, as it was when it was made.
    Replayed(T),
    /// The key came before with another body. Nothing was stored.
    KeyReused,
    /// What the same key and body made before has been deleted; its identifier. Nothing was stored.
    Forgotten(String),
    /// The model that it names is no longer there. Nothing was stored.
    NoModel(String),
    /// A recording that it reads is no longer there. Nothing was stored.
    NoDataset(DatasetId),
    /// The project has as much as it may. Nothing was stored.
    Refused(QuotaExceeded),
}

impl Store {
    /// Stores a job and its queue entry. The answer means that it is on disk.
    pub async fn submit(&self, job: NewJob) -> Result<Submitted, StoreError> {
        let place = self.inner.writer.place().await?;
        let (reply, answer) = oneshot::channel();
        if let Some(turn) = self.inner.submissions.join(Submission { job, reply }) {
            let (queue, quotas) = (self.inner.queue.clone(), self.inner.quotas);
            // The replies go from the work to the answer, past the commit.
            let replies = Arc::new(Mutex::new(Vec::new()));
            let answered = replies.clone();
            let submissions = self.inner.submissions.clone();
            place.take(
                move |tx| Box::pin(write_all((queue, quotas), tx, turn, replies)),
                move |outcome| answer_each(submissions.answered(&answered), outcome),
            );
        }
        answer.await.map_err(|_| StoreError::Closed)?
    }

    /// What became of the submission that came with this key before, if one did: a client that
    /// repeats it gets the same answer, even where the job could not be submitted any more.
    pub async fn earlier_submission(
        &self,
        idempotency: &Idempotency,
    ) -> Result<Option<Submitted>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        match idempotency::earlier(&mut connection, idempotency).await? {
            None => Ok(None),
            Some(earlier) => answer_again(&mut connection, earlier).await.map(Some),
        }
    }
}

/// A job on its way to the database, and who waits for it.
struct Submission {
    job: NewJob,
    reply: Reply,
}

type Reply = oneshot::Sender<Result<Submitted, StoreError>>;

/// The submissions that wait to be written together.
#[derive(Clone, Default)]
pub(super) struct Submissions {
    waiting: Arc<Mutex<Vec<Submission>>>,
}

impl Submissions {
    /// Adds one. The first of those that wait gets the turn to write them all.
    fn join(&self, submission: Submission) -> Option<Turn> {
        let mut waiting = lock(&self.waiting);
        waiting.push(submission);
        (waiting.len() == 1).then(|| Turn(Some(self.clone())))
    }

    /// Whom an outcome is for: those that had their turn; all that wait, where the transaction failed
    /// before it came.
    fn answered(&self, had_their_turn: &Mutex<Vec<Reply>>) -> Vec<Reply> {
        let replies = std::mem::take(&mut *lock(had_their_turn));
        if !replies.is_empty() {
            return replies;
        }
        let waiting = std::mem::take(&mut *lock(&self.waiting));
        waiting.into_iter().map(|one| one.reply).collect()
    }
}

/// The turn to write all submissions that wait. One that is dropped without having gathered them
/// drops them too, so that nobody waits for ever.
struct Turn(Option<Submissions>);

impl Turn {
    /// All that wait by now; the next to join gets a new turn.
    fn gather(mut self) -> (Vec<NewJob>, Vec<Reply>) {
        let waiting = self
            .0
            .take()
            .map(|all| std::mem::take(&mut *lock(&all.waiting)));
        let all = waiting.unwrap_or_default().into_iter();
        all.map(|one| (one.job, one.reply)).unzip()
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        if let Some(all) = self.0.take() {
            lock(&all.waiting).clear();
        }
    }
}

async fn write_all(
    (queue, quotas): (Client, Quotas),
    tx: &mut Tx,
    turn: Turn,
    replies: Arc<Mutex<Vec<Reply>>>,
) -> Result<Vec<Submitted>, StoreError> {
    let (jobs, all) = turn.gather();
    *lock(&replies) = all;
    batch::write(&queue, quotas, tx, jobs).await
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Tells everyone what became of their submission; those who went away do not need it.
fn answer_each(replies: Vec<Reply>, outcome: Result<Vec<Submitted>, StoreError>) {
    match outcome {
        Ok(submitted) => {
            for (reply, one) in replies.into_iter().zip(submitted) {
                drop(reply.send(Ok(one)));
            }
        }
        Err(error) => {
            let error = Arc::new(error);
            for reply in replies {
                drop(reply.send(Err(StoreError::Together(error.clone()))));
            }
        }
    }
}

/// The answer to a submission whose key came before.
async fn answer_again(
    connection: &mut Connection,
    earlier: Earlier,
) -> Result<Submitted, StoreError> {
    // Another body, or one that made something else than a job.
    if !earlier.is_same_body || !earlier.made.starts_with(JobId::PREFIX) {
        return Ok(Submitted::KeyReused);
    }
    let id = jobs::parse_id(&earlier.made)?;
    Ok(match jobs::fetch(connection, id).await? {
        Some(row) => Submitted::Replayed(row.into_submitted()),
        None => Submitted::Forgotten(id.to_string()),
    })
}
