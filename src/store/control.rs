//! Cancel, pause and resume. Each is idempotent.
//!
//! A job that is not at work changes its state here and now. A running job is asked to stop: the
//! worker sees the request, ends the slice and writes the state together with the best estimate. The
//! request holds whatever the slice comes to (see `slices/endings`).

use super::columns;
use super::jobs::{self, JobRow, Jobs};
use super::slices::endings;
use super::stop_request::StopRequest;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, database, queue, results};
use crate::job::{Event, Status};
use greybox::identification::JobId;

/// The answer to a wish to cancel, pause or resume.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// Done, or asked of the worker, or so already: the job as it stands.
    Accepted(Box<JobRow>),
    /// There is no such job.
    NotFound,
    /// The job's state does not allow it: the one that the job is in, or the end that it was promised.
    Refused(Status),
}

impl Jobs {
    /// Asks a job to end.
    pub async fn cancel(&self, id: JobId) -> Result<Control, StoreError> {
        self.control(id, Wish::Cancel).await
    }

    /// Asks a job to hold.
    pub async fn pause(&self, id: JobId) -> Result<Control, StoreError> {
        self.control(id, Wish::Pause).await
    }

    /// Lets a paused job go on.
    pub async fn resume(&self, id: JobId) -> Result<Control, StoreError> {
        self.control(id, Wish::Resume).await
    }

    /// The running jobs that were asked to stop and have not yet, but for those that other nodes are at
    /// work on.
    pub async fn stop_requests(&self) -> Result<Vec<JobId>, StoreError> {
        let ids: Vec<String> = database::query_scalar(
            "select id from jobs where request is not null \
             and (at_work_in is null or at_work_in = $1) order by id",
        )
        .bind(self.database.life)
        .fetch_all(&self.database.readers)
        .await?;
        ids.iter().map(|id| columns::parse_id(id)).collect()
    }

    async fn control(&self, id: JobId, wish: Wish) -> Result<Control, StoreError> {
        in_transaction!(self.database, |tx| control(tx, id, wish)).await
    }
}

async fn control(tx: &mut Tx, id: JobId, wish: Wish) -> Result<Control, StoreError> {
    let Some(row) = jobs::fetch(&mut *tx, id).await? else {
        return Ok(Control::NotFound);
    };
    let step = match wish.of(&row) {
        Ok(step) => step,
        Err(status) => return Ok(Control::Refused(status)),
    };
    apply(tx, &row, step).await?;
    let row = jobs::fetch(&mut *tx, id).await?;
    Ok(row.map_or(Control::NotFound, |row| Control::Accepted(Box::new(row))))
}

#[derive(Clone, Copy)]
enum Wish {
    Cancel,
    Pause,
    Resume,
}

/// What a wish comes to, given the job's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Nothing,
    Ask(StopRequest),
    Withdraw,
    Become(Status),
}

impl Wish {
    /// The step that the wish takes, or the state that allows none. A job that was asked to cancel is
    /// treated as cancelled: whoever asked was told that it ends so.
    fn of(self, row: &JobRow) -> Result<Step, Status> {
        match (self, row.status, row.stop_request) {
            (Wish::Cancel, Status::Queued | Status::Paused, _) => {
                Ok(Step::Become(Status::Cancelled))
            }
            (Wish::Cancel, Status::Running, None | Some(StopRequest::Pause)) => {
                Ok(Step::Ask(StopRequest::Cancel))
            }
            (Wish::Pause | Wish::Resume, Status::Running, Some(StopRequest::Cancel)) => {
                Err(Status::Cancelled)
            }
            (Wish::Pause, Status::Queued, _) => Ok(Step::Become(Status::Paused)),
            (Wish::Pause, Status::Running, None) => Ok(Step::Ask(StopRequest::Pause)),
            (Wish::Resume, Status::Paused, _) => Ok(Step::Become(Status::Queued)),
            (Wish::Resume, Status::Running, Some(StopRequest::Pause)) => Ok(Step::Withdraw),
            (Wish::Cancel, Status::Running | Status::Cancelled, _)
            | (Wish::Pause, Status::Paused | Status::Running, _)
            | (Wish::Resume, Status::Queued | Status::Running, _) => Ok(Step::Nothing),
            (_, Status::Succeeded | Status::Failed | Status::Cancelled, _) => Err(row.status),
        }
    }
}

async fn apply(tx: &mut Tx, job: &JobRow, step: Step) -> Result<(), StoreError> {
    let id = job.id;
    match step {
        Step::Nothing => Ok(()),
        Step::Ask(request) => {
            set_request(tx, id, Some(request)).await?;
            tx.announce(Change::StopRequested(id));
            Ok(())
        }
        Step::Withdraw => set_request(tx, id, None).await,
        Step::Become(Status::Queued) => {
            queue::renew(tx, id, &job.project).await?;
            let status = Status::Queued;
            endings::change_status(tx, id, status, &[Event::State { status }]).await
        }
        Step::Become(status) => {
            let mut reported = vec![Event::State { status }];
            if status.is_terminal() {
                reported.push(Event::End { status });
                results::mark_cancelled(tx, id).await?;
            }
            endings::change_status(tx, id, status, &reported).await
        }
    }
}

async fn set_request(
    tx: &mut Tx,
    id: JobId,
    request: Option<StopRequest>,
) -> Result<(), StoreError> {
    database::query("update jobs set request = $1, revision = revision + 1 where id = $2")
        .bind(request.map(StopRequest::as_str))
        .bind(id.to_string())
        .execute(&mut **tx)
        .await?;
    tx.announce(Change::Job(id));
    Ok(())
}
