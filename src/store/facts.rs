//! What can be said of a database without working with it: whether a server could.

use std::path::Path;
use std::time::Duration;

use jiff::Timestamp;
use sqlx::postgres::PgConnectOptions;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{Connection as _, PgConnection, SqliteConnection};

use super::database::postgres;
use super::lock::FileLock;
use super::{DatabasePlace, StoreError};

/// How long a statement waits for a lock of the server.
const BUSY_TIMEOUT: Duration = Duration::from_secs(5);

/// What can be said of a database.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DatabaseFacts {
    /// The schema; nothing where no server has worked with the database yet.
    pub schema: Option<i64>,
    /// Tokens that were not revoked.
    pub tokens: i64,
    /// Whether a server works with a file now.
    pub is_served: bool,
    /// What holds for a PostgreSQL alone.
    pub postgres: Option<PostgresFacts>,
}

/// What can be said of a PostgreSQL.
#[derive(Clone, Debug, PartialEq)]
pub struct PostgresFacts {
    /// The version of the PostgreSQL.
    pub version: String,
    /// Whether the way there is over TLS.
    pub is_over_tls: bool,
    /// How far the clock there is ahead of the clock here `[s]`.
    pub clock_ahead_s: f64,
}

impl DatabaseFacts {
    /// Looks at a database, and creates none.
    ///
    /// # Errors
    /// The database cannot be reached or read.
    pub async fn of(place: &DatabasePlace) -> Result<Self, StoreError> {
        match place {
            DatabasePlace::File(path) if !path.exists() => Ok(Self::default()),
            DatabasePlace::File(path) => Self::of_file(path).await,
            DatabasePlace::Postgres(options) => Self::of_postgres(options, place).await,
        }
    }

    async fn of_file(path: &Path) -> Result<Self, StoreError> {
        let is_served = match FileLock::take(path) {
            Ok(_lock) => false,
            Err(StoreError::Locked { .. }) => true,
            Err(error) => return Err(error),
        };
        let options = SqliteConnectOptions::new().filename(path);
        let mut connection =
            SqliteConnection::connect_with(&options.busy_timeout(BUSY_TIMEOUT)).await?;
        let is_ours: bool = sqlx::query_scalar(
            "select exists (select 1 from sqlite_master where name = '_sqlx_migrations')",
        )
        .fetch_one(&mut connection)
        .await?;
        let mut facts = Self {
            is_served,
            ..Self::default()
        };
        if is_ours {
            facts.schema = sqlx::query_scalar("select max(version) from _sqlx_migrations")
                .fetch_one(&mut connection)
                .await?;
            facts.tokens = sqlx::query_scalar(VALID_TOKENS)
                .fetch_one(&mut connection)
                .await?;
        }
        connection.close().await?;
        Ok(facts)
    }

    async fn of_postgres(
        options: &PgConnectOptions,
        place: &DatabasePlace,
    ) -> Result<Self, StoreError> {
        postgres::examine(options, place).await?;
        let mut connection = PgConnection::connect_with(options).await?;
        let version: String = sqlx::query_scalar("show server_version")
            .fetch_one(&mut connection)
            .await?;
        let is_over_tls: Option<bool> =
            sqlx::query_scalar("select ssl from pg_stat_ssl where pid = pg_backend_pid()")
                .fetch_optional(&mut connection)
                .await?;
        let there: f64 = sqlx::query_scalar("select extract(epoch from clock_timestamp())::float8")
            .fetch_one(&mut connection)
            .await?;
        let here = Timestamp::now().as_millisecond() as f64 / 1e3;
        let is_ours: bool =
            sqlx::query_scalar("select to_regclass('_sqlx_migrations') is not null")
                .fetch_one(&mut connection)
                .await?;
        let mut facts = Self {
            postgres: Some(PostgresFacts {
                version,
                is_over_tls: is_over_tls.unwrap_or(false),
                clock_ahead_s: there - here,
            }),
            ..Self::default()
        };
        if is_ours {
            facts.schema = sqlx::query_scalar("select max(version) from _sqlx_migrations")
                .fetch_one(&mut connection)
                .await?;
            facts.tokens = sqlx::query_scalar(VALID_TOKENS)
                .fetch_one(&mut connection)
                .await?;
        }
        connection.close().await?;
        Ok(facts)
    }
}

const VALID_TOKENS: &str = "select count(*) from tokens where revoked_at is null";
