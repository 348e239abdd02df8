//! Pools, connections and transactions of either database.

use std::ops::{Deref, DerefMut};
use std::time::{Duration, Instant};

use sqlx::pool::PoolConnection;
use sqlx::postgres::PgConnectOptions;
use sqlx::{Database, PgPool, Postgres, Sqlite, SqlitePool};

use super::postgres::{self, Use};
use super::{Kind, Losses};

/// How long connections to a PostgreSQL may take to end; those that were lost never do.
const LONGEST_CLOSE: Duration = Duration::from_secs(2);

/// Connections of one database.
#[derive(Clone, Debug)]
pub(in crate::store) enum Pool {
    Sqlite(SqlitePool),
    Postgres(PgPool, Losses),
}

impl Pool {
    /// Connections to a PostgreSQL for a use, at the most so many at the same time.
    pub(in crate::store) async fn of_postgres(
        options: &PgConnectOptions,
        at_most: u32,
        r#use: Use,
        losses: &Losses,
    ) -> Result<Self, sqlx::Error> {
        let pool = postgres::pool(options, at_most, r#use, losses).await?;
        Ok(Self::Postgres(pool, losses.clone()))
    }

    /// Which database it is.
    pub(in crate::store) fn kind(&self) -> Kind {
        match self {
            Self::Sqlite(_) => Kind::Sqlite,
            Self::Postgres(..) => Kind::Postgres,
        }
    }

    /// A connection for several statements, as soon as one is free.
    pub(in crate::store) async fn acquire(&self) -> Result<Connection, sqlx::Error> {
        let asked = Instant::now();
        let connection = match self {
            Self::Sqlite(pool) => Connection::Sqlite(Held::Pooled(pool.acquire().await?)),
            Self::Postgres(pool, losses) => {
                Connection::Postgres(Held::Pooled(pool.acquire().await?), losses.clone())
            }
        };
        let waited = asked.elapsed().as_secs_f64();
        metrics::histogram!("greybox_connection_wait_seconds").record(waited);
        Ok(connection)
    }

    /// A transaction that reads one state of the database.
    pub(in crate::store) async fn begin_read(&self) -> Result<Connection, sqlx::Error> {
        Ok(match self {
            Self::Sqlite(pool) => Connection::Sqlite(Held::Transaction(pool.begin().await?)),
            Self::Postgres(pool, losses) => {
                let begin = pool.begin_with("begin isolation level repeatable read read only");
                let transaction = losses.unless_lost(begin).await?;
                Connection::Postgres(Held::Transaction(transaction), losses.clone())
            }
        })
    }

    /// A transaction that writes.
    pub(in crate::store) async fn begin_write(&self) -> Result<Connection, sqlx::Error> {
        Ok(match self {
            Self::Sqlite(pool) => {
                Connection::Sqlite(Held::Transaction(pool.begin_with("begin immediate").await?))
            }
            Self::Postgres(pool, losses) => {
                let transaction = losses.unless_lost(pool.begin()).await?;
                Connection::Postgres(Held::Transaction(transaction), losses.clone())
            }
        })
    }

    /// A transaction that writes while no other transaction does, for a command beside the servers of the database.
    pub(in crate::store) async fn begin_write_in_turn(&self) -> Result<Connection, sqlx::Error> {
        let mut transaction = self.begin_write().await?;
        transaction.take_turn().await?;
        Ok(transaction)
    }

    /// Closes all connections.
    pub(in crate::store) async fn close(&self) {
        match self {
            Self::Sqlite(pool) => pool.close().await,
            Self::Postgres(pool, _) => {
                if tokio::time::timeout(LONGEST_CLOSE, pool.close())
                    .await
                    .is_err()
                {
                    tracing::warn!("connections that do not end were left");
                }
            }
        }
    }
}

/// One connection, in a transaction or not.
pub(in crate::store) enum Connection {
    Sqlite(Held<Sqlite>),
    Postgres(Held<Postgres>, Losses),
}

impl Connection {
    /// Which database it is.
    pub(in crate::store) fn kind(&self) -> Kind {
        match self {
            Self::Sqlite(_) => Kind::Sqlite,
            Self::Postgres(..) => Kind::Postgres,
        }
    }

    /// Has a transaction of a PostgreSQL write while no other transaction does. A file has one that writes.
    pub(in crate::store) async fn take_turn(&mut self) -> Result<(), sqlx::Error> {
        match self {
            Self::Sqlite(_) => Ok(()),
            Self::Postgres(connection, losses) => {
                let turn = postgres::take_turn(connection);
                losses.unless_lost(turn).await
            }
        }
    }

    /// The transaction that it is in; nothing where it is in none.
    pub(in crate::store) fn transaction(&mut self) -> Option<Transaction<'_>> {
        match self {
            Self::Sqlite(Held::Transaction(transaction)) => Some(Transaction::Sqlite(transaction)),
            Self::Postgres(Held::Transaction(transaction), _) => {
                Some(Transaction::Postgres(transaction))
            }
            Self::Sqlite(_) | Self::Postgres(..) => None,
        }
    }

    /// Ends the transaction; what it wrote is then on disk.
    pub(in crate::store) async fn commit(self) -> Result<(), sqlx::Error> {
        match self {
            Self::Sqlite(Held::Transaction(transaction)) => transaction.commit().await,
            Self::Postgres(Held::Transaction(transaction), losses) => {
                losses.unless_lost(transaction.commit()).await
            }
            Self::Sqlite(_) | Self::Postgres(..) => Ok(()),
        }
    }
}

/// A transaction as the queue takes it.
pub(in crate::store) enum Transaction<'c> {
    Sqlite(&'c mut sqlx::Transaction<'static, Sqlite>),
    Postgres(&'c mut sqlx::Transaction<'static, Postgres>),
}

/// How a connection is had.
pub(in crate::store) enum Held<DB: Database> {
    Pooled(PoolConnection<DB>),
    Transaction(sqlx::Transaction<'static, DB>),
}

impl<DB: Database> Deref for Held<DB> {
    type Target = DB::Connection;

    fn deref(&self) -> &DB::Connection {
        match self {
            Self::Pooled(connection) => connection,
            Self::Transaction(transaction) => transaction,
        }
    }
}

impl<DB: Database> DerefMut for Held<DB> {
    fn deref_mut(&mut self) -> &mut DB::Connection {
        match self {
            Self::Pooled(connection) => connection,
            Self::Transaction(transaction) => transaction,
        }
    }
}

/// Where a statement runs.
pub(in crate::store) enum Target<'c> {
    Connection(&'c mut Connection),
    Pool(&'c Pool),
}

impl<'c> Target<'c> {
    /// The connection: the one that is given, or one of the pool.
    pub(super) async fn connection(self) -> Result<Given<'c>, sqlx::Error> {
        Ok(match self {
            Self::Connection(connection) => Given::Lent(connection),
            Self::Pool(pool) => Given::Own(pool.acquire().await?),
        })
    }
}

/// A connection for one statement.
pub(super) enum Given<'c> {
    Lent(&'c mut Connection),
    Own(Connection),
}

impl Deref for Given<'_> {
    type Target = Connection;

    fn deref(&self) -> &Connection {
        match self {
            Self::Lent(connection) => connection,
            Self::Own(connection) => connection,
        }
    }
}

impl DerefMut for Given<'_> {
    fn deref_mut(&mut self) -> &mut Connection {
        match self {
            Self::Lent(connection) => connection,
            Self::Own(connection) => connection,
        }
    }
}

impl<'c> From<&'c mut Connection> for Target<'c> {
    fn from(connection: &'c mut Connection) -> Self {
        Self::Connection(connection)
    }
}

impl<'c> From<&'c Pool> for Target<'c> {
    fn from(pool: &'c Pool) -> Self {
        Self::Pool(pool)
    }
}
