//! A monitor and its windows, as they are stored and read.

use std::time::Duration;

use jiff::Timestamp;

use crate::access::Project;
use crate::job::MonitorId;
use crate::monitor::{Alarm, MonitorSpec, MonitorWindow, ShownWindow, State};
use crate::store::columns::{self, from_json, time};
use crate::store::database::{Connection, QueryBuilder, Row};
use crate::store::datasets::NewDataset;
use crate::store::idempotency::Idempotency;
use crate::store::sealed::{MONITOR_STATES, MONITOR_WINDOW_JOBS, MONITOR_WINDOWS, MONITORS};
use crate::store::submit::NewJob;
use crate::store::{StoreError, corrupt};
use greybox::identification::{DatasetId, JobId};

/// A monitor to be stored.
#[derive(Clone, Debug)]
pub struct NewMonitor {
    /// The project that the monitor and the stream belong to.
    pub project: Project,
    /// A name for people.
    pub name: Option<String>,
    /// The stream that the monitor watches.
    pub stream: String,
    /// The specification of the monitor.
    pub spec: MonitorSpec,
    /// What the monitor knows at first.
    pub state: State,
    /// When the first window ends, nanoseconds since 1970.
    pub due_ns: i64,
    /// How long the monitor waits for data before the monitor says that data stopped.
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
    pub spec: MonitorSpec,
    /// What the monitor knows by now.
    pub state: State,
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
    /// What the monitor knows after the step.
    pub state: State,
    /// When the next window ends after the step.
    pub due_ns: i64,
    /// Whether the monitor has said, after the step, that data have stopped.
    pub silent: bool,
    /// What there is to say of a window.
    pub window: Option<AdvanceWindow>,
    /// Alarms, in order; each gets the next number as its `id`.
    pub alarms: Vec<Alarm>,
    /// Windows before this number keep neither their recording nor their job.
    pub forget_before: i64,
}

/// What a step says of a window.
pub struct AdvanceWindow {
    /// What is shown of the window.
    pub window: MonitorWindow,
    /// The job that is to work the window from now on.
    pub job: Option<NewWindowJob>,
}

impl From<MonitorWindow> for AdvanceWindow {
    fn from(window: MonitorWindow) -> Self {
        Self { window, job: None }
    }
}

/// A job that works a window.
pub struct NewWindowJob {
    /// The job.
    pub job: NewJob,
    /// The recording, by an identifier that the job names; nothing where it is stored already.
    pub dataset: Option<(DatasetId, NewDataset)>,
}

pub(super) const SELECT: &str = "select id, project, name, stream, spec, state, due_ns, job, patience_ms, \
                      silent, revision, last_event, last_alarm, created_at, seal, state_seal from monitors";

pub(super) async fn fetch(
    connection: &mut Connection,
    id: MonitorId,
) -> Result<Option<MonitorRow>, StoreError> {
    let mut query = QueryBuilder::new(SELECT);
    query.push(" where id = ").push_bind(id.to_string());
    let row = query.build().fetch_optional(connection).await?;
    row.as_ref().map(read).transpose()
}

pub(super) fn read(row: &Row) -> Result<MonitorRow, StoreError> {
    MONITORS.verify(row)?;
    MONITOR_STATES.verify(row)?;
    let id: String = row.try_get("id")?;
    let job: Option<String> = row.try_get("job")?;
    let stream: &str = row.try_get("stream")?;
    Ok(MonitorRow {
        project: columns::project(&id, row.try_get("project")?)?,
        name: row.try_get("name")?,
        // A stream's name has no slash; what stands before one is its project.
        stream: stream.rsplit('/').next().unwrap_or_default().to_owned(),
        spec: from_json("specification", &id, row.try_get("spec")?)?,
        state: from_json("state", &id, row.try_get("state")?)?,
        due_ns: row.try_get("due_ns")?,
        job: job.as_deref().map(columns::parse_id).transpose()?,
        silent: row.try_get::<i64>("silent")? != 0,
        revision: row.try_get("revision")?,
        last_event: row.try_get("last_event")?,
        last_alarm: row.try_get("last_alarm")?,
        created_at: time(&id, row.try_get("created_at")?)?,
        id: id.parse().map_err(|why| corrupt("identifier", &id, why))?,
    })
}

pub(super) fn window(row: &Row) -> Result<ShownWindow, StoreError> {
    MONITOR_WINDOWS.verify(row)?;
    MONITOR_WINDOW_JOBS.verify(row)?;
    let job: Option<String> = row.try_get("job")?;
    let dataset: Option<String> = row.try_get("dataset")?;
    let dataset = dataset.map(|id| id.parse().map_err(|why| corrupt("identifier", &id, why)));
    Ok(ShownWindow {
        window: from_json("window", row.try_get("monitor")?, row.try_get("row")?)?,
        job: job.as_deref().map(columns::parse_id).transpose()?,
        dataset: dataset.transpose()?,
    })
}
