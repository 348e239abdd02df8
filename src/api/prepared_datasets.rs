//! Recordings that are prepared from others: parts of them, filtered, on other grids, with calculated signals.

use std::collections::BTreeSet;

use axum::extract::State;
use axum::http::StatusCode;
use serde::Serialize;
use sha2::{Digest, Sha256};
use utoipa::{IntoParams, ToSchema};

use super::body::{Bodies, JsonDocument};
use super::client::Client;
use super::dataset_samples::{check_names, max_points, named_signals, points};
use super::datasets::{Dataset, digest, stored, with_conversions};
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName as _};
use super::http_headers::json;
use super::query::{FromQuery, Params, QueryReader};
use crate::store::NewDataset;
use greybox::identification::DatasetId;
use greybox::identification::spec::{MAX_NAME_CHARS, MAX_VERSION};
use greybox::parsing::Fault;
use greybox::preparation::{MAX_VALUES, PreparationStep, Recipe, prepare, read_recipe};
use greybox::recording::{Exclude, Mark, Recording, RecordingSource, Samples, Summary};

/// The format of recordings that were prepared here.
const FORMAT: &str = "prepared";

/// A recipe: the steps by which another recording is made of one.
#[derive(Serialize, ToSchema)]
#[schema(as = Recipe)]
#[schema(example = json!({
    "name": "run 3, the second hour",
    "steps": [
        {"step": "cut", "from_s": 10.0, "to_s": 40.0},
        {"step": "calculate", "signal": "speed", "unit": "rpm", "equation": "60*pulses", "names": {"pulses": "count"}},
        {"step": "resample", "sample_time_s": 0.05, "held": ["command"]}
    ]
}))]
#[allow(
    dead_code,
    reason = "it describes a document that is read field by field"
)]
pub struct RecipeDocument {
    /// A name for people.
    #[schema(max_length = 200)]
    name: Option<String>,
    /// The version of the recording whose marked samples are missing; the newest where it is left out.
    #[schema(minimum = 0, maximum = 1000)]
    version: Option<u32>,
    /// The steps, in their order.
    #[schema(min_items = 1, max_items = 50)]
    steps: Vec<PreparationStep>,
}

/// A recipe is made into a recording, or looked at.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PrepareQuery {
    /// Say what would be made, and store nothing.
    #[param(required = false)]
    pub validate_only: bool,
    /// With `validate_only`: the signals whose samples are shown, separated by commas; all when absent.
    #[param(value_type = Option<String>, example = "reference,position")]
    pub signals: Option<Vec<String>>,
    /// With `validate_only`: points at the most; the extremes of each stretch are kept.
    #[param(minimum = 2, maximum = 100_000, default = 2000)]
    pub max_points: Option<u64>,
}

impl FromQuery for PrepareQuery {
    fn read(query: &mut QueryReader) -> Self {
        let asked = Self {
            validate_only: query.flag("validate_only"),
            signals: named_signals(query),
            max_points: max_points(query),
        };
        let of_samples = [
            ("signals", asked.signals.is_some()),
            ("max_points", asked.max_points.is_some()),
        ];
        for (parameter, _) in of_samples.into_iter().filter(|(_, is_given)| *is_given) {
            if !asked.validate_only {
                let detail = "samples are answered with `validate_only` alone".to_owned();
                query.fault(parameter, "invalid_parameter", detail);
            }
        }
        asked
    }
}

/// The recording that a recipe would make.
#[derive(Serialize, ToSchema)]
pub struct PreparedPreview {
    /// The signals of the recording, and its report.
    #[serde(flatten)]
    summary: Summary,
    /// The samples that the recording would have, thinned out for plots.
    thinned: Samples,
}

/// The answer where nothing is stored.
#[derive(Serialize, ToSchema)]
#[serde(untagged)]
#[allow(
    dead_code,
    reason = "it describes two documents that are answered each by itself"
)]
pub enum NothingStored {
    /// The recording that the same steps made before.
    Earlier(Dataset),
    /// The recording that the steps would make.
    Preview(PreparedPreview),
}

/// Prepare a recording: make another one of it, step by step.
///
/// The recording stays as it is. The one that is made has the steps in its `source` and, in words, in its report; the
/// samples that the version marks as bad are missing before the first step. The same steps of the same version give
/// the same recording. To change a step, make another recording with other steps. With `validate_only` nothing is
/// stored: the answer is the report that the recording would have, and some of its samples.
#[utoipa::path(
    post, path = "/v1/datasets/{id}/prepared", operation_id = "prepare_dataset", tag = "datasets",
    params(
        ("id" = DatasetId, Path, description = "The recording that the steps begin with"),
        PrepareQuery
    ),
    request_body(content = RecipeDocument, content_type = "application/json"),
    responses(
        (status = 201, description = "The prepared recording is stored", body = Dataset,
         headers(("Location" = String, description = "Where the prepared recording is"))),
        (status = 200, description = "The same steps were done before: the same recording. With `validate_only`: \
                                      what the recording would be", body = NothingStored)
    )
)]
pub async fn create(
    State(bodies): State<Bodies>,
    Named(id): Named<DatasetId>,
    Params(query): Params<PrepareQuery>,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let row = bodies
        .datasets
        .find(id)
        .await?
        .ok_or_else(|| id.not_found())?;
    let recipe = read_recipe(&document.value, MAX_NAME_CHARS, MAX_VERSION);
    let recipe = recipe.map_err(Problem::of_document)?;
    if row
        .summary
        .samples
        .saturating_mul(row.summary.signals.len())
        > MAX_VALUES
    {
        let detail = format!(
            "the recording has more than {MAX_VALUES} values: post it in parts, or bring it to a stream and cut \
             windows of that"
        );
        return Err(Problem::new(Kind::Invalid, detail));
    }
    let version = version_of(&bodies, id, recipe.version).await?;
    let permit = bodies.work.recording_permit().await?;
    let recording = bodies.datasets.recording(id).await?;
    let recording = recording.ok_or_else(|| id.not_found())?;
    if query.validate_only {
        let previewed = bodies.work.convert_bytes(recording.bytes(), move || {
            let _permit = permit;
            let prepared = prepared(&recording, &version.marks, &recipe)?;
            preview(&prepared, &query)
        });
        return previewed.await;
    }
    let name = recipe.name.clone().or_else(|| row.name.clone());
    let source = source(id, version.number, &recipe);
    let given = [
        ("marks", json_text(&version.marks)),
        ("steps", source.options["steps"].clone()),
        ("name", name.clone().unwrap_or_default()),
    ];
    let digest = digest(Sha256::new_with_prefix(&row.digest), &given);
    let made = bodies.work.convert_bytes(recording.bytes(), move || {
        let mut prepared = prepared(&recording, &version.marks, &recipe)?;
        prepared.source = source;
        prepared.name.clone_from(&name);
        let summary = prepared.summary();
        Ok(NewDataset {
            project: client.project,
            name,
            digest,
            summary,
            recording: prepared.into(),
        })
    });
    let new = made.await?;
    drop(permit);
    stored(&bodies.datasets, new).await
}

/// The version of a recording that a recipe begins with.
struct BaseVersion {
    number: u32,
    marks: Vec<Mark>,
}

async fn version_of(bodies: &Bodies, id: DatasetId, wanted: Option<u32>) -> Answer<BaseVersion> {
    let named = BTreeSet::from_iter(wanted);
    let mut versions = bodies.datasets.versions_named(id, named).await?;
    let number = wanted.unwrap_or(versions.newest);
    match versions.marks.remove(&number) {
        Some(marks) => Ok(BaseVersion { number, marks }),
        None if number == 0 => Ok(BaseVersion {
            number,
            marks: Vec::new(),
        }),
        None => {
            let detail = format!(
                "the recording has no version {number}: its newest is {}",
                versions.newest
            );
            let fault = Fault::new("/version", "unknown_version", detail);
            Err(Problem::of_document(vec![fault]))
        }
    }
}

/// The recording as the steps leave it, which begin without the samples that are marked.
fn prepared(recording: &Recording, marks: &[Mark], recipe: &Recipe) -> Answer<Recording> {
    let prepared = prepare(without(recording, marks), &recipe.steps);
    prepared.map_err(Problem::of_document)
}

/// The answer on a recording that would be made.
fn preview(prepared: &Recording, query: &PrepareQuery) -> Answer {
    let names = query.signals.as_deref();
    check_names(prepared, names)?;
    let preview = PreparedPreview {
        summary: with_conversions(prepared.summary()),
        thinned: prepared.decimate(names, None, None, points(query.max_points)),
    };
    Ok(json(StatusCode::OK, &preview))
}

/// The recording without the samples that are marked.
fn without(recording: &Recording, marks: &[Mark]) -> Recording {
    let mut recording = recording.clone();
    let marked = Exclude {
        classes: Vec::new(),
        spans: marks.iter().map(Mark::span).collect(),
    };
    marked.leave_out_of(&mut recording);
    recording
}

/// The recording, the version and the steps that a prepared recording was made of.
fn source(id: DatasetId, version: u32, recipe: &Recipe) -> RecordingSource {
    let options = [
        ("dataset", id.to_string()),
        ("version", version.to_string()),
        ("steps", json_text(&recipe.steps)),
    ];
    RecordingSource {
        format: FORMAT.to_owned(),
        options: options.map(|(name, text)| (name.to_owned(), text)).into(),
    }
}

fn json_text(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("steps and marks are JSON")
}
