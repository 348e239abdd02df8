//! SQLite: a file of one server. One connection writes, several read.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use sqlx::migrate::Migrator;
use sqlx::sqlite::{
    SqliteAutoVacuum, SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous,
};
use sqlx::{Connection as _, SqliteConnection, SqlitePool};

use super::migrations::migrations_after;
use crate::store::StoreError;

/// The migrations that make the schema of a SQLite database.
pub(in crate::store) static SCHEMA: Migrator = sqlx::migrate!("./migrations");

/// The version of the database's schema that this build works with.
pub fn schema_version() -> i64 {
    let versions = SCHEMA.iter().map(|migration| migration.version);
    versions.max().unwrap_or(0)
}

/// The one connection that writes. A disk that is full can leave it inside a transaction that SQLite
/// has ended and the connection has not; such a one is closed, and the next write opens another.
pub(in crate::store) async fn writer(
    path: &Path,
    busy_timeout: Duration,
) -> Result<SqlitePool, StoreError> {
    let pool = SqlitePoolOptions::new()
        .max_connections(1)
        .min_connections(1)
        .idle_timeout(None)
        .max_lifetime(None)
        // A connection to a file does not break off.
        .test_before_acquire(false)
        .after_release(|connection, _| {
            Box::pin(async move {
                if connection.is_in_transaction() {
                    // The answer comes after a rollback that was begun by dropping a transaction.
                    connection.ping().await?;
                }
                Ok(!connection.is_in_transaction())
            })
        })
        // A new file can give the pages of removed rows back to the disk.
        .connect_with(options(path, busy_timeout).auto_vacuum(SqliteAutoVacuum::Incremental))
        .await?;
    Ok(pool)
}

/// The connections that read.
pub(in crate::store) async fn readers(
    path: &Path,
    busy_timeout: Duration,
    at_most: u32,
) -> Result<SqlitePool, StoreError> {
    let pool = SqlitePoolOptions::new()
        .max_connections(at_most)
        // A connection to a file does not break off.
        .test_before_acquire(false)
        .connect_with(options(path, busy_timeout).read_only(true))
        .await?;
    Ok(pool)
}

/// Brings the schema up to date, that of the queue and ours.
pub(in crate::store) async fn migrate(pool: &SqlitePool) -> Result<(), StoreError> {
    riverqueue::migrate::SqliteMigrator::new(pool.clone())
        .migrate_up()
        .await?;
    migrations_after(schema(pool).await?, &SCHEMA)?
        .run(pool)
        .await?;
    Ok(())
}

/// The schema of a database; nothing of a new database.
async fn schema(pool: &SqlitePool) -> Result<Option<i64>, sqlx::Error> {
    let has_schema: bool = sqlx::query_scalar(
        "select exists (select 1 from sqlite_master where name = '_sqlx_migrations')",
    )
    .fetch_one(pool)
    .await?;
    if !has_schema {
        return Ok(None);
    }
    sqlx::query_scalar("select max(version) from _sqlx_migrations")
        .fetch_one(pool)
        .await
}

pub(in crate::store) fn options(path: &Path, busy_timeout: Duration) -> SqliteConnectOptions {
    SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .foreign_keys(true)
        // What is removed from a page that is written anyway does not stay in the page.
        .pragma("secure_delete", "fast")
        .busy_timeout(busy_timeout)
        .statement_cache_capacity(256)
}

/// What is missing of a database that is up to date, in sentences.
pub(in crate::store) async fn missing(
    connection: &mut SqliteConnection,
) -> Result<Vec<String>, StoreError> {
    let there = parts(connection).await?;
    let made = parts(&mut *fresh().await?.acquire().await?).await?;
    let missing = made.difference(&there);
    Ok(missing
        .map(|part| format!("the {part} is missing"))
        .collect())
}

/// A new database in memory.
async fn fresh() -> Result<SqlitePool, StoreError> {
    let pool = SqlitePoolOptions::new()
        .max_connections(1)
        .idle_timeout(None)
        .max_lifetime(None)
        .connect("sqlite::memory:")
        .await?;
    migrate(&pool).await?;
    Ok(pool)
}

async fn parts(connection: &mut SqliteConnection) -> Result<BTreeSet<String>, StoreError> {
    let parts: Vec<String> = sqlx::query_scalar(
        "select type || ' ' || name from sqlite_master where name not like 'sqlite_%' \
         union all select 'column ' || part.name || ' of ' || whole.name \
         from sqlite_master as whole join pragma_table_xinfo(whole.name) as part \
         where whole.type = 'table'",
    )
    .fetch_all(connection)
    .await?;
    Ok(parts.into_iter().collect())
}
