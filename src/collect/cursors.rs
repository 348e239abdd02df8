//! How far each series was brought, in a small SQLite beside the collector.

use std::path::Path;
use std::time::Duration;

use jiff::Timestamp;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{Row as _, SqlitePool};

/// How long another process may hold the file.
const LONGEST_WAIT: Duration = Duration::from_secs(10);

/// How far a series was brought.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeriesCursor {
    /// Samples up to this instant are in the stream.
    pub reached: Timestamp,
    /// When samples that came late were last looked for.
    pub looked_back: Timestamp,
}

/// The cursors of all series.
#[derive(Clone, Debug)]
pub struct Cursors(SqlitePool);

impl Cursors {
    /// Opens the file of cursors, and makes it where there is none.
    ///
    /// # Errors
    /// The file cannot be opened or is something else.
    pub async fn open(file: &Path) -> Result<Self, sqlx::Error> {
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .busy_timeout(LONGEST_WAIT);
        let pool = SqlitePoolOptions::new().max_connections(1);
        let pool = pool.connect_with(options).await?;
        sqlx::query(
            "CREATE TABLE IF NOT EXISTS cursors (source TEXT NOT NULL, series TEXT NOT NULL, \
             reached_ns INTEGER NOT NULL, looked_back_ns INTEGER NOT NULL, PRIMARY KEY (source, series)) STRICT",
        )
        .execute(&pool)
        .await?;
        Ok(Self(pool))
    }

    /// How far a series of a source was brought.
    pub(super) async fn find(
        &self,
        source: &str,
        series: &str,
    ) -> Result<Option<SeriesCursor>, sqlx::Error> {
        let row = sqlx::query(
            "SELECT reached_ns, looked_back_ns FROM cursors WHERE source = ? AND series = ?",
        )
        .bind(source)
        .bind(series)
        .fetch_optional(&self.0)
        .await?;
        let cursor = |row: sqlx::sqlite::SqliteRow| {
            Ok(SeriesCursor {
                reached: instant(row.try_get("reached_ns")?),
                looked_back: instant(row.try_get("looked_back_ns")?),
            })
        };
        row.map(cursor).transpose()
    }

    /// Moves the cursor of a series; the cursor is on disk when this comes back.
    pub(super) async fn put(
        &self,
        source: &str,
        series: &str,
        cursor: SeriesCursor,
    ) -> Result<(), sqlx::Error> {
        sqlx::query(
            "INSERT INTO cursors (source, series, reached_ns, looked_back_ns) VALUES (?, ?, ?, ?) \
             ON CONFLICT (source, series) DO UPDATE SET reached_ns = excluded.reached_ns, \
             looked_back_ns = excluded.looked_back_ns",
        )
        .bind(source)
        .bind(series)
        .bind(nanoseconds(cursor.reached))
        .bind(nanoseconds(cursor.looked_back))
        .execute(&self.0)
        .await?;
        Ok(())
    }
}

/// The instant of nanoseconds since 1970.
pub(super) fn instant(nanoseconds: i64) -> Timestamp {
    Timestamp::from_nanosecond(nanoseconds.into()).expect("64 bits of nanoseconds are an instant")
}

/// Nanoseconds since 1970; the nearest that 64 bits hold.
pub(super) fn nanoseconds(instant: Timestamp) -> i64 {
    let nanoseconds = instant.as_nanosecond();
    i64::try_from(nanoseconds).unwrap_or(if nanoseconds < 0 { i64::MIN } else { i64::MAX })
}
