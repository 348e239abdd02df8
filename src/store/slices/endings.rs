//! The end of a job, and its pause.
//!
//! A client whose wish to cancel or to pause was answered relies on that answer. So the wish decides what
//! a slice comes to, as it stands in the transaction that ends the slice: a job that was asked to stop
//! while its last unit was computed does not succeed or fail.

use jiff::Timestamp;
use serde_json::Value;

use super::recording::{queue_again, write_record};
use super::slice::{Hold, Lease, Record};
use crate::job::{Event, Failure, Status};
use crate::store::columns;
use crate::store::stop_request::StopRequest;
use crate::store::writer::Tx;
use crate::store::{
    Change, StoreError, checkpoints, corrupt, database, deliveries, events, results, work_shares,
};
use greybox::identification::JobId;

/// What the last slice of a job came to, for now.
#[derive(Clone, Debug)]
pub enum Ending {
    /// The job is done, with this result.
    Succeeded(Value),
    /// The job cannot go on.
    Failed(Failure),
    /// The slice stopped because its job was asked to, with the best result so far.
    Stopped(Option<Value>),
}

impl Ending {
    /// The state that the job comes to; nothing where the job goes on, because a pause for which the
    /// slice stopped was taken back.
    fn leads_to(&self, asked: Option<StopRequest>) -> Option<Status> {
        match (asked, self) {
            (Some(request), _) => Some(request.leads_to()),
            (None, Ending::Succeeded(_)) => Some(Status::Succeeded),
            (None, Ending::Failed(_)) => Some(Status::Failed),
            (None, Ending::Stopped(_)) => None,
        }
    }
}

/// What is written of a slice that ends its job.
pub(super) struct LastSlice {
    pub(super) record: Record,
    pub(super) ending: Ending,
}

pub(super) async fn finish(tx: &mut Tx, lease: Lease, last: LastSlice) -> Result<Hold, StoreError> {
    let LastSlice { mut record, ending } = last;
    let status = ending.leads_to(asked(tx, lease.job).await?);
    if status.is_some_and(Status::is_terminal) {
        record.checkpoint = None;
    }
    let hold = write_record(tx, lease, record).await?;
    match (hold, status) {
        (Hold::Lost, _) => {}
        (Hold::Kept, Some(status)) => end(tx, lease.job, status, ending).await?,
        (Hold::Kept, None) => queue_again(tx, lease.job).await?,
    }
    Ok(hold)
}

/// What a job is asked to do, as it stands in this transaction.
pub(in crate::store) async fn asked(
    tx: &mut Tx,
    id: JobId,
) -> Result<Option<StopRequest>, StoreError> {
    let id = id.to_string();
    let word: Option<Option<String>> =
        database::query_scalar("select request from jobs where id = $1")
            .bind(&id)
            .fetch_optional(&mut **tx)
            .await?;
    let word = word.flatten();
    word.map(|word| StopRequest::read(&word, &id)).transpose()
}

/// Brings a job into the state that it ends or is held in, with its result or its failure.
pub(in crate::store) async fn end(
    tx: &mut Tx,
    id: JobId,
    status: Status,
    ending: Ending,
) -> Result<(), StoreError> {
    let (outcome, failure) = match ending {
        Ending::Succeeded(outcome) => (Some(outcome), None),
        Ending::Stopped(outcome) => (outcome, None),
        Ending::Failed(failure) => (None, Some(failure)),
    };
    if let Some(failure) = failure.filter(|_| status == Status::Failed) {
        database::query("update jobs set error = $1 where id = $2")
            .bind(columns::json(&failure))
            .bind(id.to_string())
            .execute(&mut **tx)
            .await?;
    }
    let mut reported = Vec::new();
    if let Some(outcome) = &outcome {
        results::put(tx, id, outcome.clone(), status).await?;
        if status.is_terminal() {
            reported.push(Event::of_result(outcome));
        }
    } else if status == Status::Cancelled {
        results::mark_cancelled(tx, id).await?;
    }
    reported.push(Event::State { status });
    if status.is_terminal() {
        reported.push(Event::End { status });
    }
    change_status(tx, id, status, &reported).await
}

/// Brings a job into a state and tells of it. The only place where a job changes its state.
pub(in crate::store) async fn change_status(
    tx: &mut Tx,
    id: JobId,
    to: Status,
    reported: &[Event],
) -> Result<(), StoreError> {
    let key = id.to_string();
    let from: String = database::query_scalar("select status from jobs where id = $1")
        .bind(&key)
        .fetch_one(&mut **tx)
        .await?;
    let from: Status = from.parse().map_err(|why| corrupt("status", &key, why))?;
    let to = from
        .advance_to(to)
        .map_err(|why| corrupt("status", &key, why))?;
    let now = Timestamp::now().to_string();
    let n_events = i64::try_from(reported.len()).expect("a change tells of little");
    let last_event: i64 = database::query_scalar(
        "update jobs set status = $1, request = null, revision = revision + 1, at_work_in = null, is_shared = 0, \
         last_event = last_event + $2, started_at = coalesce(started_at, $3), finished_at = $4 \
         where id = $5 returning last_event",
    )
    .bind(to.as_str())
    .bind(n_events)
    .bind((to == Status::Running).then_some(&now))
    .bind(to.is_terminal().then_some(&now))
    .bind(&key)
    .fetch_one(&mut **tx)
    .await?;
    events::insert(tx, id, last_event - n_events + 1, reported).await?;
    if to.is_terminal() {
        checkpoints::forget(tx, id).await?;
        work_shares::forget(tx, id).await?;
        metrics::counter!("greybox_jobs_ended_total", "status" => to.as_str()).increment(1);
        deliveries::tell_of_end(tx, id).await?;
    }
    tx.announce(Change::Job(id));
    Ok(())
}
