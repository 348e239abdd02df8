//! What several nodes do of one job together: the parts that each has done, for all of them.

use std::sync::Arc;

use super::columns;
use super::database::{self, QueryBuilder};
use super::sealed::SHARED_PARTS;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError};
use greybox::identification::JobId;

/// Parts that are written with one statement.
const TOGETHER: usize = 100;

/// A part of a job's work that nodes share, by its name, with its result in JSON.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SharedPart {
    /// The name of the part: what was to be done.
    pub name: String,
    /// The result of the part, in JSON.
    pub part: String,
}

/// Parts of jobs that several nodes work together.
#[derive(Clone)]
pub struct WorkShares {
    pub(super) database: Arc<Database>,
}

impl WorkShares {
    /// A job that another node works and this one can help with, but for those that it should not.
    pub async fn job_to_help(&self, but: &[JobId]) -> Result<Option<JobId>, StoreError> {
        let ids: Vec<String> = database::query_scalar(
            "select id from jobs where is_shared = 1 and status = 'running' and request is null \
             and at_work_in <> $1 order by id limit 100",
        )
        .bind(self.database.life)
        .fetch_all(&self.database.readers)
        .await?;
        for id in ids {
            let id = columns::parse_id(&id)?;
            if !but.contains(&id) {
                return Ok(Some(id));
            }
        }
        Ok(None)
    }

    /// The parts of a job that were written after the one with a number, and the last number. Those that are
    /// damaged are left out: whoever needs one does it again.
    pub async fn after(
        &self,
        job: JobId,
        after: i64,
    ) -> Result<(Vec<SharedPart>, i64), StoreError> {
        let rows = database::query(
            "select job, number, name, part, seal from shared_parts \
             where job = $1 and number > $2 order by number",
        )
        .bind(job.to_string())
        .bind(after)
        .fetch_all(&self.database.readers)
        .await?;
        let last = rows.last().map_or(Ok(after), |row| row.try_get("number"))?;
        let mut parts = Vec::with_capacity(rows.len());
        for row in &rows {
            if let Err(error) = SHARED_PARTS.verify(row) {
                self.database.damage.note(&error);
                tracing::warn!(%error, "what another node has done is not used");
                continue;
            }
            let (name, part) = (row.try_get("name")?, row.try_get("part")?);
            parts.push(SharedPart { name, part });
        }
        Ok((parts, last))
    }

    /// Writes what was done for the node that works a job; says whether help is still wanted.
    pub async fn help_with(&self, job: JobId, parts: Vec<SharedPart>) -> Result<bool, StoreError> {
        in_transaction!(self.database, |tx| help_with(tx, job, parts)).await
    }
}

async fn help_with(tx: &mut Tx, job: JobId, parts: Vec<SharedPart>) -> Result<bool, StoreError> {
    let goes_on: bool = database::query_scalar(
        "select exists (select 1 from jobs where id = $1 and is_shared = 1)",
    )
    .bind(job.to_string())
    .fetch_one(&mut **tx)
    .await?;
    if goes_on {
        insert(tx, job, &parts).await?;
    }
    Ok(goes_on)
}

/// Writes parts; of one that another node has done too the first stays, which will do as well.
pub(super) async fn insert(
    tx: &mut Tx,
    job: JobId,
    parts: &[SharedPart],
) -> Result<(), StoreError> {
    let job_text = job.to_string();
    for some in parts.chunks(TOGETHER) {
        let mut query = QueryBuilder::new("insert into shared_parts (job, name, part, seal) ");
        query.push_values(some, |mut row, part| {
            let SharedPart { name, part } = part;
            let seal = SHARED_PARTS.seal(&[(&job_text).into(), name.into(), part.into()]);
            row.push_bind(&job_text)
                .push_bind(name)
                .push_bind(part)
                .push_bind(seal);
        });
        query.push(" on conflict (job, name) do nothing");
        query.build().execute(&mut **tx).await?;
    }
    Ok(())
}

/// Says whether other nodes may help with a job.
pub(super) async fn set_shared(tx: &mut Tx, job: JobId, is_shared: bool) -> Result<(), StoreError> {
    let changed =
        database::query("update jobs set is_shared = $1 where id = $2 and is_shared <> $1")
            .bind(i64::from(is_shared))
            .bind(job.to_string())
            .execute(&mut **tx)
            .await?;
    if changed > 0 && is_shared {
        tx.announce(Change::HelpWanted);
    }
    Ok(())
}

/// Forgets the parts of a job that has ended.
pub(super) async fn forget(tx: &mut Tx, job: JobId) -> Result<(), StoreError> {
    database::query("delete from shared_parts where job = $1")
        .bind(job.to_string())
        .execute(&mut **tx)
        .await?;
    Ok(())
}
