//! The events of jobs, as they are stored and replayed.

use std::sync::Arc;

use super::StoreError;
use super::database::{self, QueryBuilder, Row};
use super::sealed::{EVENTS, Sealed};
use super::shared_database::Database;
use super::writer::Tx;
use crate::job::Event;
use greybox::identification::JobId;

/// Rows in one statement; SQLite takes 32766 values in one.
const ROWS_PER_STATEMENT: usize = 1000;

/// An event as it is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredEvent {
    /// 1, 2, 3 … without a gap.
    pub id: i64,
    /// `state`, `generation`, `refinement`, `result` or `end`.
    pub name: String,
    /// One line of JSON.
    pub data: String,
}

impl StoredEvent {
    /// Whether nothing follows.
    pub fn is_last(&self) -> bool {
        self.name == "end"
    }
}

/// The events of jobs.
#[derive(Clone)]
pub struct JobEvents {
    pub(super) database: Arc<Database>,
}

impl JobEvents {
    /// Events of a job with an id above `after`, in order, at most `limit`.
    ///
    /// # Errors
    /// One of them is damaged, or the database fails.
    pub async fn after(
        &self,
        job: JobId,
        after: i64,
        limit: u32,
    ) -> Result<Vec<StoredEvent>, StoreError> {
        let rows = database::query(
            "select job, id, name, data, seal from events where job = $1 and id > $2 \
             order by id limit $3",
        )
        .bind(job.to_string())
        .bind(after)
        .bind(limit)
        .fetch_all(&self.database.readers)
        .await?;
        read(&EVENTS, &rows)
    }
}

/// The events of rows of a table.
pub(super) fn read(of: &Sealed, rows: &[Row]) -> Result<Vec<StoredEvent>, StoreError> {
    let events = rows.iter().map(|row| {
        of.verify(row)?;
        Ok(StoredEvent {
            id: row.try_get("id")?,
            name: row.try_get("name")?,
            data: row.try_get("data")?,
        })
    });
    events.collect()
}

/// Writes events with the ids from `first` on. The caller moves `jobs.last_event`.
pub(super) async fn insert(
    tx: &mut Tx,
    job: JobId,
    first: i64,
    events: &[Event],
) -> Result<(), StoreError> {
    let job = job.to_string();
    let mut rows = (first..).zip(events).peekable();
    while rows.peek().is_some() {
        let mut query = QueryBuilder::new("insert into events (job, id, name, data, seal) ");
        query.push_values(
            rows.by_ref().take(ROWS_PER_STATEMENT),
            |mut row, (id, event)| {
                let (name, data) = (event.name(), event.data());
                let seal = seal(&job, id, (name, &data));
                row.push_bind(job.clone())
                    .push_bind(id)
                    .push_bind(name)
                    .push_bind(data)
                    .push_bind(seal);
            },
        );
        query.build().execute(&mut **tx).await?;
    }
    Ok(())
}

/// The seal of an event of a job, which has a name and data.
pub(super) fn seal(job: &str, id: i64, (name, data): (&str, &str)) -> i64 {
    EVENTS.seal(&[job.into(), id.into(), name.into(), data.into()])
}
