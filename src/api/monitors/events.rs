//! The events of a monitor as a stream.

use std::sync::Arc;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::response::Response;
use tokio::sync::watch;

use super::stored::monitor;
use crate::api::error::Answer;
use crate::api::event_streams::EventStreams;
use crate::api::events::{EventsQuery, Follow, StreamedEvent, follow, last_event_id};
use crate::api::extract::Named;
use crate::api::query::Params;
use crate::event::EventHub;
use crate::job::MonitorId;
use crate::store::{Store, StoreError, StoredEvent};

/// Events that are read at once.
const EVENTS: u32 = 200;

/// Follow a monitor.
///
/// Server-sent events `window`, each time there is something new to say of one, and `alarm`, with ids
/// 1, 2, 3 … without a gap. Each event is stored before it is sent; a client that comes back with
/// `Last-Event-ID` misses none. The stream ends when the monitor is removed.
#[utoipa::path(
    get, path = "/v1/monitors/{id}/events", operation_id = "follow_monitor", tag = "monitors",
    params(
        ("id" = MonitorId, Path, description = "The monitor"),
        EventsQuery,
        ("Last-Event-ID" = Option<i64>, Header, minimum = 0, maximum = 9007199254740991_i64,
         description = "The last event that the client has; wins over `last_event_id`")
    ),
    responses((status = 200, content_type = "text/event-stream", body = StreamedEvent,
               description = "The events, one after the other"))
)]
pub async fn events(
    State(streams): State<EventStreams>,
    Named(id): Named<MonitorId>,
    Params(query): Params<EventsQuery>,
    headers: HeaderMap,
) -> Answer<Response> {
    let last = last_event_id(&headers)?.or(query.last_event_id);
    monitor(streams.store.monitors(), id).await?;
    let permit = streams.permit()?;
    let feed = MonitorFeed {
        news: streams.hub.monitor_news(),
        hub: streams.hub.clone(),
        store: streams.store.clone(),
        id,
        after: last.unwrap_or(0),
    };
    Ok(follow(feed, id.to_string(), permit))
}

/// The events of a monitor.
struct MonitorFeed {
    news: watch::Receiver<u64>,
    hub: EventHub,
    store: Store,
    id: MonitorId,
    after: i64,
}

impl Follow for MonitorFeed {
    async fn next(&mut self) -> Result<Option<Vec<Arc<StoredEvent>>>, StoreError> {
        loop {
            self.news.mark_unchanged();
            let page = |limit| {
                self.store
                    .monitors()
                    .events_after(self.id, self.after, limit)
            };
            let events = match page(EVENTS).await {
                // Events before a damaged one are handed out one by one.
                Err(error) if error.corrupt_row().is_some() => {
                    self.store.damage().note(&error);
                    page(1).await?
                }
                events => events?,
            };
            if let Some(last) = events.last() {
                self.after = last.id;
                return Ok(Some(events.into_iter().map(Arc::new).collect()));
            }
            if self.store.monitors().find(self.id).await?.is_none() {
                return Ok(None);
            }
            tokio::select! {
                biased;
                () = self.hub.closed() => return Ok(None),
                news = self.news.changed() => if news.is_err() { return Ok(None) },
            }
        }
    }
}
