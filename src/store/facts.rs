//! Facts of a database that no server of this process works with: whether a server could work with the database.

use std::path::Path;

use jiff::Timestamp;
use sqlx::postgres::PgConnectOptions;

use super::database::postgres::{self, Use};
use super::database::{self, Losses, Pool};
use super::lock::FileLock;
use super::{DatabasePlace, StoreError, backup};

/// Facts of a database.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DatabaseFacts {
    /// The schema; nothing where no server has worked with the database yet.
    pub schema: Option<i64>,
    /// Tokens that were not revoked.
    pub tokens: i64,
    /// Whether a server works with a file now.
    pub is_served: bool,
    /// The facts that a PostgreSQL alone has.
    pub postgres: Option<PostgresFacts>,
}

/// Facts of a PostgreSQL.
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
        let pool = backup::pool(path).await?;
        let is_ours = "select exists (select 1 from sqlite_master where name = '_sqlx_migrations')";
        let facts = Self {
            is_served,
            ..Self::default()
        };
        let facts = facts.with_schema(&pool, is_ours).await;
        pool.close().await;
        facts
    }

    async fn of_postgres(
        options: &PgConnectOptions,
        place: &DatabasePlace,
    ) -> Result<Self, StoreError> {
        postgres::examine(options, place).await?;
        let pool = Pool::of_postgres(options, 1, Use::Reads, &Losses::default()).await?;
        let facts = Self {
            postgres: Some(PostgresFacts::read(&pool).await?),
            ..Self::default()
        };
        let is_ours = "select to_regclass('_sqlx_migrations') is not null";
        let facts = facts.with_schema(&pool, is_ours).await;
        pool.close().await;
        facts
    }

    /// The facts with schema and tokens, where a statement says that the database is one of this program.
    async fn with_schema(self, pool: &Pool, is_ours: &'static str) -> Result<Self, StoreError> {
        let is_ours: bool = database::query_scalar(is_ours).fetch_one(pool).await?;
        if !is_ours {
            return Ok(self);
        }
        let schema: i64 = database::query_scalar("select max(version) from _sqlx_migrations")
            .fetch_one(pool)
            .await?;
        let tokens: i64 =
            database::query_scalar("select count(*) from tokens where revoked_at is null")
                .fetch_one(pool)
                .await?;
        Ok(Self {
            schema: Some(schema),
            tokens,
            ..self
        })
    }
}

impl PostgresFacts {
    async fn read(pool: &Pool) -> Result<Self, StoreError> {
        let version: String = database::query_scalar("select current_setting('server_version')")
            .fetch_one(pool)
            .await?;
        let is_over_tls: Option<bool> =
            database::query_scalar("select ssl from pg_stat_ssl where pid = pg_backend_pid()")
                .fetch_optional(pool)
                .await?;
        let there: f64 =
            database::query_scalar("select extract(epoch from clock_timestamp())::float8")
                .fetch_one(pool)
                .await?;
        let here = Timestamp::now().as_millisecond() as f64 / 1e3;
        Ok(Self {
            version,
            is_over_tls: is_over_tls.unwrap_or(false),
            clock_ahead_s: there - here,
        })
    }
}
