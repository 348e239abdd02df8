//! Where a database is, and opening it for this server alone.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use sqlx::postgres::PgConnectOptions;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::database::postgres::{self, SessionLock};
use super::database::{Pool, sqlite};
use super::lock::FileLock;
use super::{StoreError, corrupt};

/// Connections to PostgreSQL of the writer and of the queue.
const WRITERS: u32 = 4;

/// Where a database is.
#[derive(Clone)]
pub enum DatabasePlace {
    /// A SQLite file; created with its folder when absent.
    File(PathBuf),
    /// A PostgreSQL server and a database there.
    Postgres(Box<PgConnectOptions>),
}

impl fmt::Display for DatabasePlace {
    /// Without the password.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) => write!(formatter, "{}", path.display()),
            Self::Postgres(options) => {
                let database = options.get_database().unwrap_or(options.get_username());
                let (host, port) = (options.get_host(), options.get_port());
                write!(formatter, "postgres://{host}:{port}/{database}")
            }
        }
    }
}

impl fmt::Debug for DatabasePlace {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, formatter)
    }
}

/// Where the database is and how it is used.
#[derive(Clone, Debug)]
pub struct DatabaseSettings {
    /// Where it is.
    pub place: DatabasePlace,
    /// Connections that read at the same time.
    pub readers: u32,
    /// How long a statement waits for another connection's lock.
    pub busy_timeout: Duration,
}

/// A database that is up to date and that no other server has.
pub(super) struct Opened {
    /// For files beside the database.
    pub(super) folder: PathBuf,
    pub(super) writer_pool: Pool,
    pub(super) readers: Pool,
    pub(super) lock: Lock,
}

/// What keeps other servers away.
pub(super) enum Lock {
    File {
        _held: FileLock,
    },
    /// Kept by a task.
    Session {
        keeper: Mutex<Option<JoinHandle<()>>>,
        closing: CancellationToken,
        lost: CancellationToken,
    },
}

impl Lock {
    fn session(lock: SessionLock) -> Self {
        let (closing, lost) = (CancellationToken::new(), CancellationToken::new());
        let keeper = tokio::spawn(lock.keep(closing.clone(), lost.clone()));
        Self::Session {
            keeper: Mutex::new(Some(keeper)),
            closing,
            lost,
        }
    }

    /// Returns when another server has taken the database over.
    pub(super) async fn lost(&self) {
        match self {
            Self::File { .. } => std::future::pending().await,
            Self::Session { lost, .. } => lost.cancelled().await,
        }
    }

    /// Lets other servers in, where not the end of this process does.
    pub(super) async fn release(&self) {
        let Self::Session {
            keeper, closing, ..
        } = self
        else {
            return;
        };
        closing.cancel();
        let keeper = keeper.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(keeper) = keeper
            && let Err(error) = keeper.await
        {
            tracing::error!(%error, "the keeper of the database's lock ended badly");
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        if let Self::Session { closing, .. } = self {
            closing.cancel();
        }
    }
}

impl Opened {
    pub(super) async fn open(settings: &DatabaseSettings) -> Result<Self, StoreError> {
        match &settings.place {
            DatabasePlace::File(path) => Self::sqlite(path, settings).await,
            DatabasePlace::Postgres(options) => Self::postgres(options, settings).await,
        }
    }

    async fn sqlite(path: &Path, settings: &DatabaseSettings) -> Result<Self, StoreError> {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).to_owned();
        std::fs::create_dir_all(&folder).map_err(|source| StoreError::File {
            path: folder.clone(),
            source,
        })?;
        let lock = FileLock::take(path)?;
        let writer_pool = sqlite::writer(path, settings.busy_timeout).await?;
        sqlite::migrate(&writer_pool).await?;
        let missing = sqlite::missing(&mut *writer_pool.acquire().await?).await?;
        if let Some(first) = missing.first() {
            return Err(corrupt("schema", path.display(), first));
        }
        let readers = sqlite::readers(path, settings.busy_timeout, settings.readers).await?;
        Ok(Self {
            folder,
            writer_pool: Pool::Sqlite(writer_pool),
            readers: Pool::Sqlite(readers),
            lock: Lock::File { _held: lock },
        })
    }

    async fn postgres(
        options: &PgConnectOptions,
        settings: &DatabaseSettings,
    ) -> Result<Self, StoreError> {
        let lock = SessionLock::take(options).await?;
        let lock = lock.ok_or_else(|| StoreError::Locked {
            database: settings.place.to_string(),
        })?;
        let writer_pool = postgres::pool(options.clone(), WRITERS).await?;
        postgres::migrate(&writer_pool).await?;
        let readers = postgres::pool(options.clone(), settings.readers).await?;
        Ok(Self {
            folder: std::env::temp_dir(),
            writer_pool: Pool::Postgres(writer_pool),
            readers: Pool::Postgres(readers),
            lock: Lock::session(lock),
        })
    }
}
