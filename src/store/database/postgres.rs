//! PostgreSQL: a server of its own.

use std::time::{Duration, Instant};

use sqlx::migrate::Migrator;
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{Connection as _, PgConnection, PgPool};
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

use crate::store::StoreError;

/// Its schema.
pub(in crate::store) static SCHEMA: Migrator = sqlx::migrate!("./migrations/postgres");

/// What a server holds so that no other works with the database; any number that others do not use.
const LOCK: i64 = 0x6772_6579_626f_7801;

/// How long the lock of another server is waited for, and how often it is tried.
const PATIENCE: Duration = Duration::from_secs(3);
const RETRY_INTERVAL: Duration = Duration::from_millis(50);
/// How often it is looked whether the lock is still there.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);
/// How long a connection may be waited for.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(10);

/// Connections that are used at the same time, at the most.
pub(in crate::store) async fn pool(
    options: PgConnectOptions,
    at_most: u32,
) -> Result<PgPool, StoreError> {
    let pool = PgPoolOptions::new()
        .max_connections(at_most)
        .acquire_timeout(ACQUIRE_TIMEOUT)
        .connect_with(options)
        .await?;
    Ok(pool)
}

/// Brings the schema up to date, that of the queue and ours. Whoever does so holds the lock of the
/// database.
pub(in crate::store) async fn migrate(pool: &PgPool) -> Result<(), StoreError> {
    riverqueue::migrate::PostgresMigrator::new(pool.clone())
        .migrate_up()
        .await?;
    SCHEMA.run(pool).await?;
    Ok(())
}

/// Keeps other servers away from a database for as long as its connection lasts.
pub(in crate::store) struct SessionLock {
    options: PgConnectOptions,
    connection: PgConnection,
}

impl SessionLock {
    /// Takes the lock; nothing where another server has it. That of a server which ended a moment
    /// ago is waited for.
    pub(in crate::store) async fn take(
        options: &PgConnectOptions,
    ) -> Result<Option<Self>, sqlx::Error> {
        // The database learns soon when the machine of whoever has the lock is gone.
        let options = options.clone().options([
            ("tcp_keepalives_idle", "5"),
            ("tcp_keepalives_interval", "2"),
            ("tcp_keepalives_count", "3"),
        ]);
        let mut connection = PgConnection::connect_with(&options).await?;
        let began = Instant::now();
        loop {
            let taken: bool = sqlx::query_scalar("select pg_try_advisory_lock($1)")
                .bind(LOCK)
                .fetch_one(&mut connection)
                .await?;
            if taken {
                return Ok(Some(Self {
                    options,
                    connection,
                }));
            }
            if began.elapsed() > PATIENCE {
                connection.close().await?;
                return Ok(None);
            }
            tokio::time::sleep(RETRY_INTERVAL).await;
        }
    }

    /// Keeps the lock until `closing`, and takes it again when its connection broke off. Says
    /// `lost` and ends where another server was faster.
    pub(in crate::store) async fn keep(
        mut self,
        closing: CancellationToken,
        lost: CancellationToken,
    ) {
        let mut due = tokio::time::interval(LOOK_INTERVAL);
        due.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                () = closing.cancelled() => break,
                _ = due.tick() => {}
            }
            if self.connection.ping().await.is_ok() {
                continue;
            }
            match Self::take(&self.options).await {
                Ok(Some(again)) => self = again,
                Ok(None) => {
                    tracing::error!("another server has taken the database over");
                    lost.cancel();
                    return;
                }
                Err(error) => tracing::warn!(%error, "the database does not answer"),
            }
        }
        if let Err(error) = self.connection.close().await {
            tracing::debug!(%error, "the lock's connection was gone");
        }
    }
}
