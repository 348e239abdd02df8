//! Taking in jobs: the row, first event, queue entry and idempotency record of each in one
//! transaction.
//!
//! Submissions that come while the writer is at work wait, and are written together in a few
//! statements of many rows. Each is answered for itself, after the commit.

pub(super) mod batch;
mod submission;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::oneshot;

use super::StoreError;
use super::idempotency::Idempotency;
use super::shared_database::Database;
use super::writer::Tx;
pub(super) use submission::{Idempotent, earlier};
pub use submission::{NewJob, Submitted};

/// Submissions of jobs.
#[derive(Clone)]
pub struct Submissions {
    database: Arc<Database>,
    /// The submissions that come while the writer is at work.
    waiting: WaitingSubmissions,
}

impl Submissions {
    /// The submissions to a database.
    pub(super) fn new(database: Arc<Database>) -> Self {
        Self {
            database,
            waiting: WaitingSubmissions::default(),
        }
    }

    /// Stores a job and its queue entry. The answer means that it is on disk.
    pub async fn submit(&self, job: NewJob) -> Result<Submitted, StoreError> {
        let place = self.database.writer.place().await?;
        let (reply, answer) = oneshot::channel();
        if let Some(turn) = self.waiting.join(Submission { job, reply }) {
            // The replies go from the work to the answer, past the commit.
            let replies = Arc::new(Mutex::new(Vec::new()));
            let answered = replies.clone();
            let submissions = self.waiting.clone();
            place.take(
                move |tx| Box::pin(write_all(tx, turn, replies)),
                move |outcome| answer_each(submissions.answered(&answered), outcome),
            );
        }
        answer.await.map_err(|_| StoreError::Closed)?
    }

    /// What became of the submission that came with this key before, if one did: a client that
    /// repeats it gets the same answer, even where the job could not be submitted any more.
    pub async fn earlier(
        &self,
        idempotency: &Idempotency,
    ) -> Result<Option<Submitted>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        earlier(&mut connection, idempotency).await
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
struct WaitingSubmissions(Arc<Mutex<Vec<Submission>>>);

impl WaitingSubmissions {
    /// Adds one. The first of those that wait gets the turn to write them all.
    fn join(&self, submission: Submission) -> Option<Turn> {
        let mut waiting = lock(&self.0);
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
        let waiting = std::mem::take(&mut *lock(&self.0));
        waiting
            .into_iter()
            .map(|submission| submission.reply)
            .collect()
    }
}

/// The turn to write all submissions that wait. One that is dropped without having gathered them
/// drops them too, so that nobody waits for ever.
struct Turn(Option<WaitingSubmissions>);

impl Turn {
    /// All that wait by now; the next to join gets a new turn.
    fn gather(mut self) -> (Vec<NewJob>, Vec<Reply>) {
        let waiting = self.0.take().map(|all| std::mem::take(&mut *lock(&all.0)));
        let all = waiting.unwrap_or_default().into_iter();
        all.map(|submission| (submission.job, submission.reply))
            .unzip()
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        if let Some(all) = self.0.take() {
            lock(&all.0).clear();
        }
    }
}

async fn write_all(
    tx: &mut Tx,
    turn: Turn,
    replies: Arc<Mutex<Vec<Reply>>>,
) -> Result<Vec<Submitted>, StoreError> {
    let (jobs, all) = turn.gather();
    *lock(&replies) = all;
    batch::write(tx, jobs).await
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Tells everyone what became of their submission; those who went away do not need it.
fn answer_each(replies: Vec<Reply>, outcome: Result<Vec<Submitted>, StoreError>) {
    match outcome {
        Ok(submitted) => {
            for (reply, job) in replies.into_iter().zip(submitted) {
                drop(reply.send(Ok(job)));
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
