//! The one writer: many writes, one transaction, one sync to disk (group commit).
//!
//! Requests come through a bounded channel to one task. It runs all that are waiting in one
//! transaction, each in a savepoint of its own so that a failing one harms no other, commits, and
//! only then answers. What a write changed is announced after the commit and before the answer.

use std::ops::{Deref, DerefMut};
use std::sync::{Arc, Mutex, PoisonError};

use futures_util::future::BoxFuture;
use sqlx::{Sqlite, SqliteConnection, SqlitePool, Transaction};
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;

use super::{Change, OnChange, StoreError};

/// Writes in one transaction.
const GROUP_LIMIT: usize = 256;
/// Writes that may wait for the writer before callers wait too.
const WAITING_LIMIT: usize = 1024;

/// The transaction that a write runs in.
pub(super) struct Tx {
    inner: Transaction<'static, Sqlite>,
    changes: Vec<Change>,
}

impl Tx {
    /// Notes what to announce when the transaction is on disk.
    pub(super) fn announce(&mut self, change: Change) {
        self.changes.push(change);
    }

    /// The transaction as the queue wants it.
    pub(super) fn for_queue(&mut self) -> &mut Transaction<'static, Sqlite> {
        &mut self.inner
    }
}

impl Deref for Tx {
    type Target = SqliteConnection;

    fn deref(&self) -> &SqliteConnection {
        &self.inner
    }
}

impl DerefMut for Tx {
    fn deref_mut(&mut self) -> &mut SqliteConnection {
        &mut self.inner
    }
}

type Acknowledge = Box<dyn FnOnce(Result<(), StoreError>) + Send>;
type Work = Box<dyn for<'a> FnOnce(&'a mut Tx) -> BoxFuture<'a, Done> + Send>;

struct Done {
    succeeded: bool,
    acknowledge: Acknowledge,
}

/// The handle to the writer task.
pub(super) struct Writer {
    requests: Mutex<Option<mpsc::Sender<Work>>>,
    task: Mutex<Option<JoinHandle<()>>>,
}

/// A place among the writes that wait.
pub(super) struct Place(mpsc::OwnedPermit<Work>);

impl Place {
    /// Has `work` run; `reply` gets its outcome when what it wrote is on disk. Both are dropped
    /// when the database fails before.
    pub(super) fn take<T, W, R>(self, work: W, reply: R)
    where
        T: Send + 'static,
        W: for<'a> FnOnce(&'a mut Tx) -> BoxFuture<'a, Result<T, StoreError>> + Send + 'static,
        R: FnOnce(Result<T, StoreError>) + Send + 'static,
    {
        self.0.send(Box::new(move |tx| {
            Box::pin(async move {
                let outcome = work(tx).await;
                Done {
                    succeeded: outcome.is_ok(),
                    acknowledge: Box::new(move |commit| reply(commit.and(outcome))),
                }
            })
        }));
    }
}

impl Writer {
    /// Starts the writer on a pool of one connection.
    pub(super) fn start(pool: SqlitePool, on_change: OnChange) -> Self {
        let (requests, waiting) = mpsc::channel(WAITING_LIMIT);
        let task = tokio::spawn(run(pool, waiting, on_change));
        Self {
            requests: Mutex::new(Some(requests)),
            task: Mutex::new(Some(task)),
        }
    }

    /// Runs `work` and returns when what it wrote is on disk. Once begun it is not undone by
    /// dropping the future.
    pub(super) async fn write<T, W>(&self, work: W) -> Result<T, StoreError>
    where
        T: Send + 'static,
        W: for<'a> FnOnce(&'a mut Tx) -> BoxFuture<'a, Result<T, StoreError>> + Send + 'static,
    {
        let place = self.place().await?;
        let (reply, answer) = oneshot::channel();
        // A caller that went away does not need the answer.
        place.take(work, |outcome| drop(reply.send(outcome)));
        answer.await.map_err(|_| StoreError::Closed)?
    }

    /// Waits until one more write may wait for the writer.
    pub(super) async fn place(&self) -> Result<Place, StoreError> {
        let requests = self
            .requests
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
            .ok_or(StoreError::Closed)?;
        let permit = requests.reserve_owned().await;
        permit.map(Place).map_err(|_| StoreError::Closed)
    }

    /// Takes no more writes and returns when those accepted are on disk.
    pub(super) async fn close(&self) {
        drop(
            self.requests
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take(),
        );
        let task = self
            .task
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        if let Some(task) = task
            && let Err(error) = task.await
        {
            tracing::error!(%error, "the writer of the store ended badly");
        }
    }
}

async fn run(pool: SqlitePool, mut waiting: mpsc::Receiver<Work>, on_change: OnChange) {
    let mut group = Vec::with_capacity(GROUP_LIMIT);
    while waiting.recv_many(&mut group, GROUP_LIMIT).await > 0 {
        let mut done = Vec::with_capacity(group.len());
        let committed = commit_group(&pool, group.drain(..), &mut done).await;
        match committed {
            Ok(changes) => {
                changes.into_iter().for_each(|change| on_change(change));
                done.into_iter().for_each(|ack| ack(Ok(())));
            }
            Err(error) => {
                tracing::error!(%error, writes = done.len(), "a transaction failed");
                let error = Arc::new(error);
                done.into_iter()
                    .for_each(|ack| ack(Err(StoreError::Commit(error.clone()))));
            }
        }
    }
}

/// Runs a group in one transaction. Requests that the error leaves unrun are dropped, which
/// answers them with [`StoreError::Closed`]; that happens only when the database itself fails.
async fn commit_group(
    pool: &SqlitePool,
    group: impl Iterator<Item = Work>,
    done: &mut Vec<Acknowledge>,
) -> Result<Vec<Change>, sqlx::Error> {
    let mut tx = Tx {
        inner: pool.begin_with("begin immediate").await?,
        changes: Vec::new(),
    };
    for work in group {
        sqlx::query("savepoint one").execute(&mut *tx).await?;
        let changes_before = tx.changes.len();
        let one = work(&mut tx).await;
        done.push(one.acknowledge);
        if !one.succeeded {
            tx.changes.truncate(changes_before);
            sqlx::query("rollback to one").execute(&mut *tx).await?;
        }
        sqlx::query("release one").execute(&mut *tx).await?;
    }
    let Tx { inner, changes } = tx;
    inner.commit().await?;
    Ok(changes)
}
