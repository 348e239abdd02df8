//! Moving a monitor to another window: what brings one back that waits for samples which never come.

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use jiff::Timestamp;
use utoipa::ToSchema;

use super::Monitor;
use super::stored::monitor;
use crate::api::body::JsonDocument;
use crate::api::error::{Answer, Kind, Problem};
use crate::api::extract::Named;
use crate::api::http_headers::json;
use crate::api::query::{NoQuery, Params};
use crate::job::MonitorId;
use crate::monitor::WindowStatus;
use crate::monitor::state::instant;
use crate::store::{Advance, Monitors};
use greybox::parsing::Fault;
use greybox::parsing::reader::read_document;

/// Windows that are looked through for the newest that was worked.
const LOOKED_THROUGH: u32 = 1000;

/// Where a monitor is to go on.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"from": "2026-03-02T08:15:00+01:00"}))]
pub struct MonitorMove {
    /// The next window is the first that begins at this instant or later.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
}

impl MonitorMove {
    fn read(document: &serde_json::Value) -> Result<Self, Vec<Fault>> {
        read_document(document, |field| {
            let mut root = field.object()?;
            let from = root.required("from").and_then(|field| field.instant());
            root.finish();
            Some(Self { from: from? })
        })
    }
}

/// Have a monitor go on with another window.
///
/// The windows between are left out, or are worked where the monitor had left them out before. A window
/// that was worked is not worked again, so that no estimate counts twice.
#[utoipa::path(
    post, path = "/v1/monitors/{id}/move", operation_id = "move_monitor", tag = "monitors",
    params(("id" = MonitorId, Path, description = "The monitor")),
    request_body(content = MonitorMove, content_type = "application/json"),
    responses((status = 200, description = "It goes on there", body = Monitor),
              (status = 409, description = "A job works a window just now"))
)]
pub async fn move_to(
    State(monitors): State<Monitors>,
    Named(id): Named<MonitorId>,
    _query: Params<NoQuery>,
    _headers: HeaderMap,
    document: JsonDocument,
) -> Answer {
    let wanted = MonitorMove::read(&document.value).map_err(Problem::of_document)?;
    let row = monitor(&monitors, id).await?;
    let at_work = || {
        let detail = "a job works a window just now; move the monitor when it has ended";
        Problem::new(Kind::WrongState, detail)
    };
    if row.job.is_some() {
        return Err(at_work());
    }
    let (plan, mut knows) = (row.spec.window, row.state.clone());
    let newest = monitors.windows(id, None, LOOKED_THROUGH).await?;
    let mut newest = newest.rows.iter().map(|row| &row.window);
    let worked = newest.find(|window| window.status != WindowStatus::NoData);
    let first = worked.map_or(0, |window| window.number + 1);
    knows.move_to(&plan, wanted.from);
    if knows.next < first {
        knows.next = first;
        let (from, _) = knows.span(&plan);
        let detail = format!(
            "windows before {} were worked; the first that may come next begins then",
            instant(from)
        );
        return Err(Problem::of_document(vec![Fault::new(
            "/from",
            "window_was_worked",
            detail,
        )]));
    }
    let moved = Advance {
        due_ns: knows.due(&plan),
        state: knows,
        silent: row.silent,
        window: None,
        alarms: Vec::new(),
        forget_before: first - i64::from(row.spec.keep_jobs),
        from: row,
    };
    if !monitors.advance(moved).await? {
        return Err(at_work());
    }
    Ok(json(
        StatusCode::OK,
        &Monitor::new(monitor(&monitors, id).await?),
    ))
}
