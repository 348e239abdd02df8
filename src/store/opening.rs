//! Where a database is, and opening it: a file for this server alone, a PostgreSQL with others.

use std::fmt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use sqlx::PgConnection;
use sqlx::postgres::PgConnectOptions;

use super::database::postgres::{self, Use};
use super::database::{Losses, Pool, sqlite};
use super::lock::FileLock;
use super::postgres_address::{self, AddressError};
use super::{SecretKeys, StoreError, corrupt, private_file};

/// Connections to PostgreSQL of the writer and of the queue.
const WRITERS: u32 = 4;

/// How long a command's statement waits for a lock of the server.
pub(super) const PATIENCE_OF_A_COMMAND: Duration = Duration::from_secs(30);

/// Where a database is.
#[derive(Clone)]
pub enum DatabasePlace {
    /// A SQLite file; created with its folder when absent.
    File(PathBuf),
    /// A PostgreSQL server and a database there.
    Postgres(Box<PgConnectOptions>),
}

impl DatabasePlace {
    /// The PostgreSQL of an address.
    ///
    /// # Errors
    /// The text is no address, names files that cannot be read, or asks for half a check of the server.
    pub fn of_postgres(address: &str) -> Result<Self, AddressError> {
        Ok(Self::Postgres(Box::new(postgres_address::parse(address)?)))
    }
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
    /// Where the database is.
    pub place: DatabasePlace,
    /// Connections that read at the same time.
    pub readers: u32,
    /// How long a statement waits for another connection's lock.
    pub busy_timeout: Duration,
    /// How often a node of a PostgreSQL says that it lives.
    pub beat: Duration,
    /// The keys under which secrets stand in the database.
    pub keys: SecretKeys,
}

/// A database that is up to date.
pub(super) struct Opened {
    /// For files beside the database.
    pub(super) folder: PathBuf,
    pub(super) writer_pool: Pool,
    pub(super) readers: Pool,
    pub(super) access: Access,
}

/// Who else may work with the database.
pub(super) enum Access {
    /// Nobody, for as long as this is kept.
    Alone(FileLock),
    /// Other nodes.
    Shared(SharedPostgres),
}

/// A PostgreSQL that other nodes work with too.
#[derive(Clone)]
pub(super) struct SharedPostgres {
    options: Box<PgConnectOptions>,
    /// Whoever listens for changes notes when connections were lost.
    pub(super) losses: Losses,
    /// How often a node says that it lives.
    pub(super) beat: Duration,
}

impl SharedPostgres {
    /// Reached so, by one that says nothing of itself.
    #[cfg(test)]
    pub(super) fn of(options: PgConnectOptions) -> Self {
        Self {
            options: Box::new(options),
            losses: Losses::default(),
            beat: Duration::MAX,
        }
    }

    /// How the server is reached.
    pub(super) fn options(&self) -> &PgConnectOptions {
        &self.options
    }

    /// A connection of its own, which also keeps those away that need the database for themselves.
    pub(super) async fn connect(&self) -> Result<PgConnection, sqlx::Error> {
        let joined = postgres::join(&self.options).await?;
        joined
            .ok_or_else(|| sqlx::Error::Protocol("the database is in use by one alone".to_owned()))
    }
}

impl DatabaseSettings {
    /// For a command that works with a database as no server does.
    pub(super) fn of_a_command(place: &DatabasePlace) -> Self {
        Self {
            place: place.clone(),
            readers: 2,
            busy_timeout: PATIENCE_OF_A_COMMAND,
            beat: Duration::MAX,
            keys: SecretKeys::default(),
        }
    }
}

/// How long a server waits for whoever has the database: a command on tokens has it for some 12 ms, a server that is
/// about to end for as long as its last slice takes.
const LONGEST_WAIT: Duration = Duration::from_secs(3);
/// How often the server tries meanwhile.
const BETWEEN_TRIALS: Duration = Duration::from_millis(20);

impl Opened {
    /// For a server, which waits a little for a command that has the database.
    pub(super) async fn open_in_turn(settings: &DatabaseSettings) -> Result<Self, StoreError> {
        let until = Instant::now() + LONGEST_WAIT;
        loop {
            match Self::open(settings).await {
                Err(StoreError::Locked { .. }) if Instant::now() < until => {
                    tokio::time::sleep(BETWEEN_TRIALS).await;
                }
                opened => return opened,
            }
        }
    }

    /// For whoever goes another way where somebody has the database.
    pub(super) async fn open(settings: &DatabaseSettings) -> Result<Self, StoreError> {
        Self::open_for(settings, [Use::Writes, Use::Reads]).await
    }

    /// For what the connections that write and those that read are there for.
    pub(super) async fn open_for(
        settings: &DatabaseSettings,
        uses: [Use; 2],
    ) -> Result<Self, StoreError> {
        match &settings.place {
            DatabasePlace::File(path) => Self::sqlite(path, settings).await,
            DatabasePlace::Postgres(options) => Self::postgres(options, settings, uses).await,
        }
    }

    /// Closes it again.
    pub(super) async fn close(self) {
        self.readers.close().await;
        self.writer_pool.close().await;
    }

    async fn sqlite(path: &Path, settings: &DatabaseSettings) -> Result<Self, StoreError> {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).to_owned();
        std::fs::create_dir_all(&folder).map_err(|source| StoreError::File {
            path: folder.clone(),
            source,
        })?;
        let lock = FileLock::take(path)?;
        private_file::mend(path);
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
            access: Access::Alone(lock),
        })
    }

    async fn postgres(
        options: &PgConnectOptions,
        settings: &DatabaseSettings,
        [writes, reads]: [Use; 2],
    ) -> Result<Self, StoreError> {
        postgres::examine(options, &settings.place).await?;
        postgres::migrate(options, &settings.place).await?;
        let joined = postgres::join(options).await?;
        let joined = joined.ok_or_else(|| StoreError::Locked {
            database: settings.place.to_string(),
        })?;
        let losses = Losses::default();
        let writer_pool = Pool::of_postgres(options, WRITERS, writes, &losses).await?;
        let readers = Pool::of_postgres(options, settings.readers, reads, &losses).await?;
        drop(joined);
        Ok(Self {
            folder: std::env::temp_dir(),
            writer_pool,
            readers,
            access: Access::Shared(SharedPostgres {
                options: Box::new(options.clone()),
                losses,
                beat: settings.beat,
            }),
        })
    }
}
