//! What is written of a monitor: that it is there, and each of its steps.

use jiff::Timestamp;
use serde::Serialize;
use serde_json::json;

use super::monitor::{self, Advance, AdvanceWindow, MonitorRow, NewMonitor, fetch};
use crate::job::MonitorId;
use crate::monitor::{Alarm, ShownWindow, WindowStatus};
use crate::store::columns::json;
use crate::store::database::{self, Connection};
use crate::store::idempotency;
use crate::store::new_ids::NewIds;
use crate::store::quota_checks::JobRoom;
use crate::store::sealed::{MONITOR_ALARMS, MONITOR_EVENTS, MONITOR_WINDOWS, MONITORS};
use crate::store::submit::batch::{self, Known};
use crate::store::submit::{self, Idempotent, Submitted};
use crate::store::writer::Tx;
use crate::store::{Change, StoreError, datasets, deliveries, jobs, streams};
use greybox::identification::{DatasetId, JobId};

/// Monitors that a project can have.
const MAX_MONITORS: i64 = 1000;

pub(super) async fn insert(
    tx: &mut Tx,
    new: NewMonitor,
) -> Result<Option<Submitted<MonitorRow>>, StoreError> {
    if let Some(idempotency) = &new.idempotency
        && let Some(earlier) = submit::earlier(tx, idempotency).await?
    {
        return Ok(Some(earlier));
    }
    let stream = streams::identity(&new.project, &new.stream);
    let (monitors, streams): (i64, i64) = database::query_as(
        "select (select count(*) from monitors where project = $1), \
         (select count(*) from streams where identity = $2)",
    )
    .bind(new.project.as_str())
    .bind(&stream)
    .fetch_one(&mut **tx)
    .await?;
    if monitors >= MAX_MONITORS || streams == 0 {
        return Ok(None);
    }
    let id: MonitorId = NewIds::of(tx, "monitors").await?.next();
    let (spec, state) = (json(&new.spec), json(&new.state));
    let seal = MONITORS.seal(&[
        (&id.to_string()).into(),
        new.project.as_str().into(),
        (&new.name).into(),
        (&stream).into(),
        (&spec).into(),
        (&state).into(),
        new.due_ns.into(),
    ]);
    database::query(
        "insert into monitors (id, project, name, stream, spec, state, due_ns, patience_ms, \
         created_at, seal) values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10)",
    )
    .bind(id.to_string())
    .bind(new.project.as_str())
    .bind(&new.name)
    .bind(&stream)
    .bind(spec)
    .bind(state)
    .bind(new.due_ns)
    .bind(i64::try_from(new.patience.as_millis()).unwrap_or(i64::MAX))
    .bind(Timestamp::now().to_string())
    .bind(seal)
    .execute(&mut **tx)
    .await?;
    if let Some(idempotency) = &new.idempotency {
        idempotency::remember(tx, idempotency, &id.to_string()).await?;
    }
    tx.announce(Change::Stream);
    Ok(fetch(tx, id).await?.map(Submitted::Created))
}

impl Idempotent for MonitorRow {
    type Id = MonitorId;
    const PREFIX: &'static str = MonitorId::PREFIX;

    async fn fetch(connection: &mut Connection, id: MonitorId) -> Result<Option<Self>, StoreError> {
        fetch(connection, id).await
    }
}

pub(super) async fn delete(tx: &mut Tx, id: MonitorId) -> Result<bool, StoreError> {
    let removed = database::query("delete from monitors where id = $1")
        .bind(id.to_string())
        .execute(&mut **tx)
        .await?;
    tx.announce(Change::Monitor(id));
    Ok(removed > 0)
}

pub(super) async fn advance(tx: &mut Tx, step: Advance) -> Result<bool, StoreError> {
    let Advance {
        from,
        state,
        due_ns,
        silent,
        window,
        alarms,
        forget_before,
    } = step;
    let now: Option<MonitorRow> = fetch(tx, from.id).await?;
    let Some(now) = now.filter(|now| now.revision == from.revision) else {
        return Ok(false);
    };
    let mut told = MonitorEvents {
        monitor: from.id,
        last_event: now.last_event,
    };
    let mut job = now.job;
    if let Some(window) = window {
        let written = put_window(tx, from.id, window).await?;
        job = written.job;
        told.tell(tx, "window", &written.window).await?;
    }
    let mut last_alarm = now.last_alarm;
    for mut alarm in alarms {
        last_alarm += 1;
        alarm.id = last_alarm;
        insert_alarm(tx, &from, &alarm).await?;
        told.tell(tx, "alarm", &alarm).await?;
    }
    // The specification is written again in the form that the seal covers.
    let (id, spec, state) = (from.id.to_string(), json(&now.spec), json(&state));
    let stream = streams::identity(&now.project, &now.stream);
    let seal = MONITORS.seal(&[
        (&id).into(),
        now.project.as_str().into(),
        (&now.name).into(),
        (&stream).into(),
        (&spec).into(),
        (&state).into(),
        due_ns.into(),
    ]);
    database::query(
        "update monitors set state = $1, due_ns = $2, silent = $3, job = $4, revision = revision + 1, \
         last_event = $5, last_alarm = $6, spec = $7, seal = $8 where id = $9",
    )
    .bind(state)
    .bind(due_ns)
    .bind(i64::from(silent))
    .bind(job.map(|job| job.to_string()))
    .bind(told.last_event)
    .bind(last_alarm)
    .bind(spec)
    .bind(seal)
    .bind(id)
    .execute(&mut **tx)
    .await?;
    forget(tx, from.id, forget_before).await?;
    tx.announce(Change::Monitor(from.id));
    Ok(true)
}

/// Writes what there is to say of a window, with the job that works it from now on.
async fn put_window(
    tx: &mut Tx,
    monitor: MonitorId,
    window: AdvanceWindow,
) -> Result<ShownWindow, StoreError> {
    let AdvanceWindow { mut window, job } = window;
    let number = window.number;
    let before = database::query(
        "select monitor, number, job, dataset, row, seal, state_seal from monitor_windows \
         where monitor = $1 and number = $2",
    )
    .bind(monitor.to_string())
    .bind(number)
    .fetch_optional(&mut **tx)
    .await?;
    let before = before.as_ref().map(monitor::window).transpose()?;
    let (mut id, mut dataset) = (None, None);
    if let Some(new) = job {
        let mut room = JobRoom::default();
        room.take(tx, &new.job.project, 1).await??;
        if let Some((name, recording)) = new.dataset {
            let (stored, _) = datasets::insert_as(tx, name, recording).await?;
            dataset = Some(stored.id);
        }
        let all = vec![new.job];
        let known = Known::look_up(tx, &all).await?;
        let is_gone = all.iter().any(|job| known.missing::<()>(job).is_some());
        if is_gone {
            window.status = WindowStatus::Failed;
            window.reason = Some("its model or its recording was removed".to_owned());
        } else {
            let stored = batch::store(tx, all).await?;
            id = stored.first().map(|job| job.id);
        }
    }
    let (key, row) = (monitor.to_string(), json(&window));
    let seal = MONITOR_WINDOWS.seal(&[(&key).into(), number.into(), (&row).into()]);
    database::query(
        "insert into monitor_windows (monitor, number, job, dataset, row, seal) \
         values ($1, $2, $3, $4, $5, $6) \
         on conflict (monitor, number) do update set row = excluded.row, seal = excluded.seal, \
         job = coalesce(excluded.job, monitor_windows.job), \
         dataset = coalesce(excluded.dataset, monitor_windows.dataset)",
    )
    .bind(key)
    .bind(number)
    .bind(id.map(|id: JobId| id.to_string()))
    .bind(dataset.map(|id: DatasetId| id.to_string()))
    .bind(row)
    .bind(seal)
    .execute(&mut **tx)
    .await?;
    // A job that worked the window before, and whose estimate was not taken.
    if let (Some(_), Some(replaced)) = (id, before.and_then(|before| before.job)) {
        jobs::delete(tx, replaced).await?;
    }
    Ok(ShownWindow {
        window,
        job: id,
        dataset,
    })
}

/// Removes the jobs and the recordings of windows before a number; what was estimated stays.
async fn forget(tx: &mut Tx, monitor: MonitorId, before: i64) -> Result<(), StoreError> {
    let old = database::query(
        "select monitor, number, job, dataset, row, seal, state_seal from monitor_windows where monitor = $1 \
         and number < $2 and (job is not null or dataset is not null)",
    )
    .bind(monitor.to_string())
    .bind(before)
    .fetch_all(&mut **tx)
    .await?;
    let old = old
        .iter()
        .map(monitor::window)
        .collect::<Result<Vec<_>, _>>()?;
    for ShownWindow {
        window,
        job,
        dataset,
    } in old
    {
        if let Some(job) = job {
            jobs::delete(tx, job).await?;
        }
        if let Some(dataset) = dataset {
            let is_read: bool = database::query_scalar(
                "select exists (select 1 from job_datasets where dataset = $1)",
            )
            .bind(dataset.to_string())
            .fetch_one(&mut **tx)
            .await?;
            if !is_read {
                datasets::delete(tx, dataset).await?;
            }
        }
        database::query(
            "update monitor_windows set job = null, dataset = null \
             where monitor = $1 and number = $2",
        )
        .bind(monitor.to_string())
        .bind(window.number)
        .execute(&mut **tx)
        .await?;
    }
    Ok(())
}

/// The only place where an alarm is stored: whoever is to be told of it in another way than by the
/// events of its monitor is told from here, in the same transaction.
async fn insert_alarm(tx: &mut Tx, monitor: &MonitorRow, alarm: &Alarm) -> Result<(), StoreError> {
    let (key, row) = (monitor.id.to_string(), json(alarm));
    let seal = MONITOR_ALARMS.seal(&[(&key).into(), alarm.id.into(), (&row).into()]);
    database::query("insert into monitor_alarms (monitor, id, row, seal) values ($1, $2, $3, $4)")
        .bind(key)
        .bind(alarm.id)
        .bind(row)
        .bind(seal)
        .execute(&mut **tx)
        .await?;
    let data = json!({"monitor": monitor.id.to_string(), "alarm": alarm});
    deliveries::tell(tx, &monitor.project, "monitor.alarm", &data).await
}

/// Events of a monitor, as they are stored.
struct MonitorEvents {
    monitor: MonitorId,
    last_event: i64,
}

impl MonitorEvents {
    async fn tell(
        &mut self,
        tx: &mut Tx,
        name: &str,
        data: &impl Serialize,
    ) -> Result<(), StoreError> {
        self.last_event += 1;
        let (key, data) = (self.monitor.to_string(), json(data));
        let parts = [
            (&key).into(),
            self.last_event.into(),
            name.into(),
            (&data).into(),
        ];
        let seal = MONITOR_EVENTS.seal(&parts);
        database::query(
            "insert into monitor_events (monitor, id, name, data, seal) values ($1, $2, $3, $4, $5)",
        )
        .bind(key)
        .bind(self.last_event)
        .bind(name)
        .bind(data)
        .bind(seal)
        .execute(&mut **tx)
        .await?;
        Ok(())
    }
}
