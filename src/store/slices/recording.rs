//! Writes what a slice did, while it goes on and when it hands its job on.

use std::time::Duration;

use super::slice::{HandedOn, Hold, Lease, Record};
use crate::store::writer::Tx;
use crate::store::{
    Change, StoreError, candidates, checkpoints, columns, database, events, generations, queue,
    quota_checks, work_shares,
};
use greybox::identification::JobId;

pub(super) async fn hand_on(
    tx: &mut Tx,
    (lease, record): (Lease, Record),
    must: bool,
) -> Result<HandedOn, StoreError> {
    if write_record(tx, lease, record).await? == Hold::Lost {
        return Ok(HandedOn::Lost);
    }
    if !must && !queue::is_waited_for(tx).await? {
        return Ok(HandedOn::Stays);
    }
    queue_again(tx, lease.job).await?;
    Ok(HandedOn::ToTheQueue)
}

/// Has the next slice of a job wait in the queue.
pub(super) async fn queue_again(tx: &mut Tx, job: JobId) -> Result<(), StoreError> {
    let id = job.to_string();
    let project: String = database::query_scalar("select project from jobs where id = $1")
        .bind(&id)
        .fetch_one(&mut **tx)
        .await?;
    queue::renew(tx, job, &columns::project(&id, &project)?).await
}

pub(super) async fn write_record(
    tx: &mut Tx,
    lease: Lease,
    record: Record,
) -> Result<Hold, StoreError> {
    let last_event: Option<i64> = database::query_scalar(
        "update jobs set last_event = last_event + $1, revision = revision + 1, \
         running_ms = running_ms + $2, \
         told_generation = $3, told_refinements = $4, told_at_ms = $5, \
         progress = coalesce($6, progress) \
         where id = $7 and epoch = $8 and status = 'running' returning last_event",
    )
    .bind(i64::try_from(record.events.len()).expect("a record is small"))
    .bind(i64::try_from(record.worked_ms).unwrap_or(i64::MAX))
    .bind(record.reported.generation)
    .bind(record.reported.refinements)
    .bind(record.reported.at_ms)
    .bind(record.progress.as_ref().map(columns::json))
    .bind(lease.job.to_string())
    .bind(lease.epoch)
    .fetch_optional(&mut **tx)
    .await?;
    let Some(last_event) = last_event else {
        return Ok(Hold::Lost);
    };
    if record.worked_ms > 0 {
        let worked_s = Duration::from_millis(record.worked_ms).as_secs_f64();
        metrics::histogram!("greybox_slice_duration_seconds").record(worked_s);
        quota_checks::note_work(tx, &lease.job.to_string(), record.worked_ms).await?;
    }
    let n_events = i64::try_from(record.events.len()).expect("a record is small");
    events::insert(tx, lease.job, last_event - n_events + 1, &record.events).await?;
    generations::insert(tx, lease.job, &record.generations).await?;
    if let Some(new) = &record.candidates {
        candidates::insert(tx, lease.job, new).await?;
    }
    work_shares::insert(tx, lease.job, &record.parts).await?;
    if let Some(checkpoint) = &record.checkpoint {
        checkpoints::put(tx, lease.job, checkpoint).await?;
        work_shares::set_shared(tx, lease.job, record.is_shared).await?;
    }
    tx.announce(Change::Job(lease.job));
    Ok(Hold::Kept)
}
