//! PostgreSQL: a server of its own, with which many nodes work.

use std::time::{Duration, Instant};

use sqlx::migrate::Migrator;
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{Connection as _, PgConnection, PgPool};

use crate::store::StoreError;

/// Its schema.
pub(in crate::store) static SCHEMA: Migrator = sqlx::migrate!("./migrations/postgres");

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
    /// Reading and writing all there is, while no server works with the database.
    Copies,
}

/// Every statement of a server ends. A node that stands still in the middle of a transaction that writes holds up the
/// others for a few seconds; then the server ends the transaction. Whether the machine at the other end
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

/// Brings the schema up to date, that of the queue and ours, one node after the other.
pub(in crate::store) async fn migrate(
    options: &PgConnectOptions,
    pool: &PgPool,
) -> Result<(), StoreError> {
    let mut turn = PgConnection::connect_with(options).await?;
    sqlx::query("select pg_advisory_lock($1)")
        .bind(MIGRATION)
        .execute(&mut turn)
        .await?;
    riverqueue::migrate::PostgresMigrator::new(pool.clone())
        .migrate_up()
        .await?;
    SCHEMA.run(pool).await?;
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
