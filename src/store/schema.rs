//! Whether a database has every table, column, index and trigger that its migrations made.

use std::collections::BTreeSet;

use sqlx::sqlite::SqlitePoolOptions;
use sqlx::{SqliteConnection, SqlitePool};

use super::StoreError;

/// What is missing of a database that is up to date, in sentences.
pub(super) async fn missing(connection: &mut SqliteConnection) -> Result<Vec<String>, StoreError> {
    let there = parts(connection).await?;
    let made = parts(&mut *fresh().await?.acquire().await?).await?;
    let missing = made.difference(&there);
    Ok(missing
        .map(|part| format!("the {part} is missing"))
        .collect())
}

/// Brings the schema up to date, that of the queue and ours.
pub(super) async fn migrate(pool: &SqlitePool) -> Result<(), StoreError> {
    riverqueue::migrate::SqliteMigrator::new(pool.clone())
        .migrate_up()
        .await?;
    sqlx::migrate!().run(pool).await?;
    Ok(())
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
