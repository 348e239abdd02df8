//! Recordings that grow: append, list, show, cut out, remove.

mod csv;
pub mod cut;
pub mod marks;
pub mod removal;
pub(super) mod stamps;

use std::ops::Range;
use std::str::FromStr;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::body::scratch_failed;
use super::client::Client;
use super::datasets::{FileBytes, RecordingDocument, SMALLER, digest, kind_of};
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName};
use super::http_headers::{idempotency_key, json, prefers, tagged_json};
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use super::reading::{GivenOptions, ReadingQuery};
use crate::access::{Project, Scope, is_stream_name};
use crate::monitor::MAX_WINDOW_SAMPLES;
use crate::store::{
    Appended, BatchOutcome, Idempotency, Keep, MAX_STREAMS, NewBatch, Store, StoreError,
    StreamRemoval, StreamRow, Streams, UnmarkedRows,
};
use greybox::intake::{self, Options, ReadingPurpose};
use greybox::parsing::Fault;
use greybox::recording::{MAX_SIGNALS, Recording, RecordingSource, Samples};
use stamps::{invalid, nanoseconds};

/// The most that a stream may keep `[MiB]`.
const MAX_KEEP_MIB: u64 = 1 << 16;
/// Points of a plot when the client does not say, and at the most.
const DEFAULT_POINTS: u64 = 2000;
const MAX_POINTS: u64 = 100_000;

/// The name of a stream.
pub struct StreamName(String);

impl FromStr for StreamName {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        is_stream_name(text)
            .then(|| Self(text.to_owned()))
            .ok_or(())
    }
}

impl PathName for StreamName {
    const WHAT: &'static str = "stream (its name has letters, digits, `.`, `_` and `-`, 100 of \
                                them at the most) called";

    async fn project(&self, _store: &Store) -> Result<Option<Project>, StoreError> {
        Ok(None)
    }
}

/// What of the stream is kept.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct KeepQuery {
    /// From now on, how long samples are kept before the newest one `[s]`; for ever until it is said.
    /// They go in stretches, the oldest first.
    #[param(exclusive_minimum = 0)]
    pub keep_s: Option<f64>,
    /// From now on, how much is kept `[MiB]`; 256 until it is said.
    #[param(minimum = 1, maximum = 65_536)]
    pub keep_mib: Option<u64>,
}

/// The options of a batch, and all of its query as it came.
pub struct BatchQuery {
    options: GivenOptions,
    given: Vec<(&'static str, String)>,
    keep: Keep,
}

impl FromQuery for BatchQuery {
    fn read(query: &mut QueryReader) -> Self {
        let options = GivenOptions::read(query);
        let mut given = options.as_they_came();
        let seconds = query.number("keep_s");
        if seconds.is_some_and(|seconds| seconds <= 0.0) {
            query.fault("keep_s", "not_positive", "it is not above 0".to_owned());
        }
        let mib = query.integer("keep_mib", 1, MAX_KEEP_MIB);
        let mib = mib.map(|mib| u32::try_from(mib).expect("the limit is small"));
        given.extend(seconds.map(|seconds| ("keep_s", seconds.to_string())));
        given.extend(mib.map(|mib| ("keep_mib", mib.to_string())));
        Self {
            options,
            given,
            keep: Keep { seconds, mib },
        }
    }
}

/// Append samples to a stream.
///
/// The body is that of `POST /v1/datasets`, in any of its formats, and says when its samples were
/// taken: by timestamps, or by `start` in JSON. One sample is enough, and each keeps its instant. The
/// first batch makes the stream. Batches may come in any order and more than once: samples are put in
/// their place, one that says something else of an instant replaces what was there, and a missing one
/// changes nothing. Stamps more than a day ahead of the server's clock are refused. With an `Idempotency-Key` the
/// same body is answered as it was the first time. Signals may come that were not there before; each
/// keeps the unit that it first had in SI.
#[utoipa::path(
    post, path = "/v1/streams/{name}", operation_id = "append_to_stream", tag = "streams",
    params(
        ("name" = String, Path, description = "The stream", pattern = "^[A-Za-z0-9._-]{1,100}$",
         example = "rig-4"),
        ReadingQuery,
        KeepQuery,
        ("Content-Encoding" = Option<String>, Header, example = "gzip",
              description = "`gzip` where the body is compressed"),
        ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
         description = "Makes the batch safe to repeat: the same key and body give the same answer \
                        again for 7 days (`--keep-keys-days`)")
    ),
    request_body(
        description = "The samples",
        content(
            (String = "text/csv",
             example = "time,force [N],position [mm]\n2026-03-02T08:15:00Z,50,0\n\
                        2026-03-02T08:15:01Z,50,1.2\n"),
            (RecordingDocument = "application/json"),
            (String = "text/plain",
             example = "rig,hall=2 position=0.1012,pressure=8.31e6 1465839830100400200\n\
                        rig,hall=2 position=0.1013,pressure=8.30e6 1465839831100400200\n"),
            (FileBytes = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
            (FileBytes = "application/vnd.apache.parquet"),
            (FileBytes = "application/octet-stream")
        )
    ),
    responses(
        (status = 201, description = "It is stored, and the stream is new", body = Appended,
         headers(("Location" = String, description = "Where the stream is"))),
        (status = 200, description = "It is stored", body = Appended,
         headers(("Location" = String, description = "Where the stream is"),
                 ("Idempotent-Replayed" = String,
                  description = "`true` when this answers an earlier batch again"))),
        (status = 409, description = "The project has as many streams as it may")
    )
)]
pub async fn append(
    State(state): State<ApiState>,
    client: Client,
    Named(StreamName(name)): Named<StreamName>,
    Params(query): Params<BatchQuery>,
    request: Request,
) -> Answer {
    let (kind, charset) = kind_of(request.headers())?;
    let key = idempotency_key(request.headers())?;
    let BatchQuery {
        options,
        mut given,
        keep,
    } = query;
    client.check_append(&name)?;
    if client.scope == Scope::Append && keep != Keep::default() {
        let detail = "what a stream keeps is not for a token with the scope `append` to say";
        return Err(Problem::new(Kind::Forbidden, detail));
    }
    let layouts = state.store.layouts();
    let options = options.completed(layouts, &client.project).await?;
    let mut options = options.options()?;
    check_grid(&options)?;
    if let Some(charset) = charset {
        options.assume_encoding(&charset);
    }
    let limit = state.limits.dataset_bytes;
    let received = state.bodies.receive(request.into_body(), limit).await;
    let received = received.map_err(|problem| problem.or_instead(SMALLER))?;
    let _permit = state.work.recording_permit_of(received.bytes()).await?;
    let scratch = state.store.datasets().scratch();
    let options = options.for_purpose(ReadingPurpose::Stream);
    let latest = stamps::latest(&state.limits);
    let parsed = state
        .bodies
        .parse_received(received, move |text| {
            let received = intake::receive(text, kind, &options, Some(scratch))?;
            let recording = received.into_recording();
            stamps::batch(recording.map_err(|error| scratch_failed(&error))?, latest)
        })
        .await?;
    given.push(("stream", name.clone()));
    let body_digest = digest(parsed.digest, &given);
    let new = NewBatch {
        project: client.project.clone(),
        stream: name.clone(),
        batch: parsed.value,
        keep,
        idempotency: key.map(|key| Idempotency {
            project: client.project,
            key,
            body_digest,
        }),
    };
    answered(&name, state.store.streams().append(new).await?)
}

/// Refuses a grid: a stream has the instants of its samples.
fn check_grid(options: &Options) -> Answer<()> {
    if !options.asks_for_a_grid() {
        return Ok(());
    }
    let detail = "a stream keeps each sample at the instant at which it was taken; a job puts them on a grid with \
                  `instants`";
    let fault = Fault::of_parameter("grid", "invalid_parameter", detail);
    Err(Problem::of_faults(Kind::Invalid, [fault]))
}

fn answered(name: &str, outcome: BatchOutcome) -> Answer {
    let (status, appended, replayed) = match outcome {
        BatchOutcome::Stored(appended, true) => (StatusCode::CREATED, appended, false),
        BatchOutcome::Stored(appended, false) => (StatusCode::OK, appended, false),
        BatchOutcome::Replayed(appended) => (StatusCode::OK, appended, true),
        BatchOutcome::KeyReused => {
            let detail = "the key came before with another body; use a new key for something new";
            return Err(Problem::new(Kind::KeyReused, detail));
        }
        BatchOutcome::UnitsDiffer(signal, stored_unit, unit) => {
            let detail = format!(
                "`{signal}` is in `{unit}` here and in `{stored_unit}` in the stream; say its unit with \
                 `units`"
            );
            return Err(invalid("units_differ", detail));
        }
        BatchOutcome::HourCameTwice => {
            let detail = "the times are of a local hour that came twice because clocks were set back, \
                          and the stream has samples of both its passes there already: write the \
                          times with their offset, such as 2026-10-25T02:30:00+01:00";
            return Err(invalid("hour_came_twice", detail.to_owned()));
        }
        BatchOutcome::TooManySignals => {
            let detail = format!("the stream would have more than {MAX_SIGNALS} signals");
            return Err(invalid("too_many_signals", detail));
        }
        BatchOutcome::TooManyStreams => {
            let detail = format!("the project has {MAX_STREAMS} streams already; remove one");
            return Err(Problem::new(Kind::WrongState, detail));
        }
    };
    let mut response = json(status, &*appended);
    let location = HeaderValue::from_str(&format!("/v1/streams/{name}"));
    let location = location.expect("a stream's name is visible ASCII");
    response.headers_mut().insert(header::LOCATION, location);
    if replayed {
        let name = HeaderName::from_static("idempotent-replayed");
        let replayed = HeaderValue::from_static("true");
        response.headers_mut().insert(name, replayed);
    }
    Ok(response)
}

/// The page of a list by name.
pub struct WhichStreams(Cursor<String>);

impl FromQuery for WhichStreams {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// List streams by name.
#[utoipa::path(
    get, path = "/v1/streams", operation_id = "list_streams", tag = "streams",
    params(PageParams),
    responses((status = 200, description = "A page of streams", body = Page<StreamRow>,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(streams): State<Streams>,
    client: Client,
    Params(WhichStreams(cursor)): Params<WhichStreams>,
    uri: Uri,
) -> Answer {
    let page = streams
        .list(&client.project, cursor.before, cursor.limit)
        .await?;
    Ok(Page::new(page.rows, page.next).answer(&uri))
}

/// Which samples of a stream.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct StreamQuery {
    /// From this instant on; with an offset, whose `+` is written `%2B` in a query.
    #[param(value_type = Option<String>, format = DateTime, example = "2026-03-02T08:15:00Z")]
    pub from: Option<Timestamp>,
    /// Up to, and without, this instant.
    #[param(value_type = Option<String>, format = DateTime, example = "2026-03-02T09:15:00Z")]
    pub to: Option<Timestamp>,
    /// Points at the most; the extremes of each stretch are kept.
    #[param(minimum = 2, maximum = 100_000, default = 2000)]
    pub max_points: Option<u64>,
}

/// Reads `from` and `to`.
fn read_instants(query: &mut QueryReader) -> (Option<Timestamp>, Option<Timestamp>) {
    let mut instant = |name| {
        query.parsed(name, |text| {
            let shown: String = text.chars().take(60).collect();
            let refusal = "is not an instant with its offset, such as 2026-03-02T08:15:00Z";
            let instant = text.parse::<Timestamp>();
            instant.map_err(|_| format!("`{shown}` {refusal}"))
        })
    };
    let (from, to) = (instant("from"), instant("to"));
    if let (Some(from), Some(to)) = (from, to)
        && from >= to
    {
        let detail = format!("from {from} is not before to {to}");
        query.fault("from", "bounds_reversed", detail);
    }
    (from, to)
}

impl FromQuery for StreamQuery {
    fn read(query: &mut QueryReader) -> Self {
        let (from, to) = read_instants(query);
        Self {
            from,
            to,
            max_points: query.integer("max_points", 2, MAX_POINTS),
        }
    }
}

/// A stream, with samples where a part of it was asked for.
#[derive(Serialize, ToSchema)]
pub struct ShownStream {
    /// The stream.
    #[serde(flatten)]
    stream: StreamRow,
    /// The samples between `from` and `to`, where one of them was said.
    window: Option<StreamSamples>,
}

/// Samples of a stream.
#[derive(Serialize, ToSchema)]
pub struct StreamSamples {
    /// When the first of them was taken; `null` where there are none.
    #[schema(value_type = Option<String>, format = DateTime)]
    start: Option<Timestamp>,
    /// The samples, in seconds from `start`; `null` where there are fewer than two.
    samples: Option<Samples>,
}

/// Show a stream, and samples of it: decimated for plots as JSON, or all between two instants as CSV.
#[utoipa::path(
    get, path = "/v1/streams/{name}", operation_id = "show_stream", tag = "streams",
    params(("name" = String, Path, description = "The stream"), StreamQuery),
    responses((status = 200, description = "The stream; samples are in SI",
               content((ShownStream = "application/json"), (String = "text/csv"))))
)]
pub async fn show(
    State(state): State<ApiState>,
    client: Client,
    Named(StreamName(name)): Named<StreamName>,
    Params(query): Params<StreamQuery>,
    headers: HeaderMap,
) -> Answer {
    let stream = stream(state.store.streams(), &client, &name).await?;
    let wants_csv = prefers(&headers, "text/csv");
    if query.from.is_none() && query.to.is_none() && !wants_csv {
        let shown = ShownStream {
            stream,
            window: None,
        };
        return Ok(tagged_json(&headers, &shown));
    }
    let between = (query.from, query.to);
    if wants_csv {
        return csv::answer(&state, stream, span(between)).await;
    }
    let permit = state.work.recording_permit().await?;
    let points = query.max_points.unwrap_or(DEFAULT_POINTS);
    let points = usize::try_from(points).expect("the limit is small");
    let streams = state.store.streams();
    let rows = streams.overview(&stream, span(between), points).await?;
    let written = state.work.convert(move || {
        let _permit = permit;
        let recording = rows.into_recording(&stream.signals, RecordingSource::default());
        let start = recording.as_ref().and_then(|recording| recording.start);
        let samples = recording.map(|recording| recording.decimate(None, None, None, points));
        let shown = ShownStream {
            stream,
            window: Some(StreamSamples { start, samples }),
        };
        Ok(json(StatusCode::OK, &shown))
    });
    written.await
}

fn too_few() -> String {
    "there are fewer than two samples in it".to_owned()
}

async fn stream(streams: &Streams, client: &Client, name: &str) -> Answer<StreamRow> {
    let stream = streams.find(&client.project, name).await?;
    stream.ok_or_else(|| Problem::not_found("stream", name))
}

/// The instants from one up to, and without, another, nanoseconds since 1970.
fn span((from, to): (Option<Timestamp>, Option<Timestamp>)) -> Range<i64> {
    from.map_or(i64::MIN, nanoseconds)..to.map_or(i64::MAX, nanoseconds)
}

/// A part of a stream; nothing where it has fewer than two samples.
async fn window(
    streams: &Streams,
    stream: &StreamRow,
    (from, to): (Option<Timestamp>, Option<Timestamp>),
) -> Answer<Option<Recording>> {
    let rows = streams.unmarked_rows(stream, span((from, to)), MAX_WINDOW_SAMPLES);
    let UnmarkedRows { rows, told } = rows.await?.ok_or_else(|| {
        let detail = format!(
            "there are more than {MAX_WINDOW_SAMPLES} instants in it; ask for a shorter part"
        );
        invalid("too_many_samples", detail)
    })?;
    let bounds = [("from", from), ("to", to)].into_iter();
    let bounds = bounds.filter_map(|(name, instant)| Some((name.to_owned(), instant?.to_string())));
    let mut options: std::collections::BTreeMap<String, String> = bounds.collect();
    options.insert("stream".to_owned(), stream.name.clone());
    let source = RecordingSource {
        format: "stream".to_owned(),
        options,
    };
    let recording = rows.into_recording(&stream.signals, source);
    Ok(recording.map(|recording| Recording {
        zone: stream.zone.clone(),
        notes: told,
        ..recording
    }))
}

/// Remove a stream that no monitor watches. Recordings that were cut out of it stay.
#[utoipa::path(
    delete, path = "/v1/streams/{name}", operation_id = "remove_stream", tag = "streams",
    params(("name" = String, Path, description = "The stream")),
    responses((status = 204, description = "It is removed"),
              (status = 409, description = "A monitor watches it"))
)]
pub async fn remove(
    State(streams): State<Streams>,
    client: Client,
    Named(StreamName(name)): Named<StreamName>,
    _query: Params<NoQuery>,
) -> Answer<Response> {
    match streams.delete(&client.project, &name).await? {
        StreamRemoval::Removed => Ok(StatusCode::NO_CONTENT.into_response()),
        StreamRemoval::NotFound => Err(Problem::not_found("stream", &name)),
        StreamRemoval::InUse(monitors) => {
            let detail = format!("watched by {}", monitors.join(", "));
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}
