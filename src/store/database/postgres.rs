//! PostgreSQL: a server of its own, with which many nodes work.

use std::fmt;
use std::time::{Duration, Instant};

use sqlx::migrate::Migrator;
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{Connection as _, PgConnection, PgPool};

use super::migrations::migrations_after;
use crate::store::StoreError;

/// The migrations that make the schema of a PostgreSQL database.
pub(in crate::store) static SCHEMA: Migrator = sqlx::migrate!("./migrations/postgres");

/// The oldest schema whose servers may be at work while the schema is brought up to date, and after: what
/// came since only adds to it. The database says it too, in `schema_support`, to servers that are older.
pub(in crate::store) const OLDEST_AT_WORK: i64 = 47;

/// What all nodes hold together, and alone whoever needs the database for itself; any number that others
/// do not use.
const IN_USE: i64 = 0x6772_6579_626f_7801;
/// What a node holds that brings the schema up to date.
const MIGRATION: i64 = IN_USE + 1;
/// What a transaction that writes holds.
const WRITING: i64 = IN_USE + 2;

/// How long one who needs the database alone is waited for, and how often it is tried.
const PATIENCE: Duration = Duration::from_secs(3);
const RETRY_INTERVAL: Duration = Duration::from_millis(50);
/// How long a connection may be waited for.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(10);

/// What connections are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Use {
    Reads,
    Writes,
    /// Reading and writing all there is, while no server works with the database; also bringing its schema
    /// up to date.
    Copies,
}

/// Every statement of a server ends. A node that stands still in the middle of a transaction that writes holds
/// up the others for a few seconds; then the server ends the transaction. Whether the machine at the other end
/// is still there is found out soon.
fn bounded(options: &PgConnectOptions, r#use: Use) -> PgConnectOptions {
    let (statement, idle) = match r#use {
        Use::Reads => ("60s", "60s"),
        Use::Writes => ("60s", "5s"),
        Use::Copies => ("0", "0"),
    };
    options.clone().options([
        ("statement_timeout", statement),
        ("lock_timeout", "20s"),
        ("idle_in_transaction_session_timeout", idle),
        ("tcp_keepalives_idle", "5"),
        ("tcp_keepalives_interval", "2"),
        ("tcp_keepalives_count", "3"),
    ])
}

/// Connections that are used at the same time, at the most.
pub(in crate::store) async fn pool(
    options: &PgConnectOptions,
    at_most: u32,
    r#use: Use,
) -> Result<PgPool, StoreError> {
    let pool = PgPoolOptions::new()
        .max_connections(at_most)
        .acquire_timeout(ACQUIRE_TIMEOUT)
        .connect_with(bounded(options, r#use))
        .await?;
    Ok(pool)
}

/// The schema of a database.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Found {
    version: i64,
    /// The oldest whose servers can work with it.
    oldest: i64,
}

impl Found {
    /// None of a new database.
    async fn of(connection: &mut PgConnection) -> Result<Option<Found>, sqlx::Error> {
        let (has_versions, has_support): (bool, bool) = sqlx::query_as(
            "select to_regclass('_sqlx_migrations') is not null, \
             to_regclass('schema_support') is not null",
        )
        .fetch_one(&mut *connection)
        .await?;
        if !has_versions {
            return Ok(None);
        }
        let version: Option<i64> =
            sqlx::query_scalar("select max(version) from _sqlx_migrations where success")
                .fetch_one(&mut *connection)
                .await?;
        let Some(version) = version else {
            return Ok(None);
        };
        let oldest = if has_support {
            sqlx::query_scalar("select oldest from schema_support")
                .fetch_one(connection)
                .await?
        } else {
            version
        };
        Ok(Some(Found { version, oldest }))
    }
}

/// Brings the schema up to date, that of the queue and ours, one node after the other. Servers of a schema
/// that is a little older may be at work meanwhile; one that is newer is left as it is, where this one can
/// work with it.
pub(in crate::store) async fn migrate(
    options: &PgConnectOptions,
    database: impl fmt::Display,
) -> Result<(), StoreError> {
    let mut turn = PgConnection::connect_with(options).await?;
    sqlx::query("select pg_advisory_lock($1)")
        .bind(MIGRATION)
        .execute(&mut turn)
        .await?;
    let built = SCHEMA.iter().map(|migration| migration.version).max();
    let built = built.unwrap_or(0);
    let present = Found::of(&mut turn).await?;
    let alone = match present {
        Some(present) if present.version >= built => {
            turn.close().await?;
            return if present.oldest <= built {
                Ok(())
            } else {
                Err(StoreError::TooNew {
                    database: database.to_string(),
                    schema: present.version,
                    oldest: present.oldest,
                    own: built,
                })
            };
        }
        Some(present) if present.version < OLDEST_AT_WORK => {
            let alone = hold_alone(options).await?;
            Some(alone.ok_or_else(|| StoreError::InTheWay {
                database: database.to_string(),
                schema: present.version,
                own: built,
            })?)
        }
        Some(_) | None => None,
    };
    let pool = pool(options, 2, Use::Copies).await?;
    riverqueue::migrate::PostgresMigrator::new(pool.clone())
        .migrate_up()
        .await?;
    migrations_after(present.map(|present| present.version), &SCHEMA)?
        .run(&pool)
        .await?;
    pool.close().await;
    drop(alone);
    turn.close().await?;
    Ok(())
}

/// A connection of a node among others; nothing where somebody has the database alone. One that ended a
/// moment ago is waited for.
pub(in crate::store) async fn join(
    options: &PgConnectOptions,
) -> Result<Option<PgConnection>, sqlx::Error> {
    hold(options, "select pg_try_advisory_lock_shared($1)").await
}

/// A connection of one who has the database alone while it is open; nothing where nodes work with it.
pub(in crate::store) async fn hold_alone(
    options: &PgConnectOptions,
) -> Result<Option<PgConnection>, sqlx::Error> {
    hold(options, "select pg_try_advisory_lock($1)").await
}

async fn hold(
    options: &PgConnectOptions,
    lock: &'static str,
) -> Result<Option<PgConnection>, sqlx::Error> {
    let mut connection = PgConnection::connect_with(&bounded(options, Use::Reads)).await?;
    let began = Instant::now();
    loop {
        let held: bool = sqlx::query_scalar(lock)
            .bind(IN_USE)
            .fetch_one(&mut connection)
            .await?;
        if held {
            return Ok(Some(connection));
        }
        if began.elapsed() > PATIENCE {
            connection.close().await?;
            return Ok(None);
        }
        tokio::time::sleep(RETRY_INTERVAL).await;
    }
}

/// Waits until no transaction of another node writes, and keeps them waiting until this one ends.
pub(in crate::store) async fn take_turn(connection: &mut PgConnection) -> Result<(), sqlx::Error> {
    sqlx::query("select pg_advisory_xact_lock($1)")
        .bind(WRITING)
        .execute(connection)
        .await?;
    Ok(())
}
