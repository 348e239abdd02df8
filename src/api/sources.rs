//! Sources of collectors: how far each has come, as its collector says.

use std::str::FromStr;

use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use jiff::{SignedDuration, Timestamp};
use serde::Serialize;
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName, chosen_name};
use super::http_headers::json;
use super::query::{NoQuery, Params};
use crate::access::{Project, is_stream_name};
use crate::store::{MAX_SOURCES, SeriesState, SourceRow, SourceState, Sources, Store, StoreError};
use greybox::parsing::reader::{Field, read_document};

/// The characters of a source's name at the most.
const MAX_NAME: usize = 100;
/// The characters of any other text at the most.
const MAX_TEXT: usize = 2000;
/// Series of a source at the most.
const MAX_SERIES: usize = 5000;
/// The longest time between two questions to a source `[s]`: thirty days.
const MAX_EVERY_S: f64 = 30.0 * 86_400.0;
/// A source is silent that is not heard of while it is asked so many times …
const TIMES_SILENT: f64 = 3.0;
/// … and for so long beside: a collector waits a minute after a failure `[s]`.
const SILENT_AFTER_S: f64 = 180.0;

/// The name of a source.
pub struct SourceName(String);

impl FromStr for SourceName {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        chosen_name(text, MAX_NAME).map(Self).ok_or(())
    }
}

impl PathName for SourceName {
    const WHAT: &'static str =
        "source (its name has no slash and 100 characters at the most) called";

    async fn project(&self, _store: &Store) -> Result<Option<Project>, StoreError> {
        Ok(None)
    }
}

/// The state in which a source is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SourceHealth {
    /// The samples of the source come.
    Following,
    /// A series is refused by the source or by the server.
    Refused,
    /// The source or the server is not reached.
    Away,
    /// The collector of the source is not heard of.
    Silent,
}

/// A source as its collector said last.
#[derive(Serialize, ToSchema)]
pub struct CollectedSource {
    /// The name of the source.
    name: String,
    /// The state in which the source is.
    health: SourceHealth,
    #[serde(flatten)]
    state: SourceState,
    /// When the source was first heard of.
    #[schema(value_type = String, format = DateTime)]
    first_heard_at: Timestamp,
    /// When the source was last heard of.
    #[schema(value_type = String, format = DateTime)]
    heard_at: Timestamp,
}

impl CollectedSource {
    fn of(row: SourceRow, now: Timestamp) -> Self {
        let silent_s = TIMES_SILENT * row.state.every_s + SILENT_AFTER_S;
        let is_silent = now.duration_since(row.heard_at) > SignedDuration::from_secs_f64(silent_s);
        let health = match &row.state {
            _ if is_silent => SourceHealth::Silent,
            state if state.away.is_some() => SourceHealth::Away,
            state if state.series.iter().any(|series| series.fault.is_some()) => {
                SourceHealth::Refused
            }
            _ => SourceHealth::Following,
        };
        Self {
            name: row.name,
            health,
            state: row.state,
            first_heard_at: row.first_heard_at,
            heard_at: row.heard_at,
        }
    }
}

/// All sources of a project.
#[derive(Serialize, ToSchema)]
pub struct SourceList {
    /// The sources by name.
    items: Vec<CollectedSource>,
}

/// Say how a source is.
///
/// A collector (`greybox collect`) says so of each of its sources after its first pass and every half minute. A token
/// with the scope `append` names the streams of all series.
#[utoipa::path(
    put, path = "/v1/sources/{name}", operation_id = "put_source", tag = "agents",
    params(("name" = String, Path, description = "The source", example = "press hall")),
    request_body(content = SourceState, content_type = "application/json"),
    responses(
        (status = 204, description = "It is noted"),
        (status = 409, description = "The project has as many sources as it may")
    )
)]
pub async fn put(
    State(sources): State<Sources>,
    client: Client,
    Named(SourceName(name)): Named<SourceName>,
    _query: Params<NoQuery>,
    document: JsonDocument,
) -> Answer<Response> {
    let state = read_document(&document.value, read).map_err(Problem::of_document)?;
    if client.streams.is_some() {
        // A collector takes the place of nothing that another one says.
        let before = sources.find(&client.project, &name).await?;
        let before = before.map_or(Vec::new(), |before| before.state.series);
        for series in before.iter().chain(&state.series) {
            client.check_append(&series.stream)?;
        }
    }
    match sources.put(&client.project, &name, state).await? {
        true => Ok(StatusCode::NO_CONTENT.into_response()),
        false => {
            let detail = format!("a project has {MAX_SOURCES} sources at the most");
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}

/// List the sources of the project.
#[utoipa::path(
    get, path = "/v1/sources", operation_id = "list_sources", tag = "agents",
    responses((status = 200, description = "All sources", body = SourceList))
)]
pub async fn list(
    State(sources): State<Sources>,
    client: Client,
    _query: Params<NoQuery>,
) -> Answer {
    let rows = sources.list(&client.project).await?.into_iter();
    let now = Timestamp::now();
    let items = rows.map(|row| CollectedSource::of(row, now)).collect();
    Ok(json(StatusCode::OK, &SourceList { items }))
}

/// Show a source.
#[utoipa::path(
    get, path = "/v1/sources/{name}", operation_id = "show_source", tag = "agents",
    params(("name" = String, Path, description = "The source")),
    responses((status = 200, description = "The source", body = CollectedSource))
)]
pub async fn show(
    State(sources): State<Sources>,
    client: Client,
    Named(SourceName(name)): Named<SourceName>,
    _query: Params<NoQuery>,
) -> Answer {
    let row = sources.find(&client.project, &name).await?;
    let row = row.ok_or_else(|| Problem::not_found("source", &name))?;
    let source = CollectedSource::of(row, Timestamp::now());
    Ok(json(StatusCode::OK, &source))
}

/// Forget a source, until its collector says something of it again.
#[utoipa::path(
    delete, path = "/v1/sources/{name}", operation_id = "forget_source", tag = "agents",
    params(("name" = String, Path, description = "The source")),
    responses((status = 204, description = "It is forgotten"))
)]
pub async fn forget(
    State(sources): State<Sources>,
    client: Client,
    Named(SourceName(name)): Named<SourceName>,
    _query: Params<NoQuery>,
) -> Answer<Response> {
    match sources.delete(&client.project, &name).await? {
        true => Ok(StatusCode::NO_CONTENT.into_response()),
        false => Err(Problem::not_found("source", &name)),
    }
}

fn read(root: &Field<'_>) -> Option<SourceState> {
    let mut object = root.object()?;
    let kind = object.required("kind").and_then(|field| text(&field));
    let every_s = object.required("every_s");
    let every_s = every_s.and_then(|field| field.number_within(0.0, MAX_EVERY_S));
    let away = object.optional("away").map(|field| text(&field));
    let series = object.required("series").and_then(|field| read_all(&field));
    object.finish();
    Some(SourceState {
        kind: kind?,
        every_s: every_s?,
        away: away.map_or(Some(None), |away| away.map(Some))?,
        series: series?,
    })
}

fn read_all(field: &Field<'_>) -> Option<Vec<SeriesState>> {
    let all = field.array()?;
    if all.len() > MAX_SERIES {
        let detail = format!("a source has {MAX_SERIES} series at the most");
        field.fault("too_many", detail);
        return None;
    }
    let all: Vec<Option<SeriesState>> = all.map(|series| read_series(&series)).collect();
    all.into_iter().collect()
}

fn read_series(field: &Field<'_>) -> Option<SeriesState> {
    let mut object = field.object()?;
    let series = object.required("series").and_then(|field| text(&field));
    let stream = object.required("stream").and_then(|field| {
        let stream = field.text()?;
        if !is_stream_name(stream) {
            field.fault("invalid_name", format!("`{stream}` is no name of a stream"));
            return None;
        }
        Some(stream.to_owned())
    });
    let reached = object.optional("reached").map(|field| field.instant());
    let fault = object.optional("fault").map(|field| text(&field));
    object.finish();
    Some(SeriesState {
        series: series?,
        stream: stream?,
        reached: reached.map_or(Some(None), |reached| reached.map(Some))?,
        fault: fault.map_or(Some(None), |fault| fault.map(Some))?,
    })
}

fn text(field: &Field<'_>) -> Option<String> {
    let text = field.text()?;
    if (1..=MAX_TEXT).contains(&text.chars().count()) && !text.contains('\0') {
        return Some(text.to_owned());
    }
    let detail = format!("a text has 1 to {MAX_TEXT} characters, none of them NUL");
    field.fault("invalid_text", detail);
    None
}
