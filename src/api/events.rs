//! The events of a job as a stream: everything from the first (or after the last that the client
//! has), then live.
//!
//! A stream reads its events from the store in pages, only as fast as its client takes them: a
//! slow reader costs one page of memory and delays no one. The hub merely says that there is more.

use std::convert::Infallible;
use std::fmt::Write as _;
use std::sync::Arc;
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use serde_json::json;
use utoipa::{IntoParams, ToSchema};

use super::error::{Answer, Kind};
use super::event_streams::EventStreams;
use super::extract::Named;
use super::http_headers::header_fault;
use super::jobs::no_job;
use super::query::{FromQuery, Params, QueryReader};
use crate::admission::Permit;
use crate::event::Feed;
use crate::store::{StoreError, StoredEvent};
use greybox::identification::JobId;

/// What the answer is called.
pub(super) const EVENT_STREAM: HeaderValue = HeaderValue::from_static("text/event-stream");
/// After so long without an event a comment shows that the stream lives.
pub(super) const KEEP_ALIVE: Duration = Duration::from_secs(15);
/// How soon a client that lost its stream comes back.
pub(super) const RETRY: &str = "retry: 2000\n\n";
/// What shows that the stream lives.
pub(super) const COMMENT: &str = ": alive\n\n";

/// The largest id of an event that a client may name: what every client's numbers hold exactly.
const MAX_EVENT_ID: u64 = (1 << 53) - 1;

/// Where to go on.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct EventsQuery {
    /// The last event that the client has, for clients that cannot set `Last-Event-ID`.
    #[param(minimum = 0, maximum = 9007199254740991_i64)]
    pub last_event_id: Option<i64>,
}

impl FromQuery for EventsQuery {
    fn read(query: &mut QueryReader) -> Self {
        let last = query.integer("last_event_id", 0, MAX_EVENT_ID);
        Self {
            last_event_id: last.map(u64::cast_signed),
        }
    }
}

/// Follow a job.
///
/// Server-sent events `state`, `generation`, `refinement`, `posterior`, `result` and, always last, `end`, with
/// ids 1, 2, 3 … without a gap. Each event is stored before it is sent; a client that comes back
/// with `Last-Event-ID` misses none.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/events", operation_id = "follow_job", tag = "jobs",
    params(
        ("id" = JobId, Path, description = "The job"),
        EventsQuery,
        ("Last-Event-ID" = Option<i64>, Header, minimum = 0, maximum = 9007199254740991_i64,
         description = "The last event that the client has; wins over `last_event_id`")
    ),
    responses(
        (status = 200, content_type = "text/event-stream", body = StreamedEvent,
         description = "The events, one after the other"),
        (status = 204, description = "The job has ended and the client has all its events")
    )
)]
pub async fn events(
    State(streams): State<EventStreams>,
    Named(id): Named<JobId>,
    Params(query): Params<EventsQuery>,
    headers: HeaderMap,
) -> Answer {
    let last = last_event_id(&headers)?.or(query.last_event_id);
    let row = streams
        .store
        .jobs()
        .find(id)
        .await?
        .ok_or_else(|| no_job(id))?;
    let after = last.unwrap_or(0);
    if row.status.is_terminal() && after >= row.last_event {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let permit = streams.permit()?;
    let feed = streams.hub.feed(streams.store.clone(), id, after);
    Ok(follow(feed, id.to_string(), permit))
}

/// Events that are stored, then those to come.
pub(super) trait Follow: Send + 'static {
    /// The next of them, as soon as there are any; nothing when no more will come.
    fn next(
        &mut self,
    ) -> impl Future<Output = Result<Option<Vec<Arc<StoredEvent>>>, StoreError>> + Send;
}

impl Follow for Feed {
    async fn next(&mut self) -> Result<Option<Vec<Arc<StoredEvent>>>, StoreError> {
        Feed::next(self).await
    }
}

/// Streams the events of what has this identifier.
pub(super) fn follow(feed: impl Follow, of: String, permit: Permit) -> Response {
    let replay = Replay {
        feed,
        of,
        greeted: false,
        broken: false,
        _permit: permit,
    };
    replay.into_response()
}

/// An event as it is streamed. Comments and `retry` come between.
#[derive(ToSchema)]
pub struct StreamedEvent {
    /// 1, 2, 3 … without a gap.
    #[schema(example = "17")]
    pub id: String,
    /// `state`, `generation`, `refinement`, `posterior`, `result` or `end`.
    #[schema(example = "refinement")]
    pub event: String,
    /// One line of JSON, an `Event`.
    #[schema(example = r#"{"iteration":3,"cost":1.1e-6}"#)]
    pub data: String,
}

/// `Last-Event-ID`, which browsers send when they come back; an empty one counts as none.
pub(super) fn last_event_id(headers: &HeaderMap) -> Answer<Option<i64>> {
    let Some(value) = headers
        .get("last-event-id")
        .filter(|value| !value.is_empty())
    else {
        return Ok(None);
    };
    let number = value
        .to_str()
        .ok()
        .and_then(|text| text.parse::<u64>().ok());
    match number.filter(|number| *number <= MAX_EVENT_ID) {
        Some(number) => Ok(Some(number.cast_signed())),
        None => {
            let detail = format!("an event's id is a whole number from 1 to {MAX_EVENT_ID}");
            Err(header_fault("Last-Event-ID", detail))
        }
    }
}

/// One client's way through events.
struct Replay<F> {
    feed: F,
    of: String,
    greeted: bool,
    /// Whether the stream has told why it ends.
    broken: bool,
    _permit: Permit,
}

impl<F: Follow> Replay<F> {
    fn into_response(self) -> Response {
        let chunks = stream::unfold(self, |mut replay| async move {
            let chunk = replay.next().await?;
            Some((Ok::<_, Infallible>(chunk), replay))
        });
        streamed(Body::from_stream(chunks))
    }

    /// The next piece of the stream; `None` at its end.
    async fn next(&mut self) -> Option<Bytes> {
        if !self.greeted {
            self.greeted = true;
            return Some(Bytes::from_static(RETRY.as_bytes()));
        }
        match tokio::time::timeout(KEEP_ALIVE, self.feed.next()).await {
            Err(_silence) => Some(Bytes::from_static(COMMENT.as_bytes())),
            Ok(Ok(events)) => events.map(|events| written(&events)),
            Ok(Err(_)) if self.broken => None,
            Ok(Err(error)) => {
                tracing::error!(%error, of = self.of, "an event stream broke off");
                self.broken = true;
                error.corrupt_row().map(|_| told_of_damage(&error))
            }
        }
    }
}

/// The last event of a stream that comes to a damaged one: it has no id and names the damage.
fn told_of_damage(error: &StoreError) -> Bytes {
    let data = json!({"type": Kind::DamagedData.uri(), "detail": error.to_string()});
    format!("event: problem\ndata: {data}\n\n").into()
}

/// A stream of events as an answer.
pub(super) fn streamed(body: Body) -> Response {
    let mut response = Response::new(body);
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, EVENT_STREAM);
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert("x-accel-buffering", HeaderValue::from_static("no"));
    response
}

/// Events in the form of the stream. Their data are one line each.
fn written(events: &[Arc<StoredEvent>]) -> Bytes {
    let mut text = String::new();
    for event in events {
        let StoredEvent { id, name, data } = &**event;
        write!(text, "id: {id}\nevent: {name}\ndata: {data}\n\n")
            .expect("writing to a string does not fail");
    }
    text.into()
}
