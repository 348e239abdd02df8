//! The only SQL: jobs, queue entries, events, candidates, checkpoints, results,
//! datasets, streams and monitors, in SQLite or PostgreSQL (see `database`).
//!
//! One task writes, several connections read. The writer runs many changes in one transaction (see
//! `writer`), with full sync; River, the queue, writes beside it, on the same connection in SQLite. A method returns when what it wrote is on disk, and only then are listeners told.
//!
//! Writes of a worker carry a [`Lease`]: they change nothing once another slice of the job began.

mod audit;
pub mod backup;
mod candidates;
mod control;
mod database;
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
mod opening;
mod queue;
mod quotas;
mod recent;
mod results;
mod retention;
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

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use riverqueue::ClientBuilder;

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
pub use opening::{DatabasePlace, DatabaseSettings};
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

use database::{Pool, sqlite};
use opening::{Lock, Opened};
use recent::Recent;
use submit::Submissions;
use writer::{Tx, Writer};

/// A database that was written to so lately takes writes.
const PROBE_AFTER: Duration = Duration::from_secs(1);
/// What is written to see whether it can be.
const PROBE_BYTES: usize = 4096;

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
    writer_pool: Pool,
    readers: Pool,
    queue: riverqueue::Client,
    submissions: Submissions,
    recent: RecentRows,
    quotas: Quotas,
    lock: Lock,
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
        let Opened {
            folder,
            writer_pool,
            readers,
            lock,
        } = Opened::open(settings).await?;
        let queue = queue::inserter(&writer_pool)?;
        let recent = RecentRows::default();
        let writer = Writer::start(writer_pool.clone(), forget_then(recent.clone(), on_change));
        let life = life::begin(&writer).await?;
        writer.fence().set(life);
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
                lock,
            }),
        };
        store.recover_queue().await?;
        Ok(store)
    }

    /// What makes a client of the queue, on the connections of the writer.
    pub fn queue_client(&self) -> ClientBuilder {
        queue::builder(&self.inner.writer_pool)
    }

    /// Whether the database answers.
    pub async fn ping(&self) -> Result<(), StoreError> {
        database::query("select 1").execute(self.readers()).await?;
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

    /// Returns when another server has taken the database over: this one can do nothing more.
    pub async fn superseded(&self) {
        self.inner.lock.lost().await;
    }

    /// Finishes the writes that were accepted, and closes the database.
    pub async fn close(&self) {
        if let Err(error) = self.end_life().await {
            tracing::warn!(%error, "it could not be noted that the server ended in order");
        }
        self.inner.writer.close().await;
        self.inner.readers.close().await;
        self.inner.writer_pool.close().await;
        self.inner.lock.release().await;
    }

    fn readers(&self) -> &Pool {
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

async fn write_probe(tx: &mut Tx) -> Result<(), StoreError> {
    database::query(
        "insert into write_probes (id, filler) values (1, $1) \
         on conflict (id) do update set filler = excluded.filler",
    )
    .bind(vec![0_u8; PROBE_BYTES])
    .execute(&mut **tx)
    .await?;
    Ok(())
}

/// The version of the database's schema that this build works with.
pub fn schema_version() -> i64 {
    let versions = sqlite::SCHEMA.iter().map(|migration| migration.version);
    versions.max().unwrap_or(0)
}

/// A number of a row that is not negative.
fn unsigned<T: TryFrom<i64>>(what: &'static str, of: &str, value: i64) -> Result<T, StoreError> {
    T::try_from(value).map_err(|_| corrupt(what, of, format_args!("it is {value}")))
}

fn corrupt(what: &'static str, of: impl ToString, why: impl ToString) -> StoreError {
    StoreError::Corrupt {
        what,
        of: of.to_string(),
        why: why.to_string(),
    }
}
