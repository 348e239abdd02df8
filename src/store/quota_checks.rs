//! Whether a project has as much as it may. It is counted in the transaction that adds to it.

use std::collections::HashMap;
use std::time::Duration;

use jiff::{Timestamp, ToSpan, civil::Date, tz::TimeZone};

use super::writer::Tx;
use super::{QuotaExceeded, StoreError, StoredBytes, database};
use crate::access::Project;

/// What is left for new jobs, of each project that asked.
#[derive(Default)]
pub(super) struct JobRoom(HashMap<Project, Result<u64, QuotaExceeded>>);

impl JobRoom {
    /// Takes room for so many more jobs of a project, all of them or none.
    pub(super) async fn take(
        &mut self,
        tx: &mut Tx,
        project: &Project,
        jobs: u64,
    ) -> Result<Result<(), QuotaExceeded>, StoreError> {
        let left = match self.0.get(project) {
            Some(left) => *left,
            None => job_room(tx, project).await?,
        };
        let taken = left.and_then(|left| {
            let limit = tx.quotas.unfinished_jobs;
            let rest = left.checked_sub(jobs);
            rest.ok_or(QuotaExceeded::UnfinishedJobs(limit))
        });
        let left = taken.or(left);
        self.0.insert(project.clone(), left);
        Ok(taken.map(drop))
    }
}

async fn job_room(
    tx: &mut Tx,
    project: &Project,
) -> Result<Result<u64, QuotaExceeded>, StoreError> {
    let quotas = tx.quotas;
    if let Some(limit) = quotas.work_per_day {
        let now = Timestamp::now();
        let worked = worked_on(tx, project, day_of(now)).await?;
        if worked >= limit {
            return Ok(Err(QuotaExceeded::Work {
                limit_s: limit.as_secs(),
                until: end_of_day(now),
            }));
        }
    }
    let limit = quotas.stored_bytes;
    if limit < u64::MAX {
        let has = stored_bytes(tx, project).await?;
        if has.total() >= limit {
            return Ok(Err(QuotaExceeded::StoredForJobs { has, limit }));
        }
    }
    if quotas.unfinished_jobs == u64::MAX {
        return Ok(Ok(u64::MAX));
    }
    let unfinished: i64 = database::query_scalar(
        "select count(*) from jobs where project = $1 \
         and status in ('queued', 'running', 'paused')",
    )
    .bind(project.as_str())
    .fetch_one(&mut **tx)
    .await?;
    Ok(Ok(quotas
        .unfinished_jobs
        .saturating_sub(unfinished.unsigned_abs())))
}

/// Whether a project has room for one more recording of so many bytes.
pub(super) async fn check_dataset(
    tx: &mut Tx,
    project: &Project,
    adds: u64,
) -> Result<(), StoreError> {
    let datasets: i64 = database::query_scalar("select count(*) from datasets where project = $1")
        .bind(project.as_str())
        .fetch_one(&mut **tx)
        .await?;
    let limit = tx.quotas.datasets;
    if datasets.unsigned_abs() >= limit {
        return Err(QuotaExceeded::Datasets(limit).into());
    }
    check_bytes(tx, project, adds).await
}

/// Whether a project has room for so many bytes more of samples.
pub(super) async fn check_bytes(
    tx: &mut Tx,
    project: &Project,
    adds: u64,
) -> Result<(), StoreError> {
    let limit = tx.quotas.stored_bytes;
    if limit == u64::MAX {
        return Ok(());
    }
    let has = stored_bytes(tx, project).await?;
    if has.total().saturating_add(adds) > limit {
        return Err(QuotaExceeded::Stored { has, adds, limit }.into());
    }
    Ok(())
}

/// What is kept of a project, as triggers of the database count it.
async fn stored_bytes(tx: &mut Tx, project: &Project) -> Result<StoredBytes, StoreError> {
    let stored: Option<StoredBytes> =
        database::query_as("select samples, jobs, keys from stored_bytes where project = $1")
            .bind(project.as_str())
            .fetch_optional(&mut **tx)
            .await?;
    Ok(stored.unwrap_or_default())
}

/// Adds the time that a slice of a job was at work to that of its project.
pub(super) async fn note_work(tx: &mut Tx, job: &str, worked_ms: u64) -> Result<(), StoreError> {
    database::query(
        "insert into project_days (project, day, worked_ms) \
         select project, $1, $2 from jobs where id = $3 \
         on conflict (project, day) do update \
         set worked_ms = project_days.worked_ms + excluded.worked_ms",
    )
    .bind(day_of(Timestamp::now()).to_string())
    .bind(i64::try_from(worked_ms).unwrap_or(i64::MAX))
    .bind(job)
    .execute(&mut **tx)
    .await?;
    Ok(())
}

async fn worked_on(tx: &mut Tx, project: &Project, day: Date) -> Result<Duration, StoreError> {
    let worked_ms: Option<i64> = database::query_scalar(
        "select worked_ms from project_days where project = $1 and day = $2",
    )
    .bind(project.as_str())
    .bind(day.to_string())
    .fetch_optional(&mut **tx)
    .await?;
    Ok(Duration::from_millis(worked_ms.unwrap_or(0).unsigned_abs()))
}

fn day_of(at: Timestamp) -> Date {
    at.to_zoned(TimeZone::UTC).date()
}

fn end_of_day(at: Timestamp) -> Timestamp {
    let next = day_of(at).saturating_add(1.day());
    let midnight = next.to_zoned(TimeZone::UTC);
    midnight.map_or(at, |midnight| midnight.timestamp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_day_ends_at_midnight() {
        let at: Timestamp = "2026-03-01T23:59:58.5Z".parse().expect("a time");
        let exceeded = QuotaExceeded::Work {
            limit_s: 3600,
            until: end_of_day(at),
        };
        assert_eq!(exceeded.retry_after(at), Some(Duration::from_millis(1500)));
        let told = exceeded.to_string();
        assert!(told.contains("2026-03-02T00:00:00Z"), "{told}");
    }
}
