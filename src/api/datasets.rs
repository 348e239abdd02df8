//! Recordings: store, list, show, sample, remove.

pub(super) mod csv;
mod document;

use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::response::IntoResponse;
use jiff::Timestamp;
use serde::Serialize;
use sha2::{Digest, Sha256};
use utoipa::openapi::Object;
use utoipa::{IntoParams, ToSchema};

pub use document::{FileBytes, RecordedSignal, RecordingDocument};

use super::body::{Bodies, content_type, scratch_failed, unsupported};
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::http_headers::{json, prefers, tagged_json};
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, NoQuery, Params, QueryReader, one_of};
use crate::store::{DatasetPart, DatasetRemoval, DatasetRow, Datasets, NewDataset};
use greybox::identification::DatasetId;
use greybox::identification::spec::MAX_NAME_CHARS;
use greybox::intake::{self, Options};
use greybox::parsing::Fault;
use greybox::recording::{Recording, Samples, Summary};

/// Points of a plot when the client does not say.
const DEFAULT_POINTS: u64 = 2000;
/// Points of a plot at the most.
const MAX_POINTS: u64 = 100_000;
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
    /// When the recording was stored.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
}

impl From<&DatasetRow> for Dataset {
    fn from(row: &DatasetRow) -> Self {
        let mut summary = row.summary.clone();
        for signal in &mut summary.signals {
            signal.conversion = intake::conversion(&signal.recorded_unit);
        }
        Self {
            id: row.id,
            name: row.name.clone(),
            digest: row.digest.clone(),
            summary,
            created_at: row.created_at,
        }
    }
}

/// What the recording itself does not say.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct NewDatasetQuery {
    /// A name for people; wins over the one in a JSON body.
    #[param(max_length = 200)]
    pub name: Option<String>,
}

fn formats() -> Object {
    one_of(intake::Format::names())
}

fn quality_schemes() -> Object {
    one_of(intake::quality_schemes())
}

/// How a body is to be read.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ReadingQuery {
    /// The time column of a CSV or pandas body; the first one when absent.
    pub time: Option<String>,
    /// How the body is written, where that is not told from its type and its first lines:
    /// `wide_csv`, `long_csv`, `paired_csv`, `senseye`, `simulink_csv`, `influx_csv`,
    /// `influx_line_protocol`, `influx_json`, `pi_web_api`, `omf`, `aveva_odata`, `aveva_sql`, `canary`, `ignition`, `opc_ua_json`, `cognite`,
    /// `pandas_records`, `pandas_split`, `pandas_table`, `excel`, `parquet` or `json`.
    #[param(schema_with = formats)]
    pub format: Option<String>,
    /// The zone of times without an offset, by its IANA name.
    #[param(example = "Europe/Berlin")]
    pub tz: Option<String>,
    /// What numbers of time are: a unit (`ms`), the sample time of a counter (`10ms`), serial days
    /// (`excel`, `datenum`, `julian`) or a program's count (`labview`, `filetime`, `ticks`); of dates, whether the day (`dmy`) or the month (`mdy`) comes first.
    #[param(example = "ms")]
    pub time_unit: Option<String>,
    /// What separates a number's fraction: `.` or `,`.
    pub decimal: Option<String>,
    /// The encoding of the text, where it is not UTF-8 and has no byte order mark.
    #[param(example = "windows-1252")]
    pub encoding: Option<String>,
    /// Numbers and words, separated by commas, that stand for a missing sample.
    #[param(example = "-9999,Bad")]
    pub missing: Option<String>,
    /// Signals to leave out, separated by commas, or as a JSON array.
    pub ignore: Option<String>,
    /// Units of signals, `name:unit` separated by commas, or as a JSON object.
    #[param(example = "p:bar,x:mm")]
    pub units: Option<String>,
    /// New names of signals, `old:new` separated by commas, or as a JSON object.
    pub rename: Option<String>,
    /// What codes of quality mean: `opc_da`, `opc_ua`, `aveva_quality`, `aveva_quality_detail`,
    /// `ignition`, `ignition_legacy`, `cognite` or `words`.
    #[param(schema_with = quality_schemes)]
    pub quality_scheme: Option<String>,
    /// How signals go on between samples: `hold` or `linear`, or `name:hold` separated by commas.
    #[param(example = "valve:hold")]
    pub interpolation: Option<String>,
    /// The instants for signals that have different ones: a sample time (`10ms`), a rate
    /// (`100Hz`), or `none` for those of all of them together.
    pub grid: Option<String>,
    /// The worksheet of a workbook; the first that can be seen and has anything in it when absent.
    #[param(example = "Data")]
    pub sheet: Option<String>,
    /// The line of a table's titles, from 1, or `none`: its columns are then called `column_1`, `column_2` and so on.
    #[param(example = "3")]
    pub header_row: Option<String>,
    /// The line of the units of a table's columns, from 1, or `none`.
    #[param(example = "none")]
    pub unit_row: Option<String>,
    /// The column that names the signal of a row, by its title: the table then has a row for each
    /// sample of one signal.
    #[param(example = "Messstelle")]
    pub tag: Option<String>,
    /// The columns of values of such a table, separated by commas, or as a JSON array. Of several
    /// each is a signal of its own, such as `pump.pressure`; all columns of numbers when absent.
    #[param(example = "Wert")]
    pub value: Option<String>,
    /// The column of the quality of such a table, or `none`.
    pub quality: Option<String>,
}

/// The options of a recording, understood, and as they came.
pub struct NewRecording {
    options: Options,
    given: Vec<(&'static str, String)>,
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
        let mut given = Vec::new();
        given.extend(name.clone().map(|name| ("name", name)));
        let mut options = reading(query, &mut given);
        options.name = name;
        Self { options, given }
    }
}

/// Reads how a body is to be read; notes what was given.
pub(super) fn reading(query: &mut QueryReader, given: &mut Vec<(&'static str, String)>) -> Options {
    let mut options = Options::default();
    options.time = query.text("time");
    given.extend(options.time.clone().map(|time| ("time", time)));
    for option in Options::NAMES {
        let set = |text: &str| options.set(option, text).map(|()| text.to_owned());
        given.extend(query.parsed(option, set).map(|text| (option, text)));
    }
    options
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
    client: Client,
    Params(new): Params<NewRecording>,
    request: Request,
) -> Answer {
    let (kind, charset) = kind_of(request.headers())?;
    let limit = bodies.dataset_bytes;
    let NewRecording { mut options, given } = new;
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

/// Stores a recording, and says where it is.
pub(super) async fn stored(datasets: &Datasets, new: NewDataset) -> Answer {
    let (row, is_new) = datasets.insert(new).await?;
    let status = if is_new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = HeaderValue::from_str(&format!("/v1/datasets/{}", row.id));
    let mut response = json(status, &Dataset::from(&row));
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

fn query_fault(parameter: &str, code: &'static str, detail: String) -> Problem {
    Problem::of_faults(
        Kind::Invalid,
        [Fault::of_parameter(parameter, code, detail)],
    )
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
    let items = page.rows.iter().map(Dataset::from).collect();
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
    let row = datasets.find(id).await?.ok_or_else(|| no_dataset(id))?;
    Ok(tagged_json(&headers, &Dataset::from(&*row)))
}

fn no_dataset(id: DatasetId) -> Problem {
    Problem::not_found("dataset", &id.to_string())
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
        DatasetRemoval::NotFound => Err(no_dataset(id)),
        DatasetRemoval::InUse(jobs) => {
            let jobs: Vec<String> = jobs.iter().map(ToString::to_string).collect();
            let detail = format!("needed by {}", jobs.join(", "));
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}

/// Which samples.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct SamplesQuery {
    /// Names of signals, separated by commas; all when absent.
    #[param(value_type = Option<String>, example = "reference,position")]
    pub signals: Option<Vec<String>>,
    /// From this instant on `[s]`.
    pub from: Option<f64>,
    /// Up to this instant `[s]`.
    pub to: Option<f64>,
    /// Points at the most; the extremes of each stretch are kept.
    #[param(minimum = 2, maximum = 100_000, default = 2000)]
    pub max_points: Option<u64>,
}

impl FromQuery for SamplesQuery {
    fn read(query: &mut QueryReader) -> Self {
        let signals = query.text("signals");
        let (from, to) = query.interval();
        Self {
            signals: signals.map(|names| names.split(',').map(str::to_owned).collect()),
            from,
            to,
            max_points: query.integer("max_points", 2, MAX_POINTS),
        }
    }
}

/// Read samples: decimated for plots as JSON, or all of them as CSV.
#[utoipa::path(
    get, path = "/v1/datasets/{id}/samples", operation_id = "read_samples", tag = "datasets",
    params(("id" = DatasetId, Path, description = "The recording"), SamplesQuery),
    responses((status = 200, description = "The samples in SI",
               content((Samples = "application/json"), (String = "text/csv"))))
)]
pub async fn samples(
    State(bodies): State<Bodies>,
    Named(id): Named<DatasetId>,
    Params(query): Params<SamplesQuery>,
    headers: HeaderMap,
) -> Answer {
    let permit = bodies.work.recording_permit().await?;
    let wants_csv = prefers(&headers, "text/csv");
    let part = DatasetPart {
        signals: query.signals.clone(),
        from: query.from,
        to: query.to,
    };
    let recording = match wants_csv {
        true => bodies.datasets.recording(id).await?,
        false => bodies.datasets.with_part(id, part).await?,
    };
    let recording = recording.ok_or_else(|| no_dataset(id))?;
    check_names(&recording, query.signals.as_deref())?;
    if wants_csv {
        return csv::answer(
            &bodies,
            whole(Arc::unwrap_or_clone(recording), query)?,
            permit,
        )
        .await;
    }
    let points = query.max_points.unwrap_or(DEFAULT_POINTS);
    let points = usize::try_from(points).expect("the limit is small");
    let written = bodies.work.convert_bytes(recording.bytes(), move || {
        let _permit = permit;
        let names = query.signals.as_deref();
        let samples = recording.decimate(names, query.from, query.to, points);
        Ok(json(StatusCode::OK, &samples))
    });
    written.await
}

fn check_names(recording: &Recording, names: Option<&[String]>) -> Answer<()> {
    let names = names.into_iter().flatten();
    let unknown = names.filter(|name| recording.signal(name).is_none());
    let faults: Vec<Fault> = unknown
        .map(|name| {
            let detail = format!("the recording has no signal `{name}`");
            Fault::of_parameter("signals", "unknown_signal", detail)
        })
        .collect();
    if faults.is_empty() {
        Ok(())
    } else {
        Err(Problem::of_faults(Kind::Invalid, faults))
    }
}

/// A recording with the signals of which every sample is written.
fn whole(mut recording: Recording, query: SamplesQuery) -> Answer<Recording> {
    for (parameter, given) in [
        ("from", query.from.is_some()),
        ("to", query.to.is_some()),
        ("max_points", query.max_points.is_some()),
    ] {
        if given {
            let detail = "text/csv always has all samples".to_owned();
            return Err(query_fault(parameter, "invalid_parameter", detail));
        }
    }
    if let Some(names) = query.signals {
        recording
            .signals
            .retain(|signal| names.contains(&signal.name));
    }
    Ok(recording)
}
