//! The end of a job, and its pause.
//!
//! A client whose wish to cancel or to pause was answered relies on that answer. So the wish decides what
//! a slice comes to, as it stands in the transaction that ends the slice: a job that was asked to stop
//! while its last unit was computed does not succeed or fail.

use jiff::Timestamp;

use super::recording::{queue_again, write_record};
use super::slice::{Hold, Lease, Record};
use crate::job::{Event, Failure, ResultOfJob, Status};
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
    Succeeded(ResultOfJob),
    /// The job cannot go on.
    Failed(Failure),
    /// The slice stopped because its job was asked to, with the best result so far.
    Stopped(Option<ResultOfJob>),
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

    /// The last events of a job that comes to a state with this ending.
    pub(super) fn reports(&self, status: Status) -> Vec<Event> {
        let outcome = match self {
            Ending::Succeeded(outcome) | Ending::Stopped(Some(outcome)) => Some(outcome),
            Ending::Failed(_) | Ending::Stopped(None) => None,
        };
        let result = outcome.filter(|_| status.is_terminal());
        let mut reports: Vec<Event> = result.map(Event::of_result).into_iter().collect();
        reports.push(Event::State { status });
        if status.is_terminal() {
            reports.push(Event::End { status });
        }
        reports
    }
}

/// The state that a job leaves, and the one that the job enters.
#[derive(Clone, Copy, Debug)]
pub(in crate::store) struct Transition {
    pub(in crate::store) from: Status,
    pub(in crate::store) to: Status,
}

/// A job as it stands in the transaction that ends a slice of it.
pub(super) struct Standing {
    pub(super) status: Status,
    pub(super) request: Option<StopRequest>,
}

/// What is written of a slice that ends its job.
pub(super) struct LastSlice {
    pub(super) record: Record,
    pub(super) ending: Ending,
}

pub(super) async fn finish(tx: &mut Tx, lease: Lease, last: LastSlice) -> Result<Hold, StoreError> {
    let LastSlice { mut record, ending } = last;
    let Some(Standing { status, request }) = standing(tx, lease.job).await? else {
        return Ok(Hold::Lost);
    };
    let to = ending.leads_to(request);
    if let Some(to) = to {
        record.events.extend(ending.reports(to));
    }
    if to.is_some_and(Status::is_terminal) {
        record.checkpoint = None;
    }
    let hold = write_record(tx, lease, record).await?;
    match (hold, to) {
        (Hold::Lost, _) => {}
        (Hold::Kept, Some(to)) => {
            let transition = Transition { from: status, to };
            end(tx, lease.job, transition, ending, &[]).await?;
        }
        (Hold::Kept, None) => queue_again(tx, lease.job).await?,
    }
    Ok(hold)
}

/// The state of a job and what it is asked to do; nothing where the job is gone.
pub(super) async fn standing(tx: &mut Tx, id: JobId) -> Result<Option<Standing>, StoreError> {
    let id = id.to_string();
    let words: Option<(String, Option<String>)> =
        database::query_as("select status, request from jobs where id = $1")
            .bind(&id)
            .fetch_optional(&mut **tx)
            .await?;
    let read = |(status, request): (String, Option<String>)| {
        Ok(Standing {
            status: columns::parse_status(&id, &status)?,
            request: request
                .map(|word| StopRequest::read(&word, &id))
                .transpose()?,
        })
    };
    words.map(read).transpose()
}

/// Brings a job into the state that it ends or is held in, with its result or its failure, and with events
/// that no record has.
pub(super) async fn end(
    tx: &mut Tx,
    id: JobId,
    transition: Transition,
    ending: Ending,
    reported: &[Event],
) -> Result<(), StoreError> {
    let status = transition.to;
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
    if let Some(outcome) = outcome {
        results::put(tx, id, outcome, status).await?;
    } else if status == Status::Cancelled {
        results::mark_cancelled(tx, id).await?;
    }
    change_status(tx, id, transition, reported).await
}

/// What the change of a job's state comes upon.
#[derive(sqlx::FromRow)]
struct Changed {
    last_event: i64,
    has_checkpoint: bool,
    has_parts: bool,
    /// Whether anybody is told of the ends of the project's jobs.
    has_webhooks: bool,
}

/// Brings a job into a state and tells of it. The only place where a job changes its state.
pub(in crate::store) async fn change_status(
    tx: &mut Tx,
    id: JobId,
    transition: Transition,
    reported: &[Event],
) -> Result<(), StoreError> {
    let key = id.to_string();
    let to = transition
        .from
        .advance_to(transition.to)
        .map_err(|why| corrupt("status", &key, why))?;
    let now = Timestamp::now().to_string();
    let n_events = i64::try_from(reported.len()).expect("a change tells of little");
    let changed: Changed = database::query_as(
        "update jobs set status = $1, request = null, revision = revision + 1, at_work_in = null, is_shared = 0, \
         last_event = last_event + $2, started_at = coalesce(started_at, $3), finished_at = $4 \
         where id = $5 returning last_event, \
         exists (select 1 from checkpoints where job = jobs.id) as has_checkpoint, \
         exists (select 1 from shared_parts where job = jobs.id) as has_parts, \
         exists (select 1 from webhooks where project = jobs.project) as has_webhooks",
    )
    .bind(to.as_str())
    .bind(n_events)
    .bind((to == Status::Running).then_some(&now))
    .bind(to.is_terminal().then_some(&now))
    .bind(&key)
    .fetch_one(&mut **tx)
    .await?;
    events::insert(tx, id, changed.last_event - n_events + 1, reported).await?;
    if to.is_terminal() {
        if changed.has_checkpoint {
            checkpoints::forget(tx, id).await?;
        }
        if changed.has_parts {
            work_shares::forget(tx, id).await?;
        }
        metrics::counter!("greybox_jobs_ended_total", "status" => to.as_str()).increment(1);
        if changed.has_webhooks {
            deliveries::tell_of_end(tx, id).await?;
        }
    }
    tx.announce(Change::Job(id));
    Ok(())
}
