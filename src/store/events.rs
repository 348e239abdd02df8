//! The events of jobs, as they are stored and replayed.

use super::database::{self, QueryBuilder};
use super::writer::Tx;
use super::{Store, StoreError};
use crate::job::{Event, JobId};

/// Rows in one statement; SQLite takes 32766 values in one.
const ROWS_PER_STATEMENT: usize = 1000;

/// An event as it is sent.
#[derive(Clone, Debug, PartialEq, Eq, sqlx::FromRow)]
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

impl Store {
    /// Events of a job with an id above `after`, in order, at most `limit`.
    pub async fn events_after(
        &self,
        job: JobId,
        after: i64,
        limit: u32,
    ) -> Result<Vec<StoredEvent>, StoreError> {
        Ok(database::query_as(
            "select id, name, data from events where job = $1 and id > $2 order by id limit $3",
        )
        .bind(job.to_string())
        .bind(after)
        .bind(limit)
        .fetch_all(self.readers())
        .await?)
    }
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
        let mut query = QueryBuilder::new("insert into events (job, id, name, data) ");
        query.push_values(
            rows.by_ref().take(ROWS_PER_STATEMENT),
            |mut row, (id, event)| {
                row.push_bind(job.clone())
                    .push_bind(id)
                    .push_bind(event.name())
                    .push_bind(event.data());
            },
        );
        query.build().execute(&mut **tx).await?;
    }
    Ok(())
}
