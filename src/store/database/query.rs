//! A statement with its values, and what it is asked for.

use std::marker::PhantomData;
use std::ops::DerefMut as _;

use futures_util::stream::BoxStream;
use futures_util::{StreamExt, TryStreamExt};
use sqlx::{AssertSqlSafe, Database, Postgres, SqlSafeStr, SqlStr, Sqlite};

use super::value::arguments;
use super::{Connection, Pool, Record, Row, Target, Value};

/// A statement that is made when it is needed says so by being another type than a literal.
pub(in crate::store) struct Query {
    sql: SqlStr,
    values: Vec<Value>,
    persistent: bool,
}

/// A statement whose rows are not read, or column by column.
pub(in crate::store) fn query(sql: &'static str) -> Query {
    Query::of(sql.into_sql_str(), Vec::new())
}

/// A statement whose rows are read into a type.
pub(in crate::store) fn query_as<T: Record>(sql: &'static str) -> QueryAs<T> {
    query(sql).read_as()
}

/// A statement whose rows have one column.
pub(in crate::store) fn query_scalar<T>(sql: &'static str) -> QueryScalar<T>
where
    (T,): Record,
{
    query(sql).read_scalar()
}

type Prepared<DB> = sqlx::query::Query<'static, DB, <DB as Database>::Arguments>;

impl Query {
    fn of(sql: SqlStr, values: Vec<Value>) -> Self {
        Self {
            sql,
            values,
            persistent: true,
        }
    }

    /// A statement that was put together; whoever did so kept what comes from outside among the
    /// values.
    pub(super) fn made(sql: String, values: Vec<Value>) -> Self {
        Self::of(AssertSqlSafe(sql).into_sql_str(), values)
    }

    /// Gives the next place its value.
    #[must_use]
    pub(in crate::store) fn bind(mut self, value: impl Into<Value>) -> Self {
        self.values.push(value.into());
        self
    }

    /// Whether the connection keeps the statement for the next time.
    #[must_use]
    pub(in crate::store) fn persistent(self, persistent: bool) -> Self {
        Self { persistent, ..self }
    }

    pub(super) fn read_as<T: Record>(self) -> QueryAs<T> {
        QueryAs {
            query: self,
            record: PhantomData,
        }
    }

    pub(super) fn read_scalar<T>(self) -> QueryScalar<T>
    where
        (T,): Record,
    {
        QueryScalar(self.read_as())
    }

    fn sqlite(self) -> Result<Prepared<Sqlite>, sqlx::Error> {
        let arguments = arguments::<Sqlite>(self.values).map_err(sqlx::Error::Encode)?;
        Ok(sqlx::query_with(self.sql, arguments).persistent(self.persistent))
    }

    fn postgres(self) -> Result<Prepared<Postgres>, sqlx::Error> {
        let arguments = arguments::<Postgres>(self.values).map_err(sqlx::Error::Encode)?;
        Ok(sqlx::query_with(self.sql, arguments).persistent(self.persistent))
    }

    /// Runs it and says how many rows it changed.
    pub(in crate::store) async fn execute<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<u64, sqlx::Error> {
        Ok(match on.into().connection().await?.deref_mut() {
            Connection::Sqlite(connection) => {
                let done = self.sqlite()?.execute(&mut **connection).await?;
                done.rows_affected()
            }
            Connection::Postgres(connection, losses) => {
                let statement = self.postgres()?;
                let done = losses
                    .unless_lost(statement.execute(&mut **connection))
                    .await?;
                done.rows_affected()
            }
        })
    }

    /// All rows.
    pub(in crate::store) async fn fetch_all<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<Vec<Row>, sqlx::Error> {
        Ok(match on.into().connection().await?.deref_mut() {
            Connection::Sqlite(connection) => {
                let rows = self.sqlite()?.fetch_all(&mut **connection).await?;
                rows.into_iter().map(Row::Sqlite).collect()
            }
            Connection::Postgres(connection, losses) => {
                let statement = self.postgres()?;
                let rows = losses
                    .unless_lost(statement.fetch_all(&mut **connection))
                    .await?;
                rows.into_iter().map(Row::Postgres).collect()
            }
        })
    }

    /// The first row, if there is one.
    pub(in crate::store) async fn fetch_optional<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<Option<Row>, sqlx::Error> {
        Ok(match on.into().connection().await?.deref_mut() {
            Connection::Sqlite(connection) => {
                let row = self.sqlite()?.fetch_optional(&mut **connection).await?;
                row.map(Row::Sqlite)
            }
            Connection::Postgres(connection, losses) => {
                let statement = self.postgres()?;
                let row = losses
                    .unless_lost(statement.fetch_optional(&mut **connection))
                    .await?;
                row.map(Row::Postgres)
            }
        })
    }

    /// The first row; an error where there is none.
    pub(in crate::store) async fn fetch_one<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<Row, sqlx::Error> {
        self.fetch_optional(on)
            .await?
            .ok_or(sqlx::Error::RowNotFound)
    }

    /// The rows as they come.
    pub(in crate::store) fn fetch(self, pool: &Pool) -> BoxStream<'_, Result<Row, sqlx::Error>> {
        let rows = match pool {
            Pool::Sqlite(pool) => {
                let query = self.sqlite();
                query.map(|query| query.fetch(pool).map_ok(Row::Sqlite).boxed())
            }
            Pool::Postgres(pool, _) => {
                let query = self.postgres();
                query.map(|query| query.fetch(pool).map_ok(Row::Postgres).boxed())
            }
        };
        rows.unwrap_or_else(|error| futures_util::stream::once(async { Err(error) }).boxed())
    }
}

/// A statement whose rows are read into `T`.
pub(in crate::store) struct QueryAs<T> {
    query: Query,
    record: PhantomData<fn() -> T>,
}

impl<T: Record> QueryAs<T> {
    /// Gives the next place its value.
    #[must_use]
    pub(in crate::store) fn bind(self, value: impl Into<Value>) -> Self {
        self.query.bind(value).read_as()
    }

    /// All rows.
    pub(in crate::store) async fn fetch_all<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<Vec<T>, sqlx::Error> {
        let rows = self.query.fetch_all(on).await?;
        rows.iter().map(Row::read).collect()
    }

    /// The first row, if there is one.
    pub(in crate::store) async fn fetch_optional<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<Option<T>, sqlx::Error> {
        let row = self.query.fetch_optional(on).await?;
        row.map(|row| row.read()).transpose()
    }

    /// The first row; an error where there is none.
    pub(in crate::store) async fn fetch_one<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<T, sqlx::Error> {
        self.query.fetch_one(on).await?.read()
    }
}

/// A statement whose rows have one column.
pub(in crate::store) struct QueryScalar<T>(QueryAs<(T,)>)
where
    (T,): Record;

impl<T> QueryScalar<T>
where
    (T,): Record,
{
    /// Gives the next place its value.
    #[must_use]
    pub(in crate::store) fn bind(self, value: impl Into<Value>) -> Self {
        Self(self.0.bind(value))
    }

    /// The column of all rows.
    pub(in crate::store) async fn fetch_all<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<Vec<T>, sqlx::Error> {
        let rows = self.0.fetch_all(on).await?;
        Ok(rows.into_iter().map(|(value,)| value).collect())
    }

    /// The column of the first row, if there is one.
    pub(in crate::store) async fn fetch_optional<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<Option<T>, sqlx::Error> {
        Ok(self.0.fetch_optional(on).await?.map(|(value,)| value))
    }

    /// The column of the first row; an error where there is none.
    pub(in crate::store) async fn fetch_one<'c>(
        self,
        on: impl Into<Target<'c>>,
    ) -> Result<T, sqlx::Error> {
        Ok(self.0.fetch_one(on).await?.0)
    }
}
