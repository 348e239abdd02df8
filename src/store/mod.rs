//! The only SQL: jobs, queue entries, events, candidates, checkpoints, results,
//! datasets, streams and monitors in SQLite.
//!
//! One connection writes, several read. The writer runs every change in `begin immediate`
//! transactions with full sync, many changes in one (see `writer`); River, the queue, shares its
//! connection. A method returns when what it wrote is on disk, and only then are listeners told.
//!
//! Writes of a worker carry a [`Lease`]: they change nothing once another slice of the job began.

mod audit;
pub mod backup;
mod candidates;
mod control;
mod datasets;
mod error;
mod events;
mod figures;
mod generations;
mod idempotency;
mod job_summaries;
mod jobs;
mod life;
mod lock;
mod models;
mod monitors;
mod queue;
mod quotas;
mod recent;
mod results;
mod retention;
mod schema;
mod sessions;
mod slices;
mod stop_request;
mod streams;
mod submit;
#[cfg(test)]
mod tests;
pub mod tokens;
mod webhooks;
mod writer;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use sqlx::sqlite::{
    SqliteAutoVacuum, SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{Connection, SqlitePool};

use crate::access::Project;
use crate::job::{DatasetId, JobId, MonitorId};

pub use audit::{AuditEntry, AuditRow};
pub use candidates::{CandidatePage, NewCandidates};
pub use control::Control;
pub use datasets::{DatasetRemoval, DatasetRow, NewDataset};
pub use error::{Meaning, QuotaExceeded, StoreError};
pub use events::StoredEvent;
pub use figures::Figures;
pub use idempotency::Idempotency;
pub use job_summaries::{JobSummaryRow, NamedDataset};
pub use jobs::{JobFilter, JobRemoval, JobRow, Page};
pub use models::{MAX_UNUSED_MODELS, ModelRemoval, ModelRow, ModelStored, NewModel};
pub use monitors::{Advance, AdvanceWindow, MonitorRow, NewMonitor, NewWindowJob, StoredWindow};
pub use queue::{QUEUE, SliceOfJob, project_of, queue_of};
pub use quotas::Quotas;
pub use retention::{Retention, Tidied};
pub use slices::{Begin, Checkpoint, Ending, Hold, Lease, Record, Reported, Slice};
pub use stop_request::StopRequest;
pub use streams::{
    Appended, BatchOutcome, DEFAULT_KEEP_MIB, Keep, MAX_STREAMS, NewBatch, StreamRemoval, StreamRow,
};
pub use submit::comparison::{ComparisonRow, ComparisonSummary, NewComparison};
pub use submit::{NewJob, Submitted};
pub use tokens::TokenRow;
pub use webhooks::{Attempt, DeliveryRow, DeliveryState, WebhookRow};

use lock::FileLock;
use recent::Recent;
use submit::Submissions;
use writer::{Tx, Writer};

/// A database that was written to so lately takes writes.
const PROBE_AFTER: Duration = Duration::from_secs(1);
/// What is written to see whether it can be.
const PROBE_BYTES: i64 = 4096;

/// Where the database is and how it is used.
#[derive(Clone, Debug)]
pub struct DatabaseSettings {
    /// The SQLite file; created with its folder when absent.
    pub path: PathBuf,
    /// Connections that read at the same time.
    pub readers: u32,
    /// How long a statement waits for another connection's lock.
    pub busy_timeout: Duration,
}

/// What a committed transaction changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Change {
    /// A job has more events or another state.
    Job(JobId),
    /// A slice of a job of the project waits in the queue.
    SliceWaits(Project),
    /// A delivery is due, or is due at another time.
    DeliveryWaits,
    /// A running job was asked to stop.
    StopRequested(JobId),
    /// A recording was removed.
    DatasetRemoved(DatasetId),
    /// A stream has more samples.
    Stream,
    /// A monitor has more events.
    Monitor(MonitorId),
}

/// Is told of each change after it is on disk. Called by the writer: it must not block.
pub type OnChange = Arc<dyn Fn(Change) + Send + Sync>;

/// The database of one server. Cheap to clone.
#[derive(Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

struct Inner {
    /// The folder of the database.
    folder: PathBuf,
    /// The number of this life of the server.
    life: i64,
    /// When it began.
    opened: Instant,
    writer: Writer,
    writer_pool: SqlitePool,
    readers: SqlitePool,
    queue: riverqueue::Client,
    submissions: Submissions,
    recent: RecentRows,
    quotas: Quotas,
    _lock: FileLock,
}

impl Store {
    /// Opens the database for this server alone, brings its schema up to date and makes what a
    /// dead server left running ready to go on.
    pub async fn open(
        settings: &DatabaseSettings,
        on_change: OnChange,
    ) -> Result<Self, StoreError> {
        Self::open_with(settings, Quotas::default(), on_change).await
    }

    /// The same, for projects that may have only so much.
    pub async fn open_with(
        settings: &DatabaseSettings,
        quotas: Quotas,
        on_change: OnChange,
    ) -> Result<Self, StoreError> {
        let folder = settings.path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).to_owned();
        std::fs::create_dir_all(&folder).map_err(|source| StoreError::File {
            path: folder.clone(),
            source,
        })?;
        let lock = FileLock::take(&settings.path)?;
        let writer_pool = writer_pool(settings).await?;
        schema::migrate(&writer_pool).await?;
        let missing = schema::missing(&mut *writer_pool.acquire().await?).await?;
        if let Some(first) = missing.first() {
            return Err(corrupt("schema", settings.path.display(), first));
        }
        let queue = queue::inserter(&writer_pool)?;
        let readers = SqlitePoolOptions::new()
            .max_connections(settings.readers)
            // A connection to a file does not break off.
            .test_before_acquire(false)
            .connect_with(connection(settings).read_only(true))
            .await?;
        let recent = RecentRows::default();
        let writer = Writer::start(writer_pool.clone(), forget_then(recent.clone(), on_change));
        let life = life::begin(&writer).await?;
        let store = Self {
            inner: Arc::new(Inner {
                folder,
                life,
                opened: Instant::now(),
                writer,
                writer_pool,
                readers,
                queue,
                submissions: Submissions::default(),
                recent,
                quotas,
                _lock: lock,
            }),
        };
        store.recover_queue().await?;
        Ok(store)
    }

    /// The connection that the queue's workers share with the writer.
    pub fn queue_pool(&self) -> SqlitePool {
        self.inner.writer_pool.clone()
    }

    /// Whether the database answers.
    pub async fn ping(&self) -> Result<(), StoreError> {
        sqlx::query("select 1").execute(self.readers()).await?;
        Ok(())
    }

    /// Whether the database takes writes: one came to disk a moment ago, or does now.
    pub async fn probe(&self) -> Result<(), StoreError> {
        if self.inner.writer.has_written_within(PROBE_AFTER) {
            return Ok(());
        }
        self.inner
            .writer
            .write(|tx| Box::pin(write_probe(tx)))
            .await
    }

    /// Finishes the writes that were accepted, and closes the database.
    pub async fn close(&self) {
        if let Err(error) = self.end_life().await {
            tracing::warn!(%error, "it could not be noted that the server ended in order");
        }
        self.inner.writer.close().await;
        self.inner.readers.close().await;
        self.inner.writer_pool.close().await;
    }

    fn readers(&self) -> &SqlitePool {
        &self.inner.readers
    }
}

/// Rows that were read lately.
#[derive(Clone, Default)]
struct RecentRows {
    jobs: Recent<JobId, JobRow>,
    datasets: Recent<DatasetId, DatasetRow>,
}

/// Forgets what has changed before anybody is told.
fn forget_then(recent: RecentRows, on_change: OnChange) -> OnChange {
    Arc::new(move |change| {
        match &change {
            Change::Job(id) => recent.jobs.forget(*id),
            Change::DatasetRemoved(id) => recent.datasets.forget(*id),
            Change::SliceWaits(_)
            | Change::DeliveryWaits
            | Change::StopRequested(_)
            | Change::Stream
            | Change::Monitor(_) => {}
        }
        on_change(change);
    })
}

/// The one connection that writes. A disk that is full can leave it inside a transaction that SQLite
/// has ended and the connection has not; such a one is closed, and the next write opens another.
async fn writer_pool(settings: &DatabaseSettings) -> Result<SqlitePool, StoreError> {
    let pool = SqlitePoolOptions::new()
        .max_connections(1)
        .min_connections(1)
        .idle_timeout(None)
        .max_lifetime(None)
        .after_release(|connection, _| {
            Box::pin(async move {
                // The answer comes after a rollback that was begun by dropping a transaction.
                connection.ping().await?;
                Ok(!connection.is_in_transaction())
            })
        })
        // Of a file that is new: what is removed can be given back to the disk.
        .connect_with(connection(settings).auto_vacuum(SqliteAutoVacuum::Incremental))
        .await?;
    Ok(pool)
}

async fn write_probe(tx: &mut Tx) -> Result<(), StoreError> {
    sqlx::query("insert or replace into write_probes (id, filler) values (1, randomblob(?))")
        .bind(PROBE_BYTES)
        .execute(&mut **tx)
        .await?;
    Ok(())
}

fn connection(settings: &DatabaseSettings) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(&settings.path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        .busy_timeout(settings.busy_timeout)
        .statement_cache_capacity(256)
}

/// The version of the database's schema that this build works with.
pub fn schema_version() -> i64 {
    let migrations = sqlx::migrate!();
    let versions = migrations.iter().map(|migration| migration.version);
    versions.max().unwrap_or(0)
}

fn corrupt(what: &'static str, of: impl ToString, why: impl ToString) -> StoreError {
    StoreError::Corrupt {
        what,
        of: of.to_string(),
        why: why.to_string(),
    }
}
