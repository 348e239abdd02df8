//! Versions of recordings: make one, list them, show one.

use std::convert::Infallible;

use axum::extract::{FromRequestParts, RawPathParams, State};
use axum::http::request::Parts;
use axum::http::{StatusCode, Uri};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName as _};
use super::http_headers::json;
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use crate::store::{DatasetVersionRow, Datasets, VersionAdded};
use greybox::identification::DatasetId;
use greybox::identification::spec::{MAX_VERSION, read_new_version};
use greybox::recording::Mark;

/// The marks of a version to be stored.
#[derive(Serialize, ToSchema)]
#[schema(as = NewDatasetVersion)]
#[schema(example = json!({
    "marks": [{"from_s": 12.1, "to_s": 12.3, "signals": ["position"], "reason": "sensor unplugged"}], "based_on": 0
}))]
#[allow(
    dead_code,
    reason = "it describes a document that is read field by field"
)]
pub struct NewDatasetVersion {
    /// Everything that the version marks, not what changes.
    #[schema(max_items = 1000)]
    marks: Vec<Mark>,
    /// The number of the version that was changed: if it is not the newest any more, nothing is stored.
    #[schema(minimum = 0, maximum = 1000)]
    based_on: Option<u32>,
}

/// A version of a recording.
#[derive(Serialize, ToSchema)]
pub struct DatasetVersion {
    /// Which version; 0 is the recording as it came.
    number: u32,
    /// Everything that the version marks as bad.
    marks: Vec<Mark>,
    /// When the version was made; nothing for version 0.
    #[schema(value_type = Option<String>, format = DateTime)]
    created_at: Option<Timestamp>,
    /// Who made the version: `token …`, `person …` or `local`.
    made_by: Option<String>,
}

impl DatasetVersion {
    /// The recording as it came.
    fn unmarked() -> Self {
        Self {
            number: 0,
            marks: Vec::new(),
            created_at: None,
            made_by: None,
        }
    }
}

impl From<DatasetVersionRow> for DatasetVersion {
    fn from(row: DatasetVersionRow) -> Self {
        Self {
            number: row.number,
            marks: row.marks,
            created_at: Some(row.created_at),
            made_by: Some(row.made_by),
        }
    }
}

/// Mark samples of a recording as bad.
///
/// The recording stays as it is: a version of it says which samples jobs do without, each stretch with its reason.
/// Jobs that name no version take the newest one at their submission, and keep it. To take marks back, store a
/// version without them; it is a new version too.
#[utoipa::path(
    post, path = "/v1/datasets/{id}/versions", operation_id = "mark_dataset", tag = "datasets",
    params(("id" = DatasetId, Path, description = "The recording")),
    request_body(content = NewDatasetVersion, content_type = "application/json"),
    responses(
        (status = 201, description = "The version is stored", body = DatasetVersion),
        (status = 200, description = "The newest version marks the same", body = DatasetVersion),
        (status = 409, description = "`based_on` is not the newest version, or the recording has 1000 versions")
    )
)]
pub async fn create(
    State(datasets): State<Datasets>,
    Named(id): Named<DatasetId>,
    _query: Params<NoQuery>,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let row = datasets.find(id).await?.ok_or_else(|| id.not_found())?;
    let new = read_new_version(&document.value, &row.summary).map_err(Problem::of_document)?;
    match datasets.add_version(id, new, client.who).await? {
        VersionAdded::Created(row) => Ok(json(StatusCode::CREATED, &DatasetVersion::from(row))),
        VersionAdded::Unchanged(row) => {
            let version = row.map_or_else(DatasetVersion::unmarked, DatasetVersion::from);
            Ok(json(StatusCode::OK, &version))
        }
        VersionAdded::NotNewest(newest) => {
            let detail =
                format!("the newest version is {newest}: look at its marks, and change those");
            Err(Problem::new(Kind::WrongState, detail))
        }
        VersionAdded::TooMany => {
            let detail = format!("a recording has {MAX_VERSION} versions at the most");
            Err(Problem::new(Kind::WrongState, detail))
        }
        VersionAdded::NotFound => Err(id.not_found()),
    }
}

/// The page of a list.
pub struct WhichVersions(Cursor<u32>);

impl FromQuery for WhichVersions {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// List the versions of a recording, newest first.
#[utoipa::path(
    get, path = "/v1/datasets/{id}/versions", operation_id = "list_dataset_versions", tag = "datasets",
    params(("id" = DatasetId, Path, description = "The recording"), PageParams),
    responses((status = 200, description = "A page of versions", body = Page<DatasetVersion>,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(datasets): State<Datasets>,
    Named(id): Named<DatasetId>,
    Params(WhichVersions(cursor)): Params<WhichVersions>,
    uri: Uri,
) -> Answer {
    datasets.find(id).await?.ok_or_else(|| id.not_found())?;
    let page = datasets.versions(id, cursor.before, cursor.limit).await?;
    let items = page.rows.into_iter().map(DatasetVersion::from).collect();
    Ok(Page::new(items, page.next.map(|number| number.to_string())).answer(&uri))
}

/// Show a version of a recording.
#[utoipa::path(
    get, path = "/v1/datasets/{id}/versions/{number}", operation_id = "show_dataset_version", tag = "datasets",
    params(
        ("id" = DatasetId, Path, description = "The recording"),
        ("number" = u32, Path, description = "Which version; 0 is the recording as it came", minimum = 0)
    ),
    responses((status = 200, description = "The version", body = DatasetVersion))
)]
pub async fn show(
    State(datasets): State<Datasets>,
    Named(id): Named<DatasetId>,
    VersionNumber(number): VersionNumber,
    _query: Params<NoQuery>,
) -> Answer {
    datasets.find(id).await?.ok_or_else(|| id.not_found())?;
    let version = match number.parse() {
        Ok(0) => Some(DatasetVersion::unmarked()),
        Ok(number) => datasets
            .version(id, number)
            .await?
            .map(DatasetVersion::from),
        Err(_) => None,
    };
    let version = version.ok_or_else(|| Problem::not_found("version", &number))?;
    Ok(json(StatusCode::OK, &version))
}

/// The number of a version, which stands in the path below the recording.
pub struct VersionNumber(String);

impl<S: Send + Sync> FromRequestParts<S> for VersionNumber {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, Infallible> {
        let params = RawPathParams::from_request_parts(parts, state).await;
        let number = params.iter().flat_map(RawPathParams::iter).nth(1);
        Ok(Self(
            number.map_or_else(String::new, |(_, number)| number.to_owned()),
        ))
    }
}
