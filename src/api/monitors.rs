//! Monitors: jobs that are done again and again, on a window of a stream after the other.

mod check;
mod csv;
pub mod events;
pub mod moving;
mod stored;
mod waiting;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::ApiState;
use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::http_headers::{json, prefers, tagged_json};
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use super::submit;
use crate::job::MonitorId;
use crate::monitor::state::instant;
use crate::monitor::{Alarm, MonitorSpec, ShownWindow, State as MonitorState};
use crate::store::{MonitorRow, Monitors, NewMonitor, Streams};
use greybox::parsing::Fault;
use stored::{monitor, no_monitor};
use waiting::WaitsFor;

/// Windows that a monitor shows of itself, and alarms.
const SHOWN_WINDOWS: u32 = 100;
const SHOWN_ALARMS: u32 = 20;

/// A monitor as it stands.
#[derive(Serialize, ToSchema)]
pub struct Monitor {
    /// The identifier of the monitor.
    id: MonitorId,
    /// A name for people.
    name: Option<String>,
    /// The stream that the monitor watches.
    stream: String,
    /// What the monitor is doing.
    status: MonitorStatus,
    /// The specification of the monitor.
    spec: MonitorSpec,
    /// The window that is worked, or the next that will be.
    next_window: i64,
    /// The instant at or after which the stream must have a sample for `next_window` to be worked.
    #[schema(value_type = String, format = DateTime)]
    due: Timestamp,
    /// When the monitor was accepted.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
}

/// What a monitor is doing.
#[derive(Clone, Copy, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum MonitorStatus {
    /// It waits for samples.
    Waiting,
    /// A job works a window.
    Working,
    /// It waits for samples, and none have come for too long.
    DataStopped,
}

/// A monitor with what it has found out.
#[derive(Serialize, ToSchema)]
pub struct ShownMonitor {
    /// The monitor.
    #[serde(flatten)]
    monitor: Monitor,
    /// The newest windows, a hundred at the most, the oldest first: each parameter over time with
    /// intervals. `…/windows` has all windows.
    windows: Vec<ShownWindow>,
    /// The newest alarms, twenty at the most, the newest first. `…/alarms` has all alarms.
    alarms: Vec<Alarm>,
    /// The window and the samples that the monitor waits for; `null` while a job works a window.
    waits_for: Option<WaitsFor>,
}

impl Monitor {
    fn new(row: MonitorRow) -> Self {
        let status = match (row.job, row.silent) {
            (Some(_), _) => MonitorStatus::Working,
            (None, true) => MonitorStatus::DataStopped,
            (None, false) => MonitorStatus::Waiting,
        };
        Self {
            id: row.id,
            name: row.name,
            stream: row.stream,
            status,
            due: instant(row.due_ns),
            next_window: row.state.next,
            spec: row.spec,
            created_at: row.created_at,
        }
    }
}

/// Watch a stream.
///
/// The stream is there, with two samples at the least. Each window, as soon as the stream has a sample
/// beyond its end, becomes a recording and a job, one after the other; the estimate of one is where
/// the search of the next begins, and its prior. A window that would say nothing of the parameters is
/// quiet: nothing is estimated. An alarm is raised when a parameter changes by more than its intervals allow, when
/// estimates can be trusted less than before, when windows no longer come to an estimate, and
/// when data stop.
#[utoipa::path(
    post, path = "/v1/monitors", operation_id = "create_monitor", tag = "monitors",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "Makes the request safe to repeat: the same key and body give the same \
                           monitor again, as long as it is there")),
    request_body(content = MonitorSpec, content_type = "application/json"),
    responses(
        (status = 201, description = "The stream is watched", body = Monitor,
         headers(("Location" = String, description = "Where the monitor is"),
                 ("Idempotent-Replayed" = String,
                  description = "`true` when this answers an earlier request again"))),
        (status = 409, description = "There are too many monitors, or what this key made is gone")
    )
)]
pub async fn create(
    State(state): State<ApiState>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let idempotency = submit::idempotency(&headers, &client, &document)?;
    if let Some(idempotency) = &idempotency
        && let Some(earlier) = state.store.monitors().earlier(idempotency).await?
    {
        let (row, replayed) = submit::stored(earlier)?;
        return Ok(created(row, replayed));
    }
    let mut spec = MonitorSpec::read(&document.value).map_err(Problem::of_document)?;
    let Some(stream) = state
        .store
        .streams()
        .find(&client.project, &spec.stream)
        .await?
    else {
        let detail = format!("there is no stream `{}`", spec.stream);
        let fault = Fault::new("/stream", "unknown_stream", detail);
        return Err(Problem::of_document(vec![fault]));
    };
    check::check(&state, &mut spec, &stream, &client).await?;
    let from = spec.window.from.or(stream.first);
    let from = from.unwrap_or_else(Timestamp::now);
    let origin_ns = i64::try_from(from.as_nanosecond()).map_err(|_| {
        let detail = format!("{from} is too far away");
        Problem::of_document(vec![Fault::new("/window/from", "out_of_range", detail)])
    })?;
    let knows = MonitorState::new(origin_ns);
    let new = NewMonitor {
        project: client.project,
        name: spec.name.clone(),
        stream: spec.stream.clone(),
        due_ns: knows.due(&spec.window),
        state: knows,
        patience: spec.patience(),
        spec,
        idempotency,
    };
    let inserted = state.store.monitors().insert(new).await?.ok_or_else(|| {
        let detail = "there are as many monitors as there may be, or the stream has just gone";
        Problem::new(Kind::WrongState, detail)
    })?;
    let (row, replayed) = submit::stored(inserted)?;
    Ok(created(row, replayed))
}

fn created(row: MonitorRow, replayed: bool) -> Response {
    let location = HeaderValue::from_str(&format!("/v1/monitors/{}", row.id));
    let mut response = json(StatusCode::CREATED, &Monitor::new(row));
    let location = location.expect("an identifier is visible ASCII");
    response.headers_mut().insert(header::LOCATION, location);
    if replayed {
        let name = HeaderName::from_static("idempotent-replayed");
        let value = HeaderValue::from_static("true");
        response.headers_mut().insert(name, value);
    }
    response
}

/// The page of a list.
pub struct WhichMonitors(Cursor<MonitorId>);

impl FromQuery for WhichMonitors {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// List monitors, newest first.
#[utoipa::path(
    get, path = "/v1/monitors", operation_id = "list_monitors", tag = "monitors",
    params(PageParams),
    responses((status = 200, description = "A page of monitors", body = Page<Monitor>,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(monitors): State<Monitors>,
    client: Client,
    Params(WhichMonitors(cursor)): Params<WhichMonitors>,
    uri: Uri,
) -> Answer {
    let page = monitors
        .list(&client.project, cursor.before, cursor.limit)
        .await?;
    let items = page.rows.into_iter().map(Monitor::new).collect();
    Ok(Page::new(items, page.next.map(|id| id.to_string())).answer(&uri))
}

/// Show a monitor: each parameter over time with its intervals, and its alarms.
#[utoipa::path(
    get, path = "/v1/monitors/{id}", operation_id = "show_monitor", tag = "monitors",
    params(("id" = MonitorId, Path, description = "The monitor")),
    responses((status = 200, description = "The monitor", body = ShownMonitor))
)]
pub async fn show(
    State(monitors): State<Monitors>,
    State(streams): State<Streams>,
    Named(id): Named<MonitorId>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    let row = monitor(&monitors, id).await?;
    let windows = monitors.windows(id, None, SHOWN_WINDOWS).await?;
    let mut windows = windows.rows;
    windows.reverse();
    let alarms = monitors.alarms(id, None, SHOWN_ALARMS).await?;
    let shown = ShownMonitor {
        waits_for: WaitsFor::of(&streams, &row).await?,
        monitor: Monitor::new(row),
        windows,
        alarms: alarms.rows,
    };
    Ok(tagged_json(&headers, &shown))
}

/// Stop watching. Jobs and recordings of windows stay.
#[utoipa::path(
    delete, path = "/v1/monitors/{id}", operation_id = "remove_monitor", tag = "monitors",
    params(("id" = MonitorId, Path, description = "The monitor")),
    responses((status = 204, description = "It is removed"))
)]
pub async fn remove(
    State(monitors): State<Monitors>,
    Named(id): Named<MonitorId>,
    _query: Params<NoQuery>,
) -> Answer {
    if monitors.delete(id).await? {
        Ok(StatusCode::NO_CONTENT.into_response())
    } else {
        Err(no_monitor(id))
    }
}

/// The page of a list by number.
pub struct WhichNumbers(Cursor<i64>);

impl FromQuery for WhichNumbers {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// List the windows of a monitor, newest first: each parameter over time with its intervals, as JSON
/// or as CSV.
#[utoipa::path(
    get, path = "/v1/monitors/{id}/windows", operation_id = "list_monitor_windows",
    tag = "monitors",
    params(("id" = MonitorId, Path, description = "The monitor"), PageParams),
    responses((status = 200, description = "A page of windows",
               content((Page<ShownWindow> = "application/json"), (String = "text/csv")),
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn windows(
    State(monitors): State<Monitors>,
    Named(id): Named<MonitorId>,
    Params(WhichNumbers(cursor)): Params<WhichNumbers>,
    headers: HeaderMap,
    uri: Uri,
) -> Answer {
    monitor(&monitors, id).await?;
    let page = monitors.windows(id, cursor.before, cursor.limit);
    let page = page.await?;
    let text = prefers(&headers, "text/csv").then(|| csv::table(&page.rows));
    let page = Page::new(page.rows, page.next.map(|number| number.to_string()));
    let mut response = page.answer(&uri);
    if let Some(text) = text {
        *response.body_mut() = text.into();
        let csv_type = HeaderValue::from_static("text/csv; charset=utf-8");
        response
            .headers_mut()
            .insert(header::CONTENT_TYPE, csv_type);
    }
    Ok(response)
}

/// List the alarms of a monitor, newest first.
#[utoipa::path(
    get, path = "/v1/monitors/{id}/alarms", operation_id = "list_alarms", tag = "monitors",
    params(("id" = MonitorId, Path, description = "The monitor"), PageParams),
    responses((status = 200, description = "A page of alarms", body = Page<Alarm>,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn alarms(
    State(monitors): State<Monitors>,
    Named(id): Named<MonitorId>,
    Params(WhichNumbers(cursor)): Params<WhichNumbers>,
    uri: Uri,
) -> Answer {
    monitor(&monitors, id).await?;
    let page = monitors.alarms(id, cursor.before, cursor.limit);
    let page = page.await?;
    Ok(Page::new(page.rows, page.next.map(|number| number.to_string())).answer(&uri))
}
