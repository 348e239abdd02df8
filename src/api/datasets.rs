//! Recordings: store, list, show, remove.

pub(super) mod csv;
mod document;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::response::IntoResponse;
use jiff::Timestamp;
use serde::Serialize;
use sha2::{Digest, Sha256};
use utoipa::{IntoParams, ToSchema};

pub use document::{FileBytes, RecordedSignal, RecordingDocument};

use super::body::{Bodies, content_type, scratch_failed, unsupported};
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName as _};
use super::http_headers::{json, tagged_json};
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use super::reading::{GivenOptions, ReadingQuery};
use crate::store::{DatasetRemoval, DatasetRow, Datasets, Layouts, NewDataset};
use greybox::identification::DatasetId;
use greybox::identification::spec::MAX_NAME_CHARS;
use greybox::intake;
use greybox::recording::Summary;

/// What a client can do whose recording is too large.
pub(super) const SMALLER: &str = "send it as Parquet, which takes a part of the bytes of a CSV, or in parts to a \
                                  stream (`POST /v1/streams/{name}`); whoever runs the server can allow more \
                                  with `--max-body-mib`";
/// A stored recording.
#[derive(Serialize, ToSchema)]
pub struct Dataset {
    /// The identifier of the recording.
    id: DatasetId,
    /// A name for people.
    name: Option<String>,
    /// SHA-256 of the uncompressed bytes that came, followed by the options that came with them.
    #[schema(example = "sha256:9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08")]
    digest: String,
    /// What the recording holds.
    #[serde(flatten)]
    summary: Summary,
    /// The newest version of the recording; 0 where nothing of it is marked as bad.
    version: u32,
    /// When the recording was stored.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
}

impl Dataset {
    fn new(row: &DatasetRow, version: u32) -> Self {
        Self {
            id: row.id,
            name: row.name.clone(),
            digest: row.digest.clone(),
            summary: with_conversions(row.summary.clone()),
            version,
            created_at: row.created_at,
        }
    }
}

/// The summary with the way from the unit of each signal to SI.
pub(super) fn with_conversions(mut summary: Summary) -> Summary {
    for signal in &mut summary.signals {
        signal.conversion = intake::conversion(&signal.recorded_unit);
    }
    summary
}

/// What the recording itself does not say.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct NewDatasetQuery {
    /// A name for people; wins over the one in a JSON body.
    #[param(max_length = 200)]
    pub name: Option<String>,
}

/// The name and the options of a recording.
pub struct NewRecording {
    name: Option<String>,
    options: GivenOptions,
}

impl FromQuery for NewRecording {
    fn read(query: &mut QueryReader) -> Self {
        let name = query.parsed("name", |name| {
            let length = name.chars().count();
            if name.contains('\0') {
                Err("a name has no NUL character".to_owned())
            } else if length <= MAX_NAME_CHARS {
                Ok(name.to_owned())
            } else {
                Err(format!(
                    "{length} characters are more than {MAX_NAME_CHARS}"
                ))
            }
        });
        let options = GivenOptions::read(query);
        Self { name, options }
    }
}

/// Store a recording.
///
/// CSV: a header row, first column the time, units in brackets, an empty field is a missing
/// sample. JSON: `sample_time_s` (or `time`) and `signals`, `null` is a missing sample. Answers of
/// historians are taken as they are: PI Web API, OMF, AVEVA, Canary, OPC UA, Cognite, InfluxDB,
/// Ignition, Simulink and pandas, told from the type and the first lines of the body; so are Excel
/// workbooks (`.xlsx`) and Apache Parquet. Everything is converted to SI; what was assumed or left out
/// stands in the report. All formats but those with a column for each signal are held in memory, 16
/// million samples at the most; of a workbook and of Parquet the file is, 256 MiB at the most.
#[utoipa::path(
    post, path = "/v1/datasets", operation_id = "create_dataset", tag = "datasets",
    params(
        NewDatasetQuery,
        ReadingQuery,
        ("Content-Encoding" = Option<String>, Header, example = "gzip",
              description = "`gzip` where the body is compressed")
    ),
    request_body(
        description = "The recording",
        content(
            (String = "text/csv",
             example = "time [s],reference [m],position [mm]\n0,0.03,0\n0.01,0.03,1.2\n"),
            (RecordingDocument = "application/json"),
            (String = "text/plain",
             example = "rig,hall=2 position=0.1012,pressure=8.31e6 1465839830100400200\n"),
            (FileBytes = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"),
            (FileBytes = "application/vnd.apache.parquet"),
            (FileBytes = "application/octet-stream")
        )
    ),
    responses(
        (status = 201, description = "It is stored", body = Dataset,
         headers(("Location" = String, description = "Where the recording is"))),
        (status = 200, description = "The same bytes and options came before: the same recording",
         body = Dataset,
         headers(("Location" = String, description = "Where the recording is")))
    )
)]
pub async fn create(
    State(bodies): State<Bodies>,
    State(layouts): State<Layouts>,
    client: Client,
    Params(new): Params<NewRecording>,
    request: Request,
) -> Answer {
    let (kind, charset) = kind_of(request.headers())?;
    let limit = bodies.dataset_bytes;
    let NewRecording { name, options } = new;
    let options = options.completed(&layouts, &client.project).await?;
    let given = options.digested(name.as_ref());
    let mut options = options.options()?;
    options.name = name;
    if let Some(charset) = charset {
        options.assume_encoding(&charset);
    }
    let received = bodies.receive(request.into_body(), limit).await;
    let received = received.map_err(|problem| problem.or_instead(SMALLER))?;
    let permit = bodies.work.recording_permit_of(received.bytes());
    let _permit = permit.await?;
    let scratch = bodies.datasets.scratch();
    let parsed = bodies
        .parse_received(received, move |text| {
            let mut recording = intake::receive(text, kind, &options, Some(scratch))?;
            let summary = recording.summary();
            let summary = summary.map_err(|error| scratch_failed(&error))?;
            Ok((recording, summary))
        })
        .await?;
    let (recording, summary) = parsed.value;
    let new = NewDataset {
        project: client.project,
        name: recording.header.name.clone(),
        digest: digest(parsed.digest, &given),
        summary,
        recording,
    };
    stored(&bodies.datasets, new).await
}

/// Recordings with the numbers of their newest versions.
async fn shown(datasets: &Datasets, rows: &[&DatasetRow]) -> Answer<Vec<Dataset>> {
    let ids: Vec<DatasetId> = rows.iter().map(|row| row.id).collect();
    let newest = datasets.newest_versions(&ids).await?;
    let version = |row: &DatasetRow| newest.get(&row.id).copied().unwrap_or(0);
    let rows = rows.iter();
    Ok(rows.map(|row| Dataset::new(row, version(row))).collect())
}

/// Stores a recording, and says where it is.
pub(super) async fn stored(datasets: &Datasets, new: NewDataset) -> Answer {
    let (row, is_new) = datasets.insert(new).await?;
    let status = if is_new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = HeaderValue::from_str(&format!("/v1/datasets/{}", row.id));
    let dataset = shown(datasets, &[&row]).await?;
    let mut response = json(status, &dataset[0]);
    let location = location.expect("an identifier is visible ASCII");
    response.headers_mut().insert(header::LOCATION, location);
    Ok(response)
}

/// What the type of the body says: its kind, and the encoding of its text.
pub(super) fn kind_of(headers: &HeaderMap) -> Answer<(intake::MediaKind, Option<String>)> {
    let kind = intake::MediaKind::of_media_type(&content_type(headers));
    let kind = kind.ok_or_else(|| unsupported(headers, intake::MediaKind::MEDIA_TYPES))?;
    let value = headers.get(header::CONTENT_TYPE);
    let text = value.and_then(|value| value.to_str().ok());
    let parameters = text.into_iter().flat_map(|text| text.split(';').skip(1));
    let mut charsets = parameters.filter_map(|parameter| {
        let (name, charset) = parameter.split_once('=')?;
        let is_charset = name.trim().eq_ignore_ascii_case("charset");
        is_charset.then(|| charset.trim().trim_matches('"').to_owned())
    });
    Ok((kind, charsets.next()))
}

/// Without options the digest is of the bytes alone, so that any tool can check the digest.
pub(super) fn digest(mut bytes: Sha256, options: &[(&'static str, String)]) -> String {
    for (key, option) in options {
        bytes.update(format!("\0{key}={option}"));
    }
    format!("sha256:{}", hex::encode(bytes.finalize()))
}

/// The page of a list.
pub struct WhichDatasets(Cursor<DatasetId>);

impl FromQuery for WhichDatasets {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// List recordings, newest first.
#[utoipa::path(
    get, path = "/v1/datasets", operation_id = "list_datasets", tag = "datasets",
    params(PageParams),
    responses((status = 200, description = "A page of recordings", body = Page<Dataset>,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(datasets): State<Datasets>,
    client: Client,
    Params(WhichDatasets(cursor)): Params<WhichDatasets>,
    uri: Uri,
) -> Answer {
    let page = datasets.list(&client.project, cursor.before, cursor.limit);
    let page = page.await?;
    let items = shown(&datasets, &page.rows.iter().collect::<Vec<_>>()).await?;
    Ok(Page::new(items, page.next.map(|id| id.to_string())).answer(&uri))
}

/// Show a recording with its quality report.
#[utoipa::path(
    get, path = "/v1/datasets/{id}", operation_id = "show_dataset", tag = "datasets",
    params(("id" = DatasetId, Path, description = "The recording")),
    responses((status = 200, description = "The recording", body = Dataset))
)]
pub async fn show(
    State(datasets): State<Datasets>,
    Named(id): Named<DatasetId>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    let row = datasets.find(id).await?.ok_or_else(|| id.not_found())?;
    let dataset = shown(&datasets, &[&row]).await?;
    Ok(tagged_json(&headers, &dataset[0]))
}

/// Remove a recording that no job needs.
#[utoipa::path(
    delete, path = "/v1/datasets/{id}", operation_id = "remove_dataset", tag = "datasets",
    params(("id" = DatasetId, Path, description = "The recording")),
    responses((status = 204, description = "It is removed"),
              (status = 409, description = "A job needs it"))
)]
pub async fn remove(
    State(datasets): State<Datasets>,
    Named(id): Named<DatasetId>,
    _query: Params<NoQuery>,
) -> Answer {
    match datasets.delete(id).await? {
        DatasetRemoval::Removed => Ok(StatusCode::NO_CONTENT.into_response()),
        DatasetRemoval::NotFound => Err(id.not_found()),
        DatasetRemoval::InUse(jobs) => {
            let jobs: Vec<String> = jobs.iter().map(ToString::to_string).collect();
            let detail = format!("needed by {}", jobs.join(", "));
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}
