//! Monitors as they are stored: found, and read back.

use jiff::Timestamp;

use crate::api::error::{Answer, Problem};
use crate::job::MonitorId;
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

/// The server's clock, nanoseconds since 1970.
pub(super) fn clock_ns() -> i64 {
    i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(i64::MAX)
}
