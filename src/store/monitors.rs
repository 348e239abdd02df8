//! What is watched: monitors, their windows, alarms and events.
//!
//! A monitor goes on in steps. A step is one transaction: what became of a window, the job that
//! works the next, alarms and events come to be together or not at all, and only where no other step
//! came first. So a window is worked once, whenever the server dies.

mod step;

use std::time::Duration;

use jiff::Timestamp;
use serde_json::Value;

use super::database::{self, Connection, QueryBuilder, Row};
use super::datasets::NewDataset;
use super::events::{self, StoredEvent};
use super::idempotency::Idempotency;
use super::jobs::{self, Page, from_json, time};
use super::sealed::{MONITOR_ALARMS, MONITOR_EVENTS, MONITOR_WINDOWS, MONITORS};
use super::submit::{NewJob, Submitted};
use super::{Store, StoreError, corrupt};
use crate::access::Project;
use crate::job::MonitorId;
use greybox::identification::{DatasetId, JobId};

/// A monitor to be stored.
#[derive(Clone, Debug)]
pub struct NewMonitor {
    /// Whose it is, and its stream.
    pub project: Project,
    /// A name for people.
    pub name: Option<String>,
    /// The stream that it watches.
    pub stream: String,
    /// What was asked for.
    pub spec: Value,
    /// What it knows at first.
    pub state: Value,
    /// When its first window ends, nanoseconds since 1970.
    pub due_ns: i64,
    /// How long it waits for data before it says that they stopped.
    pub patience: Duration,
    /// Makes the request safe to repeat.
    pub idempotency: Option<Idempotency>,
}

/// A monitor as it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct MonitorRow {
    /// The identifier of the monitor.
    pub id: MonitorId,
    /// The project that the monitor and the stream belong to.
    pub project: Project,
    /// A name for people.
    pub name: Option<String>,
    /// The stream that the monitor watches.
    pub stream: String,
    /// The specification of the monitor.
    pub spec: Value,
    /// What the monitor knows by now.
    pub state: Value,
    /// When the next window ends, nanoseconds since 1970.
    pub due_ns: i64,
    /// The job that works a window, where one does.
    pub job: Option<JobId>,
    /// Whether the monitor has said that data have stopped.
    pub silent: bool,
    /// Grows with every step.
    pub revision: i64,
    /// The id of the last event of the monitor.
    pub last_event: i64,
    /// The id of the last alarm of the monitor.
    pub last_alarm: i64,
    /// When the monitor was accepted.
    pub created_at: Timestamp,
}

/// A step of a monitor.
pub struct Advance {
    /// The monitor as the step knew it; where it has changed since, the step changes nothing.
    pub from: MonitorRow,
    /// What it then knows.
    pub state: Value,
    /// When its next window then ends.
    pub due_ns: i64,
    /// Whether it then has said that data have stopped.
    pub silent: bool,
    /// What there is to say of a window.
    pub window: Option<AdvanceWindow>,
    /// Alarms, in order; each gets the next number as its `id`.
    pub alarms: Vec<Value>,
    /// Windows before this number keep neither their recording nor their job.
    pub forget_before: i64,
}

/// What a step says of a window.
pub struct AdvanceWindow {
    /// The window.
    pub number: i64,
    /// What is shown of it.
    pub row: Value,
    /// The job that is to work it from now on.
    pub job: Option<NewWindowJob>,
}

/// A job that works a window.
pub struct NewWindowJob {
    /// The job.
    pub job: NewJob,
    /// The recording, by an identifier that the job names; nothing where it is stored already.
    pub dataset: Option<(DatasetId, NewDataset)>,
}

/// A window as it is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredWindow {
    /// The number of the window.
    pub number: i64,
    /// The job that worked the window, where such a job is still kept.
    pub job: Option<JobId>,
    /// The recording of the window, where the recording is still kept.
    pub dataset: Option<DatasetId>,
    /// What is shown of the window.
    pub row: Value,
}

impl Store {
    /// Stores a monitor. Nothing where there are too many, or where the stream is gone.
    pub async fn insert_monitor(
        &self,
        new: NewMonitor,
    ) -> Result<Option<Submitted<MonitorRow>>, StoreError> {
        self.inner
            .writer
            .write(move |tx| Box::pin(step::insert(tx, new)))
            .await
    }

    /// What became of the monitor that came with this key before, if one did.
    pub async fn earlier_monitor(
        &self,
        idempotency: &Idempotency,
    ) -> Result<Option<Submitted<MonitorRow>>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        step::earlier(&mut connection, idempotency).await
    }

    /// A monitor, if there is one.
    pub async fn monitor(&self, id: MonitorId) -> Result<Option<MonitorRow>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        fetch(&mut connection, id).await
    }

    /// The project of a monitor, if there is one.
    pub async fn project_of_monitor(&self, id: MonitorId) -> Result<Option<Project>, StoreError> {
        let key = id.to_string();
        let name: Option<String> =
            database::query_scalar("select project from monitors where id = $1")
                .bind(&key)
                .fetch_optional(self.readers())
                .await?;
        name.map(|name| jobs::project(&key, &name)).transpose()
    }

    /// Monitors of a project, newest first, older than `before`.
    pub async fn monitors(
        &self,
        project: &Project,
        before: Option<MonitorId>,
        limit: u32,
    ) -> Result<Page<MonitorRow, MonitorId>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query
            .push(" where monitors.project = ")
            .push_bind(project.as_str().to_owned());
        if let Some(before) = before {
            query.push(" and id < ").push_bind(before.to_string());
        }
        query
            .push(" order by id desc limit ")
            .push_bind(i64::from(limit) + 1);
        let rows = query.build().fetch_all(self.readers()).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.id))
    }

    /// Removes a monitor with its windows, alarms and events. Jobs stay.
    pub async fn delete_monitor(&self, id: MonitorId) -> Result<bool, StoreError> {
        self.inner
            .writer
            .write(move |tx| Box::pin(step::delete(tx, id)))
            .await
    }

    /// Monitors that have something to do: a window is due, its job has ended, or data stopped. Those that are
    /// damaged are left out, noted and logged.
    pub async fn monitors_to_step(&self) -> Result<Vec<MonitorRow>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query.push(
            " where case when job is null then \
               exists (select 1 from streams where streams.identity = monitors.stream \
                and last_ns >= due_ns and due_ns <= ",
        );
        query.push_bind(i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(i64::MAX));
        query.push(
            ") \
              else not exists (select 1 from jobs where jobs.id = monitors.job \
                and finished_at is null) end \
             or silent = (select case when received_at >= ",
        );
        query.push(self.readers().kind().either(
            "strftime('%Y-%m-%dT%H:%M:%fZ', 'now', '-' || (patience_ms / 1000.0) || ' seconds')",
            "to_char(now() at time zone 'utc' - patience_ms * interval '1 millisecond', \
             'YYYY-MM-DD\"T\"HH24:MI:SS.MS\"Z\"')",
        ));
        query.push(
            " then 1 else 0 end from streams where streams.identity = monitors.stream) order by id",
        );
        let rows = query.build().fetch_all(self.readers()).await?;
        let sound = rows.iter().filter_map(|row| {
            read(row)
                .inspect_err(|error| {
                    self.note_damage(error);
                    tracing::error!(%error, "a monitor cannot go on");
                })
                .ok()
        });
        Ok(sound.collect())
    }

    /// Takes a step; says whether it was taken.
    pub async fn advance_monitor(&self, step: Advance) -> Result<bool, StoreError> {
        let (queue, quotas) = (self.inner.queue.clone(), self.inner.quotas);
        self.inner
            .writer
            .write(move |tx| Box::pin(step::advance((queue, quotas), tx, step)))
            .await
    }

    /// A window of a monitor.
    pub async fn monitor_window(
        &self,
        id: MonitorId,
        number: i64,
    ) -> Result<Option<StoredWindow>, StoreError> {
        let row = database::query(
            "select monitor, number, job, dataset, row, seal from monitor_windows \
             where monitor = $1 and number = $2",
        )
        .bind(id.to_string())
        .bind(number)
        .fetch_optional(self.readers())
        .await?;
        row.as_ref().map(window).transpose()
    }

    /// Windows of a monitor, newest first, before `before`.
    pub async fn monitor_windows(
        &self,
        id: MonitorId,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Page<StoredWindow, i64>, StoreError> {
        let rows = database::query(
            "select monitor, number, job, dataset, row, seal from monitor_windows \
             where monitor = $1 and number < $2 order by number desc limit $3",
        )
        .bind(id.to_string())
        .bind(before.unwrap_or(i64::MAX))
        .bind(i64::from(limit) + 1)
        .fetch_all(self.readers())
        .await?;
        let rows = rows.iter().map(window).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.number))
    }

    /// Alarms of a monitor, newest first, before `before`.
    pub async fn monitor_alarms(
        &self,
        id: MonitorId,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Page<(i64, Value), i64>, StoreError> {
        let rows = database::query(
            "select monitor, id, row, seal from monitor_alarms where monitor = $1 and id < $2 \
             order by id desc limit $3",
        )
        .bind(id.to_string())
        .bind(before.unwrap_or(i64::MAX))
        .bind(i64::from(limit) + 1)
        .fetch_all(self.readers())
        .await?;
        let alarm = |row: &Row| {
            MONITOR_ALARMS.verify(row)?;
            let alarm = from_json("alarm", row.try_get("monitor")?, row.try_get("row")?)?;
            Ok((row.try_get("id")?, alarm))
        };
        let rows = rows
            .iter()
            .map(alarm)
            .collect::<Result<Vec<_>, StoreError>>()?;
        Ok(Page::cut(rows, limit, |(number, _)| *number))
    }

    /// Events of a monitor with an id above `after`, in order, at most `limit`.
    ///
    /// # Errors
    /// One of them is damaged, or the database fails.
    pub async fn monitor_events_after(
        &self,
        id: MonitorId,
        after: i64,
        limit: u32,
    ) -> Result<Vec<StoredEvent>, StoreError> {
        let rows = database::query(
            "select monitor, id, name, data, seal from monitor_events where monitor = $1 and id > $2 \
             order by id limit $3",
        )
        .bind(id.to_string())
        .bind(after)
        .bind(limit)
        .fetch_all(self.readers())
        .await?;
        events::read(&MONITOR_EVENTS, &rows)
    }
}

const SELECT: &str = "select id, project, name, stream, spec, state, due_ns, job, silent, \
                      revision, last_event, last_alarm, created_at, seal from monitors";

async fn fetch(
    connection: &mut Connection,
    id: MonitorId,
) -> Result<Option<MonitorRow>, StoreError> {
    let mut query = QueryBuilder::new(SELECT);
    query.push(" where id = ").push_bind(id.to_string());
    let row = query.build().fetch_optional(connection).await?;
    row.as_ref().map(read).transpose()
}

fn read(row: &Row) -> Result<MonitorRow, StoreError> {
    MONITORS.verify(row)?;
    let id: String = row.try_get("id")?;
    let job: Option<String> = row.try_get("job")?;
    let stream: &str = row.try_get("stream")?;
    Ok(MonitorRow {
        project: jobs::project(&id, row.try_get("project")?)?,
        name: row.try_get("name")?,
        // A stream's name has no slash; what stands before one is its project.
        stream: stream.rsplit('/').next().unwrap_or_default().to_owned(),
        spec: from_json("specification", &id, row.try_get("spec")?)?,
        state: from_json("state", &id, row.try_get("state")?)?,
        due_ns: row.try_get("due_ns")?,
        job: job.as_deref().map(jobs::parse_id).transpose()?,
        silent: row.try_get::<i64>("silent")? != 0,
        revision: row.try_get("revision")?,
        last_event: row.try_get("last_event")?,
        last_alarm: row.try_get("last_alarm")?,
        created_at: time(&id, row.try_get("created_at")?)?,
        id: id.parse().map_err(|why| corrupt("identifier", &id, why))?,
    })
}

fn window(row: &Row) -> Result<StoredWindow, StoreError> {
    MONITOR_WINDOWS.verify(row)?;
    let job: Option<String> = row.try_get("job")?;
    let dataset: Option<String> = row.try_get("dataset")?;
    let dataset = dataset.map(|id| id.parse().map_err(|why| corrupt("identifier", &id, why)));
    Ok(StoredWindow {
        number: row.try_get("number")?,
        job: job.as_deref().map(jobs::parse_id).transpose()?,
        dataset: dataset.transpose()?,
        row: from_json("window", row.try_get("monitor")?, row.try_get("row")?)?,
    })
}
