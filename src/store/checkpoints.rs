//! Where unfinished jobs can go on.

use std::sync::Arc;

use super::database::{self, Target};
use super::sealed::CHECKPOINTS;
use super::shared_database::Database;
use super::writer::Tx;
use super::{StoreError, unsigned};
use greybox::identification::JobId;

/// Where a job can go on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checkpoint {
    /// The method's own state.
    pub state: Vec<u8>,
    /// Iterations of the refinement and looks at the chains of a posterior that went before it.
    pub refinements: u32,
}

/// Where unfinished jobs can go on.
#[derive(Clone)]
pub struct Checkpoints {
    pub(super) database: Arc<Database>,
}

impl Checkpoints {
    /// Where a job can go on.
    pub async fn find(&self, job: JobId) -> Result<Option<Checkpoint>, StoreError> {
        fetch(&self.database.readers, job).await
    }
}

pub(super) async fn fetch<'c>(
    on: impl Into<Target<'c>>,
    job: JobId,
) -> Result<Option<Checkpoint>, StoreError> {
    let job = job.to_string();
    let row =
        database::query("select job, state, refinements, seal from checkpoints where job = $1")
            .bind(&job)
            .fetch_optional(on)
            .await?;
    let Some(row) = row else {
        return Ok(None);
    };
    CHECKPOINTS.verify(&row)?;
    Ok(Some(Checkpoint {
        state: row.try_get("state")?,
        refinements: unsigned("checkpoint", &job, row.try_get("refinements")?)?,
    }))
}

/// Keeps where a job can go on; what happened before is no longer held against it.
pub(super) async fn put(
    tx: &mut Tx,
    job: JobId,
    checkpoint: &Checkpoint,
) -> Result<(), StoreError> {
    let job = job.to_string();
    let Checkpoint { state, refinements } = checkpoint;
    let parts = [(&job).into(), state.into(), (*refinements).into()];
    database::query(
        "insert into checkpoints (job, state, refinements, seal) values ($1, $2, $3, $4) \
         on conflict (job) do update set state = excluded.state, \
         refinements = excluded.refinements, seal = excluded.seal",
    )
    .bind(&job)
    .bind(state)
    .bind(*refinements)
    .bind(CHECKPOINTS.seal(&parts))
    .execute(&mut **tx)
    .await?;
    database::query("update jobs set attempt = 0, deaths = 0, at_work_in = null where id = $1")
        .bind(job)
        .execute(&mut **tx)
        .await?;
    Ok(())
}

/// Forgets where a job that has ended could have gone on.
pub(super) async fn forget(tx: &mut Tx, job: JobId) -> Result<(), StoreError> {
    database::query("delete from checkpoints where job = $1")
        .bind(job.to_string())
        .execute(&mut **tx)
        .await?;
    Ok(())
}
