//! PostgreSQL: a server of its own, with which many nodes work.

use std::fmt;
use std::net::IpAddr;
use std::time::{Duration, Instant};

use sqlx::migrate::Migrator;
use sqlx::postgres::{PgConnectOptions, PgPoolOptions};
use sqlx::{AssertSqlSafe, Connection as _, PgConnection, PgPool, Row as _};

use super::Losses;
use super::migrations::migrations_after;
use crate::store::StoreError;
use crate::store::node_name::node_name;

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

/// A connection that does not answer within this time is replaced by a new one.
const LONGEST_PING: Duration = Duration::from_millis(500);

/// What connections are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::store) enum Use {
    Reads,
    Writes,
    /// Reading and writing all there is, while no server works with the database; also bringing its schema
    /// up to date.
    Copies,
    /// Saying that a node lives, and keeping those away that need the database alone.
    Lives,
    /// Telling other nodes of changes.
    Tells,
    /// Being told of changes by other nodes.
    Listens,
}

impl Use {
    /// What `pg_stat_activity` shows of a connection, after the name of the program.
    fn name(self) -> &'static str {
        match self {
            Self::Reads => "reads",
            Self::Writes => "writes",
            Self::Copies => "copies",
            Self::Lives => "lives",
            Self::Tells => "tells",
            Self::Listens => "listens",
        }
    }

    /// How long a statement may take, and how long a transaction may wait for its next statement.
    fn limits(self) -> [&'static str; 2] {
        match self {
            Self::Writes => ["60s", "5s"],
            Self::Copies => ["0", "0"],
            Self::Reads | Self::Lives | Self::Tells | Self::Listens => ["60s", "60s"],
        }
    }
}

/// How the server is reached for a use. The name of the connection says which node uses it for what. Nothing is
/// sent at the start that a pooler does not pass on.
fn named(options: &PgConnectOptions, r#use: Use) -> PgConnectOptions {
    let program = options.get_application_name().unwrap_or("greybox");
    let name = format!("{program} {} {}", r#use.name(), node_name());
    let options = options.clone().application_name(&name);
    options.extra_float_digits(None::<i8>)
}

/// Sees to it that every statement of a server ends. A node that stands still in the middle of a transaction that
/// writes holds up the others for a few seconds; then the server ends the transaction. Whether the machine at the
/// other end is still there is found out soon.
async fn bound(connection: &mut PgConnection, r#use: Use) -> Result<(), sqlx::Error> {
    let [statement, idle] = r#use.limits();
    let settings = format!(
        "set statement_timeout = '{statement}'; set lock_timeout = '20s'; \
         set idle_in_transaction_session_timeout = '{idle}'; \
         set tcp_keepalives_idle = 5; set tcp_keepalives_interval = 2; set tcp_keepalives_count = 3"
    );
    sqlx::raw_sql(AssertSqlSafe(settings))
        .execute(connection)
        .await?;
    Ok(())
}

/// A connection for a use.
pub(in crate::store) async fn connect(
    options: &PgConnectOptions,
    r#use: Use,
) -> Result<PgConnection, sqlx::Error> {
    let mut connection = PgConnection::connect_with(&named(options, r#use)).await?;
    bound(&mut connection, r#use).await?;
    Ok(connection)
}

/// Connections that are used at the same time, at the most.
pub(in crate::store) async fn pool(
    options: &PgConnectOptions,
    at_most: u32,
    r#use: Use,
    losses: &Losses,
) -> Result<PgPool, sqlx::Error> {
    let (before, after) = (options.clone(), (options.clone(), losses.clone()));
    PgPoolOptions::new()
        .max_connections(at_most)
        .acquire_timeout(ACQUIRE_TIMEOUT)
        .after_connect(move |connection, _| Box::pin(bound(connection, r#use)))
        .test_before_acquire(false)
        .before_acquire(move |connection, _| {
            let options = before.clone();
            Box::pin(async move {
                replace_lost(connection, &options, r#use).await?;
                Ok(true)
            })
        })
        .after_release(move |connection, pooled| {
            let (options, losses) = after.clone();
            Box::pin(async move {
                while losses.concern(pooled.age)
                    && let Err(error) = replace_lost(connection, &options, r#use).await
                {
                    tracing::warn!(%error, "a lost connection is not replaced yet");
                    tokio::time::sleep(RETRY_INTERVAL).await;
                }
                Ok(true)
            })
        })
        .connect_with(named(options, r#use))
        .await
}

/// Puts a new connection in the place of one that does not answer. The lost one is dropped and not closed: with TLS
/// the end of a connection waits for the other side, which may never answer.
async fn replace_lost(
    connection: &mut PgConnection,
    options: &PgConnectOptions,
    r#use: Use,
) -> Result<(), sqlx::Error> {
    let answer = tokio::time::timeout(LONGEST_PING, connection.ping()).await;
    if !matches!(answer, Ok(Ok(()))) {
        let replacing = tokio::time::timeout(ACQUIRE_TIMEOUT, connect(options, r#use));
        *connection = replacing
            .await
            .map_err(|_too_long| sqlx::Error::PoolTimedOut)??;
    }
    Ok(())
}

/// Looks at the way to a PostgreSQL: refuses a pooler that does not keep a connection for a client, and warns where
/// what is stored goes over a network in the clear.
pub(in crate::store) async fn examine(
    options: &PgConnectOptions,
    database: impl fmt::Display,
) -> Result<(), StoreError> {
    let examined = tokio::time::timeout(ACQUIRE_TIMEOUT, examine_unbounded(options)).await;
    let way = examined.map_err(|_too_long| sqlx::Error::PoolTimedOut)??;
    if !way.keeps_sessions {
        return Err(StoreError::SharedSessions {
            database: database.to_string(),
        });
    }
    if way.is_in_the_clear {
        tracing::warn!(
            %database,
            "what is stored goes over the network in the clear; the address takes sslmode=verify-full"
        );
    }
    Ok(())
}

/// The way to a PostgreSQL.
struct Way {
    /// Whether a connection of a client is one connection of the database for as long as it lasts.
    keeps_sessions: bool,
    /// Whether others on the network can read what is sent.
    is_in_the_clear: bool,
}

/// A pooler that works by transactions or statements gives the connection of a client that is in no transaction to
/// the next client, or gives the client one after the other.
async fn examine_unbounded(options: &PgConnectOptions) -> Result<Way, sqlx::Error> {
    let named = named(options, Use::Lives);
    let mut idle = PgConnection::connect_with(&named).await?;
    let mut working = PgConnection::connect_with(&named).await?;
    let before = [backend(&mut idle).await?, backend(&mut idle).await?];
    sqlx::raw_sql("begin").execute(&mut working).await?;
    let of_working = backend(&mut working).await?;
    let after = backend(&mut idle).await?;
    sqlx::raw_sql("rollback").execute(&mut working).await?;
    let keeps_sessions = before == [after; 2] && of_working != after;
    let transport = sqlx::raw_sql(
        "select ssl, host(inet_client_addr()) from pg_stat_ssl where pid = pg_backend_pid()",
    );
    let transport = transport.fetch_optional(&mut idle).await?;
    let is_in_the_clear = match transport {
        Some(row) => {
            let address: Option<String> = row.try_get(1)?;
            goes_in_the_clear(row.try_get(0)?, address.as_deref())
        }
        None => false,
    };
    idle.close().await?;
    working.close().await?;
    Ok(Way {
        keeps_sessions,
        is_in_the_clear,
    })
}

/// The process of the database that works for a connection.
async fn backend(connection: &mut PgConnection) -> Result<i32, sqlx::Error> {
    let row = sqlx::raw_sql("select pg_backend_pid()");
    row.fetch_one(connection).await?.try_get(0)
}

/// Whether others can read what comes from a client of this address; a client of a socket has no address.
fn goes_in_the_clear(is_encrypted: bool, address: Option<&str>) -> bool {
    let address: Option<IpAddr> = address.and_then(|address| address.parse().ok());
    !is_encrypted && address.is_some_and(|address| !address.to_canonical().is_loopback())
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
    let mut turn = PgConnection::connect_with(&named(options, Use::Copies)).await?;
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
                    program_schema: built,
                })
            };
        }
        Some(present) if present.version < OLDEST_AT_WORK => {
            let alone = hold_alone(options).await?;
            Some(alone.ok_or_else(|| StoreError::InTheWay {
                database: database.to_string(),
                schema: present.version,
                program_schema: built,
            })?)
        }
        Some(_) | None => None,
    };
    let pool = pool(options, 2, Use::Copies, &Losses::default()).await?;
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
    let mut connection = connect(options, Use::Lives).await?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_through_the_machine_itself_needs_no_tls() {
        assert!(goes_in_the_clear(false, Some("192.0.2.7")));
        assert!(!goes_in_the_clear(true, Some("192.0.2.7")));
        for address in [
            None,
            Some("127.0.0.1"),
            Some("::1"),
            Some("::ffff:127.0.0.1"),
        ] {
            assert!(!goes_in_the_clear(false, address), "{address:?}");
        }
    }
}
