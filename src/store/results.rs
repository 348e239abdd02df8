//! The outcomes of jobs.

use std::sync::Arc;

use serde::de::IgnoredAny;

use super::StoreError;
use super::columns::{from_json, json};
use super::database::{self, Target};
use super::sealed::RESULTS;
use super::shared_database::Database;
use super::writer::Tx;
use crate::job::{ResultOfJob, Status};
use greybox::estimation::StopReason;
use greybox::identification::design::Design;
use greybox::identification::selection::Selection;
use greybox::identification::{JobId, Outcome};

/// The results of jobs.
#[derive(Clone)]
pub struct Results {
    pub(super) database: Arc<Database>,
}

impl Results {
    /// The result of a job: final for one that succeeded, the best so far for one that was paused
    /// or cancelled, nothing before.
    pub async fn find(&self, job: JobId) -> Result<Option<StoredResult>, StoreError> {
        fetch(&self.database.readers, job).await
    }
}

/// The result of a job as the program that wrote it left it, maybe an older one.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredResult(String);

impl StoredResult {
    /// The stored JSON, which clients are answered unchanged.
    #[must_use]
    pub fn into_json(self) -> String {
        self.0
    }

    /// The result of an identification.
    ///
    /// # Errors
    /// The result is that of a design, or lacks what every result has today.
    pub fn outcome(&self) -> Result<Outcome, serde_json::Error> {
        serde_json::from_str(&self.0)
    }

    /// The result of a design.
    ///
    /// # Errors
    /// The result is that of an identification, or lacks what every design has today.
    pub fn design(&self) -> Result<Design, serde_json::Error> {
        serde_json::from_str(&self.0)
    }

    /// The result of a selection.
    ///
    /// # Errors
    /// The result is that of another kind of job, or lacks what every selection has today.
    pub fn selection(&self) -> Result<Selection, serde_json::Error> {
        serde_json::from_str(&self.0)
    }
}

async fn fetch<'c>(
    on: impl Into<Target<'c>>,
    job: JobId,
) -> Result<Option<StoredResult>, StoreError> {
    let job = job.to_string();
    let row = database::query("select job, outcome, seal from results where job = $1")
        .bind(&job)
        .fetch_optional(on)
        .await?;
    let Some(row) = row else {
        return Ok(None);
    };
    RESULTS.verify(&row)?;
    let json: String = row.try_get("outcome")?;
    from_json::<IgnoredAny>("result", &job, &json)?;
    Ok(Some(StoredResult(json)))
}

/// Writes the result of a job that comes to a state; one that a pause left is replaced. A result of a job
/// that was paused or cancelled says so, whatever the computation came to before it learned of that.
pub(super) async fn put(
    tx: &mut Tx,
    job: JobId,
    mut result: ResultOfJob,
    status: Status,
) -> Result<(), StoreError> {
    let asked = match status {
        Status::Paused => Some(StopReason::Paused),
        Status::Cancelled => Some(StopReason::Cancelled),
        _ => None,
    };
    // The results of other kinds do not say why the job ended.
    if let (Some(asked), ResultOfJob::Identification(outcome)) = (asked, &mut result) {
        outcome.stop_reason = asked;
    }
    let (job, outcome) = (job.to_string(), json(&result));
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
    let stored = match fetch(&mut **tx, job).await {
        // The job is cancelled all the same; whoever asks for the result is told of the damage.
        Err(error) if error.corrupt_row().is_some() => None,
        stored => stored?,
    };
    match stored.and_then(|stored| stored.outcome().ok()) {
        Some(outcome) => {
            let result = ResultOfJob::Identification(Box::new(outcome));
            put(tx, job, result, Status::Cancelled).await
        }
        None => Ok(()),
    }
}
