//! Samples of a PostgreSQL: columns of a table, or the history of an Ignition gateway. Pages are copied out as CSV and
//! go to the server as they are.

mod ignition;
mod rows;
mod table;
mod time_column;

use std::path::Path;
use std::time::Duration;

use futures_util::TryStreamExt as _;
use sqlx::postgres::{PgConnectOptions, PgConnection};
use sqlx::{AssertSqlSafe, ConnectOptions as _, Row as _};
use tokio::sync::Mutex;
use url::Url;

use super::cursors::instant;
use super::document::SourcesTable;
use super::error::CollectError;
use super::page::{PageWriter, ReadStretch, SeriesPage};
use super::query::name;
use super::secret;
use super::series::{SourceColumn, SourceSeries};
use crate::store::postgres_options;
use rows::{RowsPlace, away, failure};

/// How long a page may take, with the connection where there is none yet.
const LONGEST_ANSWER: Duration = Duration::from_secs(120);
/// What each connection is told first: instants in UTC, every digit of a number, no right to write, and an end to
/// statements for which nobody waits any more.
const SESSION: &str = "SET TimeZone = 'UTC'; SET DateStyle = 'ISO'; SET extra_float_digits = 1; \
                       SET default_transaction_read_only = on; SET statement_timeout = '110s'; \
                       SET application_name = 'greybox collect'";

/// A PostgreSQL, with a connection that is made anew when it broke.
#[derive(Debug)]
pub struct Postgres {
    options: PgConnectOptions,
    is_ignition: bool,
    connection: Mutex<Option<PgConnection>>,
}

impl Postgres {
    /// Takes the entries of a source that say how a PostgreSQL is reached. Paths are seen from `folder`.
    pub(super) fn take(table: &mut SourcesTable, folder: &Path, is_ignition: bool) -> Option<Self> {
        let password = secret::take(table, "password", folder);
        let options = table.required("address", |table, key| table.parsed(key, address))?;
        let options = match &password {
            Some(password) => options.password(password.expose()),
            None => options,
        };
        Some(Self {
            options,
            is_ignition,
            connection: Mutex::default(),
        })
    }

    /// Rows of a series.
    pub(super) async fn read(
        &self,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        let mut held = self.connection.lock().await;
        let before = held.take();
        let reading = async {
            let mut connection = match before {
                Some(connection) => connection,
                None => self.connect().await?,
            };
            let page = self.page(&mut connection, series, stretch).await?;
            Ok::<_, CollectError>((connection, page))
        };
        let answered = tokio::time::timeout(LONGEST_ANSWER, reading).await;
        let silence = |_| {
            let seconds = LONGEST_ANSWER.as_secs();
            CollectError::SourceAway(format!("nothing came in {seconds} s"))
        };
        let (connection, page) = answered.map_err(silence)??;
        // A connection that failed is not asked again.
        *held = Some(connection);
        Ok(page)
    }

    async fn connect(&self) -> Result<PgConnection, CollectError> {
        let options = self.options.clone().disable_statement_logging();
        let mut connection = options.connect().await.map_err(away)?;
        let session = sqlx::raw_sql(SESSION).execute(&mut connection);
        session.await.map_err(away)?;
        Ok(connection)
    }

    async fn page(
        &self,
        connection: &mut PgConnection,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        let rows = match self.is_ignition {
            true => ignition::rows(connection, series, stretch).await?,
            false => table::rows(connection, series).await?,
        };
        let Some(rows) = rows else {
            return Ok(SeriesPage::default());
        };
        let RowsPlace {
            from,
            time,
            kind,
            conditions,
            ..
        } = &rows;
        let after = kind.value(stretch.between.start);
        let until = kind.value(stretch.between.end);
        let newest = kind.nanoseconds("max(t)");
        let bound = format!(
            "SELECT {newest} AS newest, count(*) AS count FROM (SELECT {time} AS t FROM {from} \
             WHERE {conditions}{time} > {after} AND {time} <= {until} ORDER BY {time} LIMIT {}) AS page",
            stretch.rows
        );
        let bound = sqlx::query(AssertSqlSafe(bound)).fetch_one(&mut *connection);
        let bound = bound.await.map_err(failure)?;
        let newest: Option<i64> = bound.try_get("newest").map_err(failure)?;
        let Some(newest) = newest else {
            return Ok(SeriesPage::default());
        };
        let newest = instant(newest);
        let cells: Vec<String> = rows.columns.iter().flat_map(cells).collect();
        // Rows of one instant are never parted: all of them are at or before the bound.
        let copy = format!(
            "COPY (SELECT {time}, {} FROM {from} WHERE {conditions}{time} > {after} AND {time} <= {} \
             ORDER BY {time}) TO STDOUT WITH (FORMAT csv)",
            cells.join(", "),
            kind.value(newest),
        );
        let mut writer = PageWriter::new(&series.columns);
        if let Some((option, text)) = kind.option() {
            writer.option(option, text);
        }
        let mut copied = connection.copy_out_raw(&copy).await.map_err(failure)?;
        while let Some(part) = copied.try_next().await.map_err(failure)? {
            writer.lines(&part);
        }
        let count: i64 = bound.try_get("count").map_err(failure)?;
        let page = writer.done();
        Ok(SeriesPage {
            rows: u64::try_from(count).unwrap_or_default(),
            newest: Some(newest),
            ..page
        })
    }
}

/// The address of a PostgreSQL, without a password in it.
fn address(text: &str) -> Result<PgConnectOptions, String> {
    let options = postgres_options(text).map_err(|error| format!("cannot be used: {error}"))?;
    let url: Option<Url> = text.parse().ok();
    let mut names = url.iter().flat_map(Url::query_pairs).map(|pair| pair.0);
    let has_password = url.as_ref().is_some_and(|url| url.password().is_some());
    match has_password || names.any(|name| name == "password") {
        true => Err("has no password in it; `password` says where one is".to_owned()),
        false => Ok(options),
    }
}

/// The cells of a column: its value, and its quality where the column has one.
fn cells(column: &SourceColumn) -> impl Iterator<Item = String> {
    let quality = column.quality.as_deref().map(name);
    std::iter::once(column.field.clone()).chain(quality)
}
