//! The outcomes of jobs.

use std::sync::Arc;

use serde_json::Value;

use super::StoreError;
use super::columns::from_json;
use super::database::{self, Target};
use super::sealed::RESULTS;
use super::shared_database::Database;
use super::writer::Tx;
use crate::job::Status;
use greybox::identification::JobId;

/// The results of jobs.
#[derive(Clone)]
pub struct Results {
    pub(super) database: Arc<Database>,
}

impl Results {
    /// The result of a job: final for one that succeeded, the best so far for one that was paused
    /// or cancelled, nothing before.
    pub async fn find(&self, job: JobId) -> Result<Option<Value>, StoreError> {
        fetch(&self.database.readers, job).await
    }
}

async fn fetch<'c>(on: impl Into<Target<'c>>, job: JobId) -> Result<Option<Value>, StoreError> {
    let job = job.to_string();
    let row = database::query("select job, outcome, seal from results where job = $1")
        .bind(&job)
        .fetch_optional(on)
        .await?;
    let Some(row) = row else {
        return Ok(None);
    };
    RESULTS.verify(&row)?;
    from_json("result", &job, row.try_get("outcome")?).map(Some)
}

/// Writes the result of a job that comes to a state; one that a pause left is replaced. A result of a job
/// that was paused or cancelled says so, whatever the computation came to before it learned of that.
pub(super) async fn put(
    tx: &mut Tx,
    job: JobId,
    mut outcome: Value,
    status: Status,
) -> Result<(), StoreError> {
    // The result of a design does not say why the design ended.
    if let (Status::Paused | Status::Cancelled, Some(reason)) =
        (status, outcome.get_mut("stop_reason"))
    {
        *reason = status.as_str().into();
    }
    let (job, outcome) = (job.to_string(), outcome.to_string());
    let seal = RESULTS.seal(&[(&job).into(), (&outcome).into()]);
    database::query(
        "insert into results (job, outcome, seal) values ($1, $2, $3) \
         on conflict (job) do update set outcome = excluded.outcome, seal = excluded.seal",
    )
    .bind(job)
    .bind(outcome)
    .bind(seal)
    .execute(&mut **tx)
    .await?;
    Ok(())
}

/// Says in a result that a pause left that the job was then cancelled.
pub(super) async fn mark_cancelled(tx: &mut Tx, job: JobId) -> Result<(), StoreError> {
    let outcome = match fetch(&mut **tx, job).await {
        // The job is cancelled all the same; whoever asks for the result is told of the damage.
        Err(error) if error.corrupt_row().is_some() => None,
        outcome => outcome?,
    };
    match outcome {
        Some(outcome) => put(tx, job, outcome, Status::Cancelled).await,
        None => Ok(()),
    }
}
