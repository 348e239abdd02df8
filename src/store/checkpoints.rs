//! Where unfinished jobs can go on.

use super::database::{self, Target};
use super::writer::Tx;
use super::{Store, StoreError};
use crate::job::JobId;

/// Where a job can go on.
#[derive(Clone, Debug, PartialEq, Eq, sqlx::FromRow)]
pub struct Checkpoint {
    /// The method's own state.
    pub state: Vec<u8>,
    /// Iterations of the refinement that went before it.
    #[sqlx(try_from = "i64")]
    pub refinements: u32,
}

impl Store {
    /// Where a job can go on.
    pub async fn checkpoint(&self, job: JobId) -> Result<Option<Checkpoint>, StoreError> {
        fetch(self.readers(), job).await
    }
}

pub(super) async fn fetch<'c>(
    on: impl Into<Target<'c>>,
    job: JobId,
) -> Result<Option<Checkpoint>, StoreError> {
    let checkpoint =
        database::query_as("select state, refinements from checkpoints where job = $1")
            .bind(job.to_string())
            .fetch_optional(on)
            .await?;
    Ok(checkpoint)
}

/// Keeps where a job can go on; what happened before is no longer held against it.
pub(super) async fn put(
    tx: &mut Tx,
    job: JobId,
    checkpoint: &Checkpoint,
) -> Result<(), StoreError> {
    database::query(
        "insert into checkpoints (job, state, refinements) values ($1, $2, $3) \
         on conflict (job) do update set state = excluded.state, \
         refinements = excluded.refinements",
    )
    .bind(job.to_string())
    .bind(&checkpoint.state)
    .bind(checkpoint.refinements)
    .execute(&mut **tx)
    .await?;
    database::query("update jobs set attempt = 0, deaths = 0, at_work_in = null where id = $1")
        .bind(job.to_string())
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
