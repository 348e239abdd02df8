//! Parts of a stream as recordings that never change.

use axum::extract::State;
use jiff::Timestamp;
use sha2::Digest;
use utoipa::ToSchema;

use super::stamps::invalid;
use super::{StreamName, stream, too_few, window};
use crate::api::ApiState;
use crate::api::body::JsonDocument;
use crate::api::client::Client;
use crate::api::datasets::{Dataset, stored};
use crate::api::error::{Answer, Problem};
use crate::api::extract::Named;
use crate::api::query::{NoQuery, Params};
use crate::store::{NewDataset, StreamRow};
use greybox::parsing::Fault;
use greybox::parsing::reader::{Field, read_document};
use greybox::recording::Rows;

/// A part of a stream to be cut out.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({"from": "2026-03-02T08:15:00+01:00", "to": "2026-03-02T08:16:00+01:00"}))]
pub struct StreamPart {
    /// A name for people.
    #[schema(nullable = false, max_length = 200)]
    pub name: Option<String>,
    /// The first instant.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
    /// The instant up to, and without, which.
    #[schema(value_type = String, format = DateTime)]
    pub to: Timestamp,
}

impl StreamPart {
    fn read(document: &serde_json::Value) -> Result<Self, Vec<Fault>> {
        read_document(document, read_part)
    }
}

fn read_part(document: &Field<'_>) -> Option<StreamPart> {
    let mut root = document.object()?;
    let name = root.optional("name").and_then(|field| {
        let name = field.text()?;
        if name.chars().count() > greybox::identification::spec::MAX_NAME_CHARS {
            field.fault("too_long", "the name is too long");
        }
        Some(name.to_owned())
    });
    let mut instant = |name| root.required(name)?.instant();
    let (from, to) = (instant("from"), instant("to"));
    if let (Some(from), Some(to)) = (from, to)
        && from >= to
    {
        root.fault(
            "bounds_reversed",
            format!("from {from} is not before to {to}"),
        );
    }
    root.finish();
    Some(StreamPart {
        name,
        from: from?,
        to: to?,
    })
}

/// Cut a part out of a stream, as a recording that never changes.
///
/// The same samples are the same recording: what came later to that part of the stream makes
/// another.
#[utoipa::path(
    post, path = "/v1/streams/{name}/recordings", operation_id = "cut_stream", tag = "streams",
    params(("name" = String, Path, description = "The stream")),
    request_body(content = StreamPart, content_type = "application/json"),
    responses(
        (status = 201, description = "It is stored", body = Dataset,
         headers(("Location" = String, description = "Where the recording is"))),
        (status = 200, description = "The same samples were cut out before: the same recording",
         body = Dataset,
         headers(("Location" = String, description = "Where the recording is")))
    )
)]
pub async fn cut(
    State(state): State<ApiState>,
    client: Client,
    Named(StreamName(name)): Named<StreamName>,
    _query: Params<NoQuery>,
    document: JsonDocument,
) -> Answer {
    let part = StreamPart::read(&document.value).map_err(Problem::of_document)?;
    let stream = stream(state.store.streams(), &client, &name).await?;
    let new = cut_out(&state, &stream, part.name, (part.from, part.to)).await?;
    stored(state.store.datasets(), new).await
}

/// A part of a stream as a recording with a name.
pub(in crate::api) async fn cut_out(
    state: &ApiState,
    stream: &StreamRow,
    name: Option<String>,
    (from, to): (Timestamp, Timestamp),
) -> Answer<NewDataset> {
    let _permit = state.work.recording_permit().await?;
    let recording = window(state.store.streams(), stream, (Some(from), Some(to))).await?;
    let mut recording = recording.ok_or_else(|| invalid("too_few_samples", too_few()))?;
    recording.name = name;
    let project = stream.project.clone();
    let new = state.work.convert_bytes(recording.bytes(), move || {
        let summary = recording.summary();
        let copy = recording.clone();
        let (signals, rows) = Rows::of(copy).expect("a part of a stream has a start");
        let mut digest = rows.digest(&signals);
        digest.update(format!(
            "\0name={}",
            recording.name.as_deref().unwrap_or_default()
        ));
        Ok(NewDataset {
            project,
            name: recording.name.clone(),
            digest: format!("sha256:{}", hex::encode(digest.finalize())),
            summary,
            recording: recording.into(),
        })
    });
    new.await
}
