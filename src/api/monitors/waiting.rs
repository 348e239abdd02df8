//! What a monitor waits for, in numbers and in words.

use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::stored::clock_ns;
use crate::api::error::Answer;
use crate::monitor::state::instant;
use crate::store::{MonitorRow, Streams};

/// What a monitor waits for.
#[derive(Serialize, ToSchema)]
pub struct WaitsFor {
    /// The number of the window.
    window: i64,
    /// The first instant of the window.
    #[schema(value_type = String, format = DateTime)]
    from: Timestamp,
    /// The instant at which the window ends; that instant belongs to the next window.
    #[schema(value_type = String, format = DateTime)]
    to: Timestamp,
    /// The instant at or after which the stream must have a sample.
    #[schema(value_type = String, format = DateTime)]
    due: Timestamp,
    /// The newest sample of the stream that is not ahead of the server's clock; `null` where there is
    /// none.
    #[schema(value_type = Option<String>, format = DateTime)]
    reached: Option<Timestamp>,
    /// A sentence with the instants.
    detail: String,
}

impl WaitsFor {
    pub(super) async fn of(streams: &Streams, row: &MonitorRow) -> Answer<Option<Self>> {
        if row.job.is_some() {
            return Ok(None);
        }
        let (from, to) = row.state.span(&row.spec.window);
        let stream = streams.find(&row.project, &row.stream).await?;
        let reached = match &stream {
            Some(stream) => streams.last_instant(stream, clock_ns()).await?,
            None => None,
        };
        let (from, to, due) = (instant(from), instant(to), instant(row.due_ns));
        let reached = reached.map(instant);
        let newest = match reached {
            Some(reached) => format!("its newest is at {reached}"),
            None => "it has none".to_owned(),
        };
        let (window, name) = (row.state.next, &row.stream);
        let detail = format!(
            "window {window}, {from} to {to}, is worked when stream `{name}` has a sample at or after \
             {due}; {newest}"
        );
        Ok(Some(Self {
            window,
            from,
            to,
            due,
            reached,
            detail,
        }))
    }
}
