//! The store of a server: opens and closes the database, and hands out a handle for each resource.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use super::audit::AuditLog;
use super::candidates::Candidates;
use super::change::{Change, OnChange};
use super::checkpoints::Checkpoints;
use super::cluster_notifications::ClusterNotifications;
use super::comparisons::Comparisons;
use super::damage::Damage;
use super::database::{self, Kind};
use super::datasets::{DatasetRow, Datasets, Turn};
use super::deliveries::Deliveries;
use super::error::StoreError;
use super::events::JobEvents;
use super::figures::{self, Figures};
use super::generations::Generations;
use super::jobs::{JobRow, Jobs};
use super::layouts::Layouts;
use super::mappings::Mappings;
use super::models::Models;
use super::monitors::Monitors;
use super::nodes::{self, Nodes};
use super::opening::{Access, DatabaseSettings, Opened};
use super::queue::{self, SliceQueue};
use super::quotas::Quotas;
use super::recordings::RecordingCache;
use super::results::Results;
use super::retention::{self, Retention, Tidied};
use super::row_cache::RowCache;
use super::sessions::Sessions;
use super::shared_database::Database;
use super::slices::Slices;
use super::sources::Sources;
use super::streams::Streams;
use super::submit::Submissions;
use super::tokens::Tokens;
use super::webhooks::Webhooks;
use super::work_shares::WorkShares;
use super::writer::{Tx, Writer, in_transaction};
use greybox::identification::{DatasetId, JobId};

/// A database that was written to so lately takes writes.
const PROBE_AFTER: Duration = Duration::from_secs(1);
/// What is written to see whether it can be.
const PROBE_BYTES: usize = 4096;

/// The database, as one server works with it: a handle for each resource. Cheap to clone.
#[derive(Clone)]
pub struct Store(Arc<OpenStore>);

struct OpenStore {
    database: Arc<Database>,
    handles: Handles,
    /// Holds the rows of jobs that were read lately.
    jobs: Jobs,
    /// Holds the recordings that were read lately.
    datasets: Datasets,
    /// Holds the submissions that wait to be written together.
    submissions: Submissions,
    /// Knows which of the servers of the database this one is.
    nodes: Nodes,
    /// The tasks that tell other nodes of changes and are told by them; they end with `closing`.
    exchange: tokio::sync::Mutex<JoinSet<()>>,
    /// Cancelled when the store is closed or dropped.
    closing: CancellationToken,
}

/// The handles that work on the database and on nothing else.
macro_rules! handles {
    ($($(#[$doc:meta])* $name:ident: $handle:ident,)*) => {
        struct Handles {
            $($name: $handle,)*
        }

        impl Handles {
            fn new(database: &Arc<Database>) -> Self {
                Self {
                    $($name: $handle { database: database.clone() },)*
                }
            }
        }

        impl Store {
            $(
                $(#[$doc])*
                pub fn $name(&self) -> &$handle {
                    &self.0.handles.$name
                }
            )*
        }
    };
}

handles! {
    /// The audit log.
    audit: AuditLog,
    /// The candidates of searches.
    candidates: Candidates,
    /// Where unfinished jobs can go on.
    checkpoints: Checkpoints,
    /// Comparisons of jobs.
    comparisons: Comparisons,
    /// Events on their way to webhooks.
    deliveries: Deliveries,
    /// The events of jobs.
    events: JobEvents,
    /// The generations of searches.
    generations: Generations,
    /// Options for reading tables, by name.
    layouts: Layouts,
    /// What collecting agents write and where it goes.
    mappings: Mappings,
    /// Models that users wrote.
    models: Models,
    /// Monitors, their windows, alarms and events.
    monitors: Monitors,
    /// The queue in which slices of jobs wait.
    queue: SliceQueue,
    /// The results of jobs.
    results: Results,
    /// Sessions of people at the page.
    sessions: Sessions,
    /// Slices of jobs.
    slices: Slices,
    /// What collectors say of their sources.
    sources: Sources,
    /// Recordings that grow.
    streams: Streams,
    /// Tokens.
    tokens: Tokens,
    /// Places that events are delivered to.
    webhooks: Webhooks,
    /// OpenStore of jobs that several nodes work together.
    work_shares: WorkShares,
}

impl Store {
    /// Jobs as they are shown, listed, stopped and deleted.
    pub fn jobs(&self) -> &Jobs {
        &self.0.jobs
    }

    /// Recordings.
    pub fn datasets(&self) -> &Datasets {
        &self.0.datasets
    }

    /// Submissions of jobs.
    pub fn submissions(&self) -> &Submissions {
        &self.0.submissions
    }

    /// The servers that work with the database.
    pub fn nodes(&self) -> &Nodes {
        &self.0.nodes
    }

    /// The damage that was met since the server began.
    pub fn damage(&self) -> &Damage {
        &self.0.database.damage
    }

    /// Opens the database, a file for this server alone, brings its schema up to date and makes what
    /// dead servers left running ready to go on.
    pub async fn open(
        settings: &DatabaseSettings,
        on_change: OnChange,
    ) -> Result<Self, StoreError> {
        Self::open_with(settings, Quotas::default(), on_change).await
    }

    /// Opens the database as [`Store::open`] does, for projects that may have only so much.
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
        } = Opened::open_in_turn(settings).await?;
        let queue = queue::inserter(&writer_pool)?;
        let caches = Caches::of(writer_pool.kind());
        let on_change = forget_then(caches.clone(), on_change);
        let notifications = ClusterNotifications::default();
        let (lock, shared, on_local_change) = match access {
            Access::Alone(lock) => (Some(lock), None, on_change.clone()),
            Access::Shared(shared) => {
                let notifying = notify_too(notifications.clone(), on_change.clone());
                (None, Some(shared), notifying)
            }
        };
        let writer = Arc::new(Writer::start(
            writer_pool.clone(),
            queue,
            quotas,
            on_local_change,
        ));
        let life = nodes::begin(&writer, settings.beat).await?;
        let database = Arc::new(Database {
            readers,
            writer,
            writer_pool,
            damage: Damage::default(),
            life,
            opened: Instant::now(),
            keys: settings.keys.clone(),
            folder,
            _lock: lock,
        });
        let closing = CancellationToken::new();
        let nodes = Nodes::new(database.clone(), closing.child_token());
        let exchange = match shared {
            None => JoinSet::new(),
            Some(shared) => {
                let (heard, until) = (on_change.clone(), closing.clone());
                let exchange = notifications.exchange(&shared, life, heard, until);
                nodes.live_among_others(shared, on_change);
                exchange
            }
        };
        let store = Self(Arc::new(OpenStore {
            handles: Handles::new(&database),
            jobs: Jobs {
                database: database.clone(),
                rows: caches.jobs,
            },
            datasets: Datasets {
                database: database.clone(),
                rows: caches.datasets,
                recordings: caches.recordings,
                turn: Turn::default(),
            },
            submissions: Submissions::new(database.clone()),
            database,
            nodes,
            exchange: tokio::sync::Mutex::new(exchange),
            closing,
        }));
        store.webhooks().encrypt_anew().await?;
        store.queue().recover().await?;
        Ok(store)
    }

    /// Whether the database answers.
    pub async fn ping(&self) -> Result<(), StoreError> {
        let ping = database::query("select 1");
        ping.execute(&self.0.database.readers).await?;
        Ok(())
    }

    /// Whether the database takes writes: one came to disk a moment ago, or does now.
    pub async fn probe(&self) -> Result<(), StoreError> {
        if self.0.database.writer.has_written_within(PROBE_AFTER) {
            return Ok(());
        }
        in_transaction!(self.0.database, |tx| write_probe(tx)).await
    }

    /// Whether other servers may work with the same database.
    pub fn is_shared(&self) -> bool {
        self.0.database.writer_pool.kind() == Kind::Postgres
    }

    /// The figures of the database as they are now.
    pub async fn figures(&self) -> Result<Figures, StoreError> {
        figures::read(&self.0.database).await
    }

    /// Lets some of what is older than it is kept for go, and gives some space back. Says what went.
    pub async fn tidy(&self, retention: Retention) -> Result<Tidied, StoreError> {
        retention::tidy(&self.0.database, retention).await
    }

    /// Finishes the writes that were accepted, and closes the database.
    pub async fn close(&self) {
        let OpenStore {
            database,
            nodes,
            closing,
            exchange,
            ..
        } = &*self.0;
        if let Err(error) = nodes.end_life().await {
            tracing::warn!(%error, "it could not be noted that the server ended in order");
        }
        database.writer.close().await;
        nodes.close().await;
        closing.cancel();
        while exchange.lock().await.join_next().await.is_some() {}
        database.readers.close().await;
        database.writer_pool.close().await;
    }

    /// The connections that read.
    #[cfg(test)]
    pub(super) fn readers(&self) -> &database::Pool {
        &self.0.database.readers
    }

    /// What the handles work on.
    #[cfg(test)]
    pub(super) fn database(&self) -> &Database {
        &self.0.database
    }
}

impl Drop for OpenStore {
    fn drop(&mut self) {
        self.closing.cancel();
    }
}

/// The caches of rows and recordings.
#[derive(Clone)]
struct Caches {
    jobs: RowCache<JobId, JobRow>,
    datasets: RowCache<DatasetId, DatasetRow>,
    recordings: RecordingCache,
}

impl Caches {
    /// Rows that other nodes may change are not kept. Recordings do not change.
    fn of(kind: Kind) -> Self {
        let keeps_rows = kind == Kind::Sqlite;
        Self {
            jobs: RowCache::new(keeps_rows),
            datasets: RowCache::new(keeps_rows),
            recordings: RecordingCache::default(),
        }
    }
}

/// Notifies other nodes of a change beside.
fn notify_too(notifications: ClusterNotifications, on_change: OnChange) -> OnChange {
    Arc::new(move |change| {
        notifications.add(change.clone());
        on_change(change);
    })
}

/// Forgets what has changed before anybody is told.
fn forget_then(caches: Caches, on_change: OnChange) -> OnChange {
    Arc::new(move |change| {
        match &change {
            Change::Job(id) => caches.jobs.forget(*id),
            Change::DatasetRemoved(id) => {
                caches.datasets.forget(*id);
                caches.recordings.forget(*id);
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
