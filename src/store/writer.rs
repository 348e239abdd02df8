//! The one writer: many writes, one transaction, one sync to disk (group commit).
//!
//! Requests come through a bounded channel to one task. It runs all that are waiting in one
//! transaction, each of several in a savepoint of its own so that a failing one harms no other,
//! commits, and only then answers. What a write changed is announced after the commit and before the answer.
//!
//! A disk that is full fails the transaction and everyone in it; the next one begins afresh.

use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicI64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use futures_util::future::BoxFuture;
use riverqueue::Client;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;

use super::database::{self, Connection, Kind, Pool, Transaction};
use super::error::WriteFailure;
use super::quotas::Quotas;
use super::sealed::changes::seal_changed;
use super::{Change, OnChange, StoreError};

/// Writes in one transaction.
const GROUP_LIMIT: usize = 256;
/// Writes that may wait for the writer before callers wait too.
const WAITING_LIMIT: usize = 1024;

/// What a transaction on a PostgreSQL may take. One that takes longer is given up: the network or the
/// server stands still.
const LONGEST_TRANSACTION: Duration = Duration::from_secs(30);

/// The transaction that a write runs in.
pub(super) struct Tx {
    inner: Connection,
    changes: Vec<Change>,
    /// Adds entries to the queue in this transaction.
    pub(super) queue: Client,
    /// What each project may have.
    pub(super) quotas: Quotas,
}

impl Tx {
    /// Notes what to announce when the transaction is on disk.
    pub(super) fn announce(&mut self, change: Change) {
        self.changes.push(change);
    }

    /// The transaction as the queue wants it.
    pub(super) fn transaction(&mut self) -> Transaction<'_> {
        self.inner
            .transaction()
            .expect("a write runs in a transaction")
    }
}

impl Deref for Tx {
    type Target = Connection;

    fn deref(&self) -> &Connection {
        &self.inner
    }
}

impl DerefMut for Tx {
    fn deref_mut(&mut self) -> &mut Connection {
        &mut self.inner
    }
}

/// A write on a database: `work` runs in the transaction that it names. The future ends when what was
/// written is on disk.
macro_rules! in_transaction {
    ($database:expr, |$tx:ident| $work:expr) => {
        $database.writer.write(move |$tx| Box::pin($work))
    };
}
pub(super) use in_transaction;

type Acknowledge = Box<dyn FnOnce(Result<(), StoreError>) + Send>;

/// A write on its way, and who waits for its outcome.
trait Work: Send {
    fn run<'a>(self: Box<Self>, tx: &'a mut Tx) -> BoxFuture<'a, Done>;
    /// Answers without having run: the transaction failed before.
    fn refuse(self: Box<Self>, error: StoreError);
}

struct Pending<T, W, R> {
    work: W,
    reply: R,
    answers: PhantomData<fn() -> T>,
}

impl<T, W, R> Work for Pending<T, W, R>
where
    T: Send + 'static,
    W: for<'a> FnOnce(&'a mut Tx) -> BoxFuture<'a, Result<T, StoreError>> + Send + 'static,
    R: FnOnce(Result<T, StoreError>) + Send + 'static,
{
    fn run<'a>(self: Box<Self>, tx: &'a mut Tx) -> BoxFuture<'a, Done> {
        let Self { work, reply, .. } = *self;
        Box::pin(async move {
            let outcome = work(tx).await;
            Done {
                failure: outcome.as_ref().err().map(WriteFailure::of),
                acknowledge: Box::new(move |commit| {
                    // What went wrong with this write says more than what then became of all.
                    reply(outcome.and_then(|value| commit.map(|()| value)));
                }),
            }
        })
    }

    fn refuse(self: Box<Self>, error: StoreError) {
        (self.reply)(Err(error));
    }
}

struct Done {
    failure: Option<WriteFailure>,
    acknowledge: Acknowledge,
}

/// The handle to the writer task.
pub(super) struct Writer {
    requests: Mutex<Option<mpsc::Sender<Box<dyn Work>>>>,
    task: Mutex<Option<JoinHandle<()>>>,
    last: Arc<Mutex<LastWrite>>,
    fence: Fence,
}

/// What a transaction that writes has to pass. A file is kept from other servers by its lock. To a
/// PostgreSQL others write too: the transactions of all nodes come one after the other, and one whose node
/// was declared dead is refused.
#[derive(Clone, Debug, Default)]
pub(super) struct Fence(Arc<AtomicI64>);

impl Fence {
    /// From now on only transactions of this life are taken; before, any.
    pub(super) fn set(&self, life: i64) {
        self.0.store(life, Ordering::Relaxed);
    }

    async fn pass(&self, tx: &mut Connection) -> Result<(), WriteFailure> {
        if tx.kind() == Kind::Sqlite {
            return Ok(());
        }
        let failed = |error: sqlx::Error| WriteFailure::of_database(&error);
        tx.take_turn().await.map_err(failed)?;
        let life = self.0.load(Ordering::Relaxed);
        if life == 0 {
            return Ok(());
        }
        let lives: bool = database::query_scalar(
            "select exists (select 1 from nodes where life = $1 and state = 'live')",
        )
        .bind(life)
        .fetch_one(tx)
        .await
        .map_err(failed)?;
        if lives {
            return Ok(());
        }
        metrics::counter!("greybox_writes_refused_total").increment(1);
        Err(WriteFailure::superseded())
    }
}

/// What became of the last transaction.
#[derive(Clone, Debug)]
struct LastWrite {
    at: Instant,
    failure: Option<WriteFailure>,
}

impl LastWrite {
    fn now(failure: Option<WriteFailure>) -> Self {
        Self {
            at: Instant::now(),
            failure,
        }
    }
}

/// A place among the writes that wait.
pub(super) struct Place(mpsc::OwnedPermit<Box<dyn Work>>);

impl Place {
    /// Has `work` run; `reply` gets its outcome when what it wrote is on disk.
    pub(super) fn take<T, W, R>(self, work: W, reply: R)
    where
        T: Send + 'static,
        W: for<'a> FnOnce(&'a mut Tx) -> BoxFuture<'a, Result<T, StoreError>> + Send + 'static,
        R: FnOnce(Result<T, StoreError>) + Send + 'static,
    {
        self.0.send(Box::new(Pending {
            work,
            reply,
            answers: PhantomData,
        }));
    }
}

impl Writer {
    /// Starts the writer on a pool of one connection.
    pub(super) fn start(pool: Pool, queue: Client, quotas: Quotas, on_change: OnChange) -> Self {
        let (requests, waiting) = mpsc::channel(WAITING_LIMIT);
        let last = Arc::new(Mutex::new(LastWrite::now(None)));
        let fence = Fence::default();
        let transactions = Transactions {
            pool,
            fence: fence.clone(),
            queue,
            quotas,
        };
        let task = tokio::spawn(run(transactions, waiting, last.clone(), on_change));
        Self {
            requests: Mutex::new(Some(requests)),
            task: Mutex::new(Some(task)),
            last,
            fence,
        }
    }

    /// Who may write.
    pub(super) fn fence(&self) -> &Fence {
        &self.fence
    }

    /// Whether a transaction was written within `age`.
    pub(super) fn has_written_within(&self, age: Duration) -> bool {
        let last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        last.failure.is_none() && last.at.elapsed() < age
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

/// What every transaction is begun with.
struct Transactions {
    pool: Pool,
    fence: Fence,
    queue: Client,
    quotas: Quotas,
}

impl Transactions {
    /// Begins a transaction, where this node may still write.
    async fn begin(&self) -> Result<Tx, WriteFailure> {
        let begun = self.pool.begin_write().await;
        let mut tx = Tx {
            inner: begun.map_err(|error| WriteFailure::of_database(&error))?,
            changes: Vec::new(),
            queue: self.queue.clone(),
            quotas: self.quotas,
        };
        self.fence.pass(&mut tx).await?;
        Ok(tx)
    }
}

async fn run(
    transactions: Transactions,
    mut waiting: mpsc::Receiver<Box<dyn Work>>,
    last: Arc<Mutex<LastWrite>>,
    on_change: OnChange,
) {
    let kind = transactions.pool.kind();
    let longest = kind.either(Duration::MAX, LONGEST_TRANSACTION);
    let mut group = Vec::with_capacity(GROUP_LIMIT);
    while waiting.recv_many(&mut group, GROUP_LIMIT).await > 0 {
        let mut works = group.drain(..);
        let mut done = Vec::with_capacity(works.len());
        let begun = Instant::now();
        let committing = commit_group(&transactions, &mut works, &mut done);
        let committed = tokio::time::timeout(longest, committing).await;
        let committed = committed.unwrap_or_else(|_| Err(WriteFailure::no_answer()));
        let took = begun.elapsed().as_secs_f64();
        metrics::histogram!("greybox_commit_duration_seconds").record(took);
        let failed_alone = done.iter().find_map(|write| write.failure.clone());
        match committed {
            Ok(changes) => {
                let failure = failed_alone.filter(|failure| failure.is_of_the_disk());
                *last.lock().unwrap_or_else(PoisonError::into_inner) = LastWrite::now(failure);
                changes.into_iter().for_each(|change| on_change(change));
                done.into_iter()
                    .for_each(|write| (write.acknowledge)(Ok(())));
            }
            Err(error) => {
                // A write that finds no room takes the whole transaction with it; what is told of
                // the others is that, and not what they then met.
                let failure = failed_alone.filter(|failure| failure.is_of_the_disk());
                let failure = failure.unwrap_or(error);
                tracing::error!(error = %failure, writes = done.len(), "a transaction failed");
                *last.lock().unwrap_or_else(PoisonError::into_inner) =
                    LastWrite::now(Some(failure.clone()));
                let told = || StoreError::Commit(failure.clone());
                done.into_iter()
                    .for_each(|write| (write.acknowledge)(Err(told())));
                works.for_each(|work| work.refuse(told()));
                if kind == Kind::Postgres {
                    // It may have been committed all the same, and the answer been lost.
                    on_change(Change::Missed);
                }
            }
        }
    }
}

/// Runs a group in one transaction. Where that fails, `group` keeps the writes that were not run.
/// The connection never goes on inside a transaction: the pool closes one that comes back so.
async fn commit_group(
    transactions: &Transactions,
    group: &mut (dyn Iterator<Item = Box<dyn Work>> + Send),
    done: &mut Vec<Done>,
) -> Result<Vec<Change>, WriteFailure> {
    let failed = |error: sqlx::Error| WriteFailure::of_database(&error);
    let mut tx = transactions.begin().await?;
    let is_alone = group.size_hint() == (1, Some(1));
    for work in group {
        if !is_alone && let Err(error) = database::query("savepoint one").execute(&mut *tx).await {
            let failure = WriteFailure::of_database(&error);
            work.refuse(StoreError::Commit(failure.clone()));
            return Err(failure);
        }
        let changes_before = tx.changes.len();
        let write = work.run(&mut tx).await;
        let has_failed = write.failure.is_some();
        done.push(write);
        if is_alone {
            if has_failed {
                // The transaction is rolled back as it is dropped.
                return Ok(Vec::new());
            }
            break;
        }
        if has_failed {
            tx.changes.truncate(changes_before);
            database::query("rollback to savepoint one")
                .execute(&mut *tx)
                .await
                .map_err(failed)?;
        }
        database::query("release savepoint one")
            .execute(&mut *tx)
            .await
            .map_err(failed)?;
    }
    let Tx {
        mut inner, changes, ..
    } = tx;
    let sealed = seal_changed(&mut inner).await;
    sealed.map_err(|error| WriteFailure::of(&error))?;
    inner.commit().await.map_err(failed)?;
    Ok(changes)
}
