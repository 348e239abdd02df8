//! Marks of a stream: stretches that people say are bad.

use std::collections::BTreeSet;

use axum::extract::State;
use axum::http::StatusCode;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::{StreamName, stream};
use crate::api::body::JsonDocument;
use crate::api::client::Client;
use crate::api::error::{Answer, Kind, Problem};
use crate::api::extract::Named;
use crate::api::http_headers::json;
use crate::api::query::{NoQuery, Params};
use crate::store::{
    MAX_STREAM_MARKS, NewStreamMarks, StreamMark, StreamMarked, StreamMarks, StreamRow, Streams,
};
use greybox::identification::spec::read_reason;
use greybox::parsing::reader::{Field, did_you_mean, read_document};

/// The marks of a stream as they are to be.
#[derive(ToSchema)]
#[schema(example = json!({"based_on": 0, "marks": [
    {"from": "2026-03-02T08:15:00Z", "to": "2026-03-02T08:21:30Z", "signals": ["position"], "reason": "sensor unplugged"}
]}))]
#[allow(
    dead_code,
    reason = "it describes a document that is read field by field"
)]
pub struct MarksOfStream {
    /// Everything that is marked, not what changes.
    #[schema(max_items = 1000)]
    marks: Vec<StreamMark>,
    /// The number of the marks that were changed: if the stream has others by now, nothing is stored.
    #[schema(minimum = 0)]
    based_on: Option<u32>,
}

/// The marks of a stream.
#[derive(Serialize, ToSchema)]
pub struct MarkedStream {
    /// How often the marks were changed; 0 where nothing was ever marked.
    number: u32,
    /// Everything that is marked as bad.
    marks: Vec<StreamMark>,
    /// Who changed the marks last: `token …`, `person …` or `local`.
    changed_by: Option<String>,
    /// When the marks were changed last.
    #[schema(value_type = Option<String>, format = DateTime)]
    changed_at: Option<Timestamp>,
}

impl From<StreamMarks> for MarkedStream {
    fn from(marks: StreamMarks) -> Self {
        Self {
            number: marks.number,
            marks: marks.marks,
            changed_by: marks.changed_by,
            changed_at: marks.changed_at,
        }
    }
}

/// Show what of a stream is marked as bad.
#[utoipa::path(
    get, path = "/v1/streams/{name}/marks", operation_id = "show_stream_marks", tag = "streams",
    params(("name" = String, Path, description = "The stream")),
    responses((status = 200, description = "The marks", body = MarkedStream))
)]
pub async fn show(
    State(streams): State<Streams>,
    client: Client,
    Named(StreamName(name)): Named<StreamName>,
    _query: Params<NoQuery>,
) -> Answer {
    stream(&streams, &client, &name).await?;
    let marks = streams.marks(&client.project, &name).await?;
    Ok(json(StatusCode::OK, &MarkedStream::from(marks)))
}

/// Mark stretches of a stream as bad.
///
/// The samples stay in the stream. Recordings that are cut out of it from now on, windows of monitors and selections do
/// without them, and the report of such a recording names each mark with its reason.
#[utoipa::path(
    put, path = "/v1/streams/{name}/marks", operation_id = "put_stream_marks", tag = "streams",
    params(("name" = String, Path, description = "The stream")),
    request_body(content = MarksOfStream, content_type = "application/json"),
    responses(
        (status = 200, description = "The marks are stored", body = MarkedStream),
        (status = 409, description = "`based_on` is not the number of the marks that the stream has")
    )
)]
pub async fn put(
    State(streams): State<Streams>,
    client: Client,
    Named(StreamName(name)): Named<StreamName>,
    _query: Params<NoQuery>,
    document: JsonDocument,
) -> Answer {
    let stream = stream(&streams, &client, &name).await?;
    let new = read_document(&document.value, |root| read(root, &stream));
    let new = new.map_err(Problem::of_document)?;
    match streams.put_marks(&stream, new, client.who).await? {
        StreamMarked::Stored(marks) => Ok(json(StatusCode::OK, &MarkedStream::from(marks))),
        StreamMarked::NotNewest(number) => {
            let detail = format!(
                "the marks of the stream have the number {number}: look at them, and change those"
            );
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}

fn read(root: &Field<'_>, stream: &StreamRow) -> Option<NewStreamMarks> {
    let mut object = root.object()?;
    let marks = object
        .required("marks")
        .and_then(|field| read_marks(&field, stream));
    let based_on = object.optional("based_on");
    let based_on = based_on.map(|field| field.integer(0, u64::from(u32::MAX)));
    object.finish();
    Some(NewStreamMarks {
        marks: marks?,
        based_on: match based_on {
            Some(number) => Some(u32::try_from(number?).ok()?),
            None => None,
        },
    })
}

fn read_marks(field: &Field<'_>, stream: &StreamRow) -> Option<Vec<StreamMark>> {
    let marks = field.array()?;
    let count = marks.len();
    if count > MAX_STREAM_MARKS {
        let detail = format!("{count} marks are more than {MAX_STREAM_MARKS}");
        field.fault("out_of_range", detail);
        return None;
    }
    let names = stream.signals.iter().map(|signal| &*signal.name).collect();
    let read: Vec<_> = marks.map(|mark| read_mark(&mark, &names)).collect();
    read.into_iter().collect()
}

fn read_mark(field: &Field<'_>, names: &BTreeSet<&str>) -> Option<StreamMark> {
    let mut object = field.object()?;
    let mut instant = |name| object.required(name)?.instant();
    let (from, to) = (instant("from"), instant("to"));
    let signals = object
        .optional("signals")
        .map(|field| read_signals(&field, names));
    let reason = object
        .required("reason")
        .and_then(|field| read_reason(&field));
    object.finish();
    let (from, to) = (from?, to?);
    if from > to {
        field.fault("bounds_reversed", format!("from {from} is after to {to}"));
        return None;
    }
    Some(StreamMark {
        from,
        to,
        signals: signals.map_or(Some(None), |signals| signals.map(Some))?,
        reason: reason?,
    })
}

fn read_signals(field: &Field<'_>, names: &BTreeSet<&str>) -> Option<Vec<String>> {
    let signals: Vec<_> = field
        .array()?
        .map(|field| {
            let name = field.text()?;
            if !names.contains(name) {
                let hint = did_you_mean(name, names.iter().copied());
                let detail = format!("the stream has no signal `{name}`{hint}");
                field.fault("unknown_signal", detail);
                return None;
            }
            Some(name.to_owned())
        })
        .collect();
    signals.into_iter().collect()
}
