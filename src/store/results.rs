//! The outcomes of jobs.

use serde_json::Value;

use super::jobs::from_json;
use super::writer::Tx;
use super::{Store, StoreError};
use crate::job::JobId;

impl Store {
    /// The result of a job: final for one that succeeded, the best so far for one that was paused
    /// or cancelled, nothing before.
    pub async fn result(&self, job: JobId) -> Result<Option<Value>, StoreError> {
        let job = job.to_string();
        let outcome: Option<String> =
            sqlx::query_scalar("select outcome from results where job = ?")
                .bind(&job)
                .fetch_optional(self.readers())
                .await?;
        outcome
            .map(|text| from_json("result", &job, &text))
            .transpose()
    }
}

/// Writes the result; one that a pause left is replaced.
pub(super) async fn put(tx: &mut Tx, job: JobId, outcome: &Value) -> Result<(), StoreError> {
    sqlx::query("insert or replace into results (job, outcome) values (?, ?)")
        .bind(job.to_string())
        .bind(outcome.to_string())
        .execute(&mut **tx)
        .await?;
    Ok(())
}

/// Says in a result that a pause left that the job was then cancelled.
pub(super) async fn mark_cancelled(tx: &mut Tx, job: JobId) -> Result<(), StoreError> {
    sqlx::query(
        "update results set outcome = json_set(outcome, '$.stop_reason', 'cancelled') \
         where job = ?",
    )
    .bind(job.to_string())
    .execute(&mut **tx)
    .await?;
    Ok(())
}
