//! The outcomes of jobs.

use serde_json::Value;

use super::database;
use super::jobs::from_json;
use super::writer::Tx;
use super::{Store, StoreError};
use crate::job::{JobId, Status};

impl Store {
    /// The result of a job: final for one that succeeded, the best so far for one that was paused
    /// or cancelled, nothing before.
    pub async fn result(&self, job: JobId) -> Result<Option<Value>, StoreError> {
        let job = job.to_string();
        let outcome: Option<String> =
            database::query_scalar("select outcome from results where job = $1")
                .bind(&job)
                .fetch_optional(self.readers())
                .await?;
        outcome
            .map(|text| from_json("result", &job, &text))
            .transpose()
    }
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
    database::query(
        "insert into results (job, outcome) values ($1, $2) \
         on conflict (job) do update set outcome = excluded.outcome",
    )
    .bind(job.to_string())
    .bind(outcome.to_string())
    .execute(&mut **tx)
    .await?;
    Ok(())
}

/// Says in a result that a pause left that the job was then cancelled.
pub(super) async fn mark_cancelled(tx: &mut Tx, job: JobId) -> Result<(), StoreError> {
    let key = job.to_string();
    let outcome: Option<String> =
        database::query_scalar("select outcome from results where job = $1")
            .bind(&key)
            .fetch_optional(&mut **tx)
            .await?;
    match outcome {
        Some(outcome) => {
            let outcome = from_json("result", &key, &outcome)?;
            put(tx, job, outcome, Status::Cancelled).await
        }
        None => Ok(()),
    }
}
