//! The only SQL: jobs, queue entries, events, candidates, checkpoints, results,
//! datasets, streams and monitors, in SQLite or PostgreSQL (see `database`).
//!
//! One task writes, several connections read. The writer runs many changes in one transaction (see
//! `writer`), with full sync; River, the queue, writes beside it, on the same connection in SQLite. A
//! method returns when what it wrote is on disk, and only then are listeners told, those of other nodes
//! too (see `nodes` and `news`).
//!
//! Writes of a worker carry a [`Lease`]: they change nothing once another slice of the job began.

mod audit;
pub mod backup;
mod candidates;
mod checkpoints;
mod control;
mod damage;
mod database;
mod datasets;
mod error;
mod events;
mod figures;
mod generations;
mod idempotency;
mod job_summaries;
mod jobs;
mod lock;
mod models;
mod monitors;
pub mod moving;
mod news;
mod nodes;
mod opening;
mod queue;
mod quotas;
mod recent;
mod recordings;
mod results;
mod retention;
mod sealed;
mod sessions;
mod shared_parts;
mod slices;
mod stop_request;
mod stored_bytes;
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
use serde::{Deserialize, Serialize};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use crate::access::Project;
use crate::job::MonitorId;
use greybox::identification::{DatasetId, JobId};

pub use audit::{AuditEntry, AuditRow, Loss};
pub use candidates::{CandidatePage, NewCandidates};
pub use checkpoints::Checkpoint;
pub use control::Control;
pub use damage::DamageMet;
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
pub use sealed::check::Checked;
pub use shared_parts::SharedPart;
pub use slices::{Begin, Ending, HandedOn, Hold, Lease, Record, Reported, Slice};
pub use stop_request::StopRequest;
pub use stored_bytes::StoredBytes;
pub use streams::{
    Appended, BatchOutcome, DEFAULT_KEEP_MIB, Keep, MAX_STREAMS, NewBatch, StreamRemoval, StreamRow,
};
pub use submit::comparison::{ComparisonRow, ComparisonSummary, NewComparison};
pub use submit::{NewJob, Submitted};
pub use tokens::TokenRow;
pub use webhooks::{Attempt, DeliveryRow, DeliveryState, WebhookRow};

use damage::Damage;
use database::{Kind, Pool, sqlite};
use lock::FileLock;
use news::News;
use nodes::Node;
use opening::{Access, Opened};
use recent::Recent;
use recordings::RecentRecordings;
use submit::Submissions;
use writer::{Tx, Writer};

/// A database that was written to so lately takes writes.
const PROBE_AFTER: Duration = Duration::from_secs(1);
/// What is written to see whether it can be.
const PROBE_BYTES: usize = 4096;

/// What a committed transaction changed.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
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
    /// An analysis has begun with which other nodes can help.
    HelpWanted,
    /// Anything: another node changed what this one was not told of.
    Missed,
}

/// Is told of each change after it is on disk. Called by the writer: it must not block.
pub type OnChange = Arc<dyn Fn(Change) + Send + Sync>;

/// The database, as one server works with it. Cheap to clone.
#[derive(Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

struct Inner {
    /// The folder of the database.
    folder: PathBuf,
    /// When it was opened.
    opened: Instant,
    writer: Arc<Writer>,
    writer_pool: Pool,
    readers: Pool,
    queue: riverqueue::Client,
    submissions: Submissions,
    recent: RecentReads,
    quotas: Quotas,
    damage: Damage,
    node: Node,
    /// What tells other nodes, and hears from them.
    exchange: tokio::sync::Mutex<JoinSet<()>>,
    closing: CancellationToken,
    /// What keeps others from a file.
    _lock: Option<FileLock>,
}

impl Store {
    /// Opens the database, a file for this server alone, brings its schema up to date and makes what
    /// dead servers left running ready to go on.
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
            access,
        } = Opened::open(settings).await?;
        let queue = queue::inserter(&writer_pool)?;
        let recent = RecentReads::of(writer_pool.kind());
        let on_change = forget_then(recent.clone(), on_change);
        let news = News::default();
        let on_own_change = match access {
            Access::Alone(_) => on_change.clone(),
            Access::Shared(_) => tell_too(news.clone(), on_change.clone()),
        };
        let writer = Arc::new(Writer::start(writer_pool.clone(), on_own_change));
        let node = Node::begin(&writer, settings.beat).await?;
        let closing = CancellationToken::new();
        let (lock, exchange) = match access {
            Access::Alone(lock) => (Some(lock), JoinSet::new()),
            Access::Shared(shared) => {
                let told = (node.life, on_change.clone());
                let exchange = news
                    .exchange(shared.options(), told, closing.clone())
                    .await?;
                let parts = (writer.clone(), queue.clone());
                node.live_among_others(shared, parts, on_change);
                (None, exchange)
            }
        };
        let store = Self {
            inner: Arc::new(Inner {
                folder,
                opened: Instant::now(),
                writer,
                writer_pool,
                readers,
                queue,
                submissions: Submissions::default(),
                recent,
                quotas,
                damage: Damage::default(),
                node,
                exchange: tokio::sync::Mutex::new(exchange),
                closing,
                _lock: lock,
            }),
        };
        store.recover_queue().await?;
        Ok(store)
    }

    /// What makes a client of the queue, on the connections of the writer.
    pub fn queue_client(&self) -> ClientBuilder {
        let name = queue::client_name(self.inner.node.life);
        queue::builder(&self.inner.writer_pool).id(name)
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

    /// Whether other servers may work with the same database.
    pub fn is_shared(&self) -> bool {
        self.inner.writer_pool.kind() == Kind::Postgres
    }

    /// Whether this server does what one does for all that work with the database.
    pub fn is_in_charge(&self) -> bool {
        self.inner.node.is_in_charge()
    }

    /// Returns when others have declared this server dead: it can do nothing more.
    pub async fn superseded(&self) {
        self.inner.node.lost().await;
    }

    /// Finishes the writes that were accepted, and closes the database.
    pub async fn close(&self) {
        if let Err(error) = self.end_life().await {
            tracing::warn!(%error, "it could not be noted that the server ended in order");
        }
        self.inner.writer.close().await;
        self.inner.node.close().await;
        self.inner.closing.cancel();
        while self.inner.exchange.lock().await.join_next().await.is_some() {}
        self.inner.readers.close().await;
        self.inner.writer_pool.close().await;
    }

    fn readers(&self) -> &Pool {
        &self.inner.readers
    }
}

impl Drop for Inner {
    fn drop(&mut self) {
        self.closing.cancel();
    }
}

/// What was read lately.
#[derive(Clone)]
struct RecentReads {
    jobs: Recent<JobId, JobRow>,
    datasets: Recent<DatasetId, DatasetRow>,
    recordings: RecentRecordings,
}

impl RecentReads {
    /// Rows that other nodes may change are not kept. Recordings do not change.
    fn of(kind: Kind) -> Self {
        let limit = kind.either(recent::LIMIT, 0);
        Self {
            jobs: Recent::new(limit),
            datasets: Recent::new(limit),
            recordings: RecentRecordings::default(),
        }
    }
}

/// Tells other nodes beside.
fn tell_too(news: News, on_change: OnChange) -> OnChange {
    Arc::new(move |change| {
        news.add(change.clone());
        on_change(change);
    })
}

/// Forgets what has changed before anybody is told.
fn forget_then(recent: RecentReads, on_change: OnChange) -> OnChange {
    Arc::new(move |change| {
        match &change {
            Change::Job(id) => recent.jobs.forget(*id),
            Change::DatasetRemoved(id) => {
                recent.datasets.forget(*id);
                recent.recordings.forget(*id);
            }
            Change::SliceWaits(_)
            | Change::DeliveryWaits
            | Change::StopRequested(_)
            | Change::Stream
            | Change::Monitor(_)
            | Change::HelpWanted
            | Change::Missed => {}
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
