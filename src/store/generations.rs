//! The history of a search: a row a generation, none left out.

use std::sync::Arc;

use super::StoreError;
use super::columns::{self, from_json};
use super::database::{self, QueryBuilder, Row};
use super::sealed::GENERATIONS;
use super::shared_database::Database;
use super::writer::Tx;
use crate::job::GenerationEvent;
use greybox::identification::JobId;

/// Rows in one statement; SQLite takes 32766 values in one.
const ROWS_PER_STATEMENT: usize = 1000;

/// The generations of searches.
#[derive(Clone)]
pub struct Generations {
    pub(super) database: Arc<Database>,
}

impl Generations {
    /// Generations of a job above `after`, in order, at most `limit`.
    pub async fn after(
        &self,
        job: JobId,
        after: u32,
        limit: u32,
    ) -> Result<Vec<GenerationEvent>, StoreError> {
        let rows = database::query(
            "select job, generation, row, seal from generations where job = $1 and generation > $2 \
             order by generation limit $3",
        )
        .bind(job.to_string())
        .bind(after)
        .bind(limit)
        .fetch_all(&self.database.readers)
        .await?;
        rows.iter().map(read).collect()
    }
}

/// The generation of a row.
pub(super) fn read(row: &Row) -> Result<GenerationEvent, StoreError> {
    GENERATIONS.verify(row)?;
    from_json("generation", row.try_get("job")?, row.try_get("row")?)
}

/// Writes generations. One that is done again after a crash came to the same row.
pub(super) async fn insert(
    tx: &mut Tx,
    job: JobId,
    generations: &[GenerationEvent],
) -> Result<(), StoreError> {
    let job = job.to_string();
    for rows in generations.chunks(ROWS_PER_STATEMENT) {
        let mut query = QueryBuilder::new("insert into generations (job, generation, row, seal) ");
        query.push_values(rows, |mut row, generation| {
            let (number, json) = (generation.generation, columns::json(generation));
            let seal = GENERATIONS.seal(&[(&job).into(), number.into(), (&json).into()]);
            row.push_bind(job.clone())
                .push_bind(number)
                .push_bind(json)
                .push_bind(seal);
        });
        query.push(
            " on conflict (job, generation) do update set row = excluded.row, seal = excluded.seal",
        );
        // Each number of rows is another statement; they are not worth keeping.
        query.build().persistent(false).execute(&mut **tx).await?;
    }
    Ok(())
}
