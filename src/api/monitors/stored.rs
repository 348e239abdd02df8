//! Monitors as they are stored: found, and read back.

use axum::http::StatusCode;
use jiff::Timestamp;

use crate::api::error::{Answer, Problem};
use crate::job::MonitorId;
use crate::monitor::{MonitorSpec, State as MonitorState};
use crate::store::{MonitorRow, Monitors};

/// The monitor of an identifier.
pub(super) async fn monitor(monitors: &Monitors, id: MonitorId) -> Answer<MonitorRow> {
    let row = monitors.find(id).await?;
    row.ok_or_else(|| no_monitor(id))
}

/// There is no such monitor.
pub(super) fn no_monitor(id: MonitorId) -> Problem {
    Problem::not_found("monitor", &id.to_string())
}

/// What a monitor was asked for, and what it knows.
pub(super) fn understood(row: &MonitorRow) -> Answer<(MonitorSpec, MonitorState)> {
    let unreadable = |_| {
        tracing::error!(monitor = %row.id, "a stored monitor does not read back");
        Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR)
    };
    let spec = MonitorSpec::deserialized(&row.spec).map_err(unreadable)?;
    let state = serde_json::from_value(row.state.clone()).map_err(unreadable)?;
    Ok((spec, state))
}

/// The server's clock, nanoseconds since 1970.
pub(super) fn clock_ns() -> i64 {
    i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(i64::MAX)
}
