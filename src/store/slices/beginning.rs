//! How a slice begins: whether it may, and with what it goes on.

use std::time::Duration;

use super::endings::{self, Ending, Transition};
use super::slice::{Begin, Lease, Reported, Slice};
use crate::job::{Event, Failure, GenerationEvent, Status};
use crate::store::columns;
use crate::store::damage::Damage;
use crate::store::database::{self, QueryBuilder};
use crate::store::jobs::{self, JobRow};
use crate::store::nodes::{SUSPECT_FROM, wait_after};
use crate::store::writer::Tx;
use crate::store::{Change, Checkpoint, StopRequest, StoreError, checkpoints, generations};
use greybox::identification::JobId;

/// When a slice is to begin, and where damage is noted.
#[derive(Clone)]
pub(super) struct Now {
    /// The life of the server.
    pub(super) life: i64,
    /// How long the life has lasted.
    pub(super) age: Duration,
    /// Lives of the server in a row that may end with a job.
    pub(super) death_limit: u32,
    pub(super) damage: Damage,
}

/// The columns of a job that decide whether a slice begins, and where the slice goes on.
#[derive(sqlx::FromRow)]
struct Control {
    status: String,
    epoch: i64,
    #[sqlx(try_from = "i64")]
    deaths: u32,
    at_work_in: Option<i64>,
    queue_entry: i64,
    is_shared: i64,
    running_ms: i64,
    #[sqlx(try_from = "i64")]
    told_generation: u32,
    #[sqlx(try_from = "i64")]
    told_refinements: u32,
    told_at_ms: i64,
}

/// A job as it stands before a slice of it begins; the row of the job may be damaged.
struct Waiting {
    control: Control,
    job: Result<JobRow, StoreError>,
}

/// What the beginning of a slice changes of a job that runs.
#[derive(sqlx::FromRow)]
struct Raised {
    #[sqlx(try_from = "i64")]
    attempt: u32,
    started_at: Option<String>,
    last_event: i64,
    revision: i64,
}

/// Begins a slice of a job, for an entry of the queue or, without one, for a job that was asked to stop.
pub(super) async fn begin(
    tx: &mut Tx,
    id: JobId,
    entry: Option<i64>,
    now: Now,
) -> Result<Begin, StoreError> {
    let Some(Waiting { control, job }) = waiting(tx, id).await? else {
        return Ok(Begin::Nothing);
    };
    let stale = entry.is_some_and(|entry| entry != control.queue_entry);
    let status = columns::parse_status(&id.to_string(), &control.status)?;
    if stale || !matches!(status, Status::Queued | Status::Running) {
        return Ok(Begin::Nothing);
    }
    if entry.is_none() && control.at_work_in.is_some_and(|life| life != now.life) {
        // The node that works it ends it.
        return Ok(Begin::Nothing);
    }
    if control.deaths >= now.death_limit {
        fail(tx, id, Failure::crashed_too_often(control.deaths)).await?;
        return Ok(Begin::Ended);
    }
    let job = match job {
        Err(error) if error.corrupt_row().is_some() => {
            now.damage.note(&error);
            fail(tx, id, Failure::damaged_data(&error)).await?;
            return Ok(Begin::Ended);
        }
        job => job?,
    };
    if entry.is_some() && is_to_wait(tx, control.deaths, &now).await? {
        return Ok(Begin::NotYet);
    }
    let reported = Reported {
        generation: control.told_generation,
        refinements: control.told_refinements,
        at_ms: control.told_at_ms,
    };
    // A job that was never at work has left nothing.
    let is_first = job.started_at.is_none();
    let (checkpoint, unreported) = if is_first {
        (None, None)
    } else {
        let checkpoint = sound_checkpoint(tx, id, &now.damage).await?;
        let above = reported.generation;
        let unreported = newest_generation(tx, id, above, &now.damage).await?;
        (checkpoint, unreported)
    };
    let job = put_to_work(tx, job, now.life).await?;
    Ok(Begin::Slice(Box::new(Slice {
        lease: Lease {
            job: id,
            epoch: control.epoch + 1,
        },
        job,
        checkpoint,
        running_ms: control.running_ms.unsigned_abs(),
        reported,
        unreported,
        is_shared: control.is_shared != 0,
        is_first,
    })))
}

async fn waiting(tx: &mut Tx, id: JobId) -> Result<Option<Waiting>, StoreError> {
    let mut query = QueryBuilder::new("select ");
    query
        .push(jobs::COLUMNS)
        .push(" from jobs where id = ")
        .push_bind(id.to_string());
    let row = query.build().fetch_optional(&mut **tx).await?;
    row.map(|row| {
        Ok(Waiting {
            control: row.read()?,
            job: jobs::read(&row),
        })
    })
    .transpose()
}

/// Notes that a life of the server is at work on a job, which writes with older leases change nothing of
/// any more.
async fn put_to_work(tx: &mut Tx, job: JobRow, life: i64) -> Result<JobRow, StoreError> {
    let (id, status) = (job.id, Status::Running);
    if job.status != status {
        let transition = Transition {
            from: job.status,
            to: status,
        };
        endings::change_status(tx, id, transition, &[Event::State { status }]).await?;
    }
    let raised: Raised = database::query_as(
        "update jobs set epoch = epoch + 1, attempt = attempt + 1, revision = revision + 1, \
         at_work_in = $1 where id = $2 returning attempt, started_at, last_event, revision",
    )
    .bind(life)
    .bind(id.to_string())
    .fetch_one(&mut **tx)
    .await?;
    tx.announce(Change::Job(id));
    Ok(JobRow {
        status,
        attempt: raised.attempt,
        started_at: columns::optional_time(&id.to_string(), raised.started_at.as_deref())?,
        last_event: raised.last_event,
        revision: raised.revision,
        ..job
    })
}

/// Where a job can go on. A damaged checkpoint is removed: without one the job begins again from its
/// specification and comes to the same bits, unless its run is still in memory and goes on from there.
async fn sound_checkpoint(
    tx: &mut Tx,
    id: JobId,
    damage: &Damage,
) -> Result<Option<Checkpoint>, StoreError> {
    match checkpoints::fetch(&mut **tx, id).await {
        Err(error) if error.corrupt_row().is_some() => {
            damage.note(&error);
            tracing::warn!(job = %id, %error, "a damaged checkpoint is not used: the job goes back");
            checkpoints::forget(tx, id).await?;
            Ok(None)
        }
        fetched => fetched,
    }
}

async fn newest_generation(
    tx: &mut Tx,
    id: JobId,
    above: u32,
    damage: &Damage,
) -> Result<Option<GenerationEvent>, StoreError> {
    let row = database::query(
        "select job, generation, row, seal from generations where job = $1 and generation > $2 \
         order by generation desc limit 1",
    )
    .bind(id.to_string())
    .bind(above)
    .fetch_optional(&mut **tx)
    .await?;
    match row.as_ref().map(generations::read).transpose() {
        Err(error) if error.corrupt_row().is_some() => {
            damage.note(&error);
            tracing::warn!(%error, "no event tells of a generation");
            Ok(None)
        }
        read => read,
    }
}

/// Whether a job that lives of the server ended with is still to wait: for the server to have been
/// up for a while, and for no other such job to be at work.
async fn is_to_wait(tx: &mut Tx, deaths: u32, now: &Now) -> Result<bool, StoreError> {
    if deaths < SUSPECT_FROM {
        return Ok(false);
    }
    if now.age < wait_after(deaths) {
        return Ok(true);
    }
    let another: bool = database::query_scalar(
        "select exists (select 1 from jobs where at_work_in = $1 and deaths >= $2)",
    )
    .bind(now.life)
    .bind(SUSPECT_FROM)
    .fetch_one(&mut **tx)
    .await?;
    Ok(another)
}

/// Ends a job that cannot go on, as was asked of it or as failed.
async fn fail(tx: &mut Tx, id: JobId, failure: Failure) -> Result<(), StoreError> {
    tracing::warn!(job = %id, detail = failure.detail, "a job cannot go on");
    let Some(standing) = endings::standing(tx, id).await? else {
        return Ok(());
    };
    let to = standing
        .request
        .map_or(Status::Failed, StopRequest::leads_to);
    let ending = Ending::Failed(failure);
    let reported = ending.reports(to);
    let transition = Transition {
        from: standing.status,
        to,
    };
    endings::end(tx, id, transition, ending, &reported).await
}
