//! Layouts that are kept under a name: options for the next export of a kind.

use std::str::FromStr;

use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName, chosen_name};
use super::http_headers::json;
use super::query::{NoQuery, Params};
use super::reading::{option_fault, option_names};
use crate::access::Project;
use crate::store::{
    LayoutOptions, LayoutPut, Layouts, MAX_LAYOUTS, SavedLayout, Store, StoreError,
};
use greybox::parsing::reader::{Field, did_you_mean, read_document};

/// The characters of a layout's name at the most.
const MAX_NAME: usize = 100;
/// The characters of the text of an option at the most.
const MAX_TEXT: usize = 10_000;

/// The name of a layout.
pub struct LayoutName(String);

impl FromStr for LayoutName {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        chosen_name(text, MAX_NAME).map(Self).ok_or(())
    }
}

impl PathName for LayoutName {
    const WHAT: &'static str =
        "layout (its name has no slash and 100 characters at the most) called";

    async fn project(&self, _store: &Store) -> Result<Option<Project>, StoreError> {
        Ok(None)
    }
}

/// Options for reading a body with samples.
#[derive(Serialize, ToSchema)]
#[schema(example = json!({"options": {"tag": "Messstelle", "value": "Wert", "decimal": ",", "tz": "Europe/Berlin"}}))]
#[allow(
    dead_code,
    reason = "it describes a document that is read field by field"
)]
pub struct NewLayout {
    /// The options of `POST /v1/datasets` by their names, each as its text in the query.
    options: LayoutOptions,
}

/// A layout that is kept under its name.
#[derive(Serialize, ToSchema)]
pub struct NamedLayout {
    /// The name of the layout.
    name: String,
    /// The options by their names, each as its text in the query.
    options: LayoutOptions,
    /// When the layout was made.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    /// When the options were last changed.
    #[schema(value_type = String, format = DateTime)]
    changed_at: Timestamp,
}

impl From<SavedLayout> for NamedLayout {
    fn from(row: SavedLayout) -> Self {
        Self {
            name: row.name,
            options: row.options,
            created_at: row.created_at,
            changed_at: row.changed_at,
        }
    }
}

/// All layouts of a project.
#[derive(Serialize, ToSchema)]
pub struct LayoutList {
    /// The layouts by name.
    items: Vec<NamedLayout>,
}

/// Keep a layout under a name.
///
/// Recordings, batches and previews that name the layout (`?layout=name`) are read with its options, as far as their
/// query does not give others. What was read stays as it is when the layout changes.
#[utoipa::path(
    put, path = "/v1/layouts/{name}", operation_id = "put_layout", tag = "datasets",
    params(("name" = String, Path, description = "The layout", example = "monthly export of hall 2")),
    request_body(content = NewLayout, content_type = "application/json"),
    responses(
        (status = 201, description = "It is stored, and new", body = NamedLayout),
        (status = 200, description = "It is stored in the place of the one before", body = NamedLayout),
        (status = 409, description = "The project has as many layouts as it may")
    )
)]
pub async fn put(
    State(layouts): State<Layouts>,
    client: Client,
    Named(LayoutName(name)): Named<LayoutName>,
    _query: Params<NoQuery>,
    document: JsonDocument,
) -> Answer {
    let options = read_document(&document.value, read).map_err(Problem::of_document)?;
    let (status, row) = match layouts.put(&client.project, &name, options).await? {
        LayoutPut::Created(row) => (StatusCode::CREATED, row),
        LayoutPut::Replaced(row) => (StatusCode::OK, row),
        LayoutPut::TooMany => {
            let detail = format!("a project has {MAX_LAYOUTS} layouts at the most");
            return Err(Problem::new(Kind::WrongState, detail));
        }
    };
    Ok(json(status, &NamedLayout::from(row)))
}

/// List the layouts of the project.
#[utoipa::path(
    get, path = "/v1/layouts", operation_id = "list_layouts", tag = "datasets",
    responses((status = 200, description = "All layouts", body = LayoutList))
)]
pub async fn list(
    State(layouts): State<Layouts>,
    client: Client,
    _query: Params<NoQuery>,
) -> Answer {
    let rows = layouts.list(&client.project).await?;
    let items = rows.into_iter().map(NamedLayout::from).collect();
    Ok(json(StatusCode::OK, &LayoutList { items }))
}

/// Show a layout.
#[utoipa::path(
    get, path = "/v1/layouts/{name}", operation_id = "show_named_layout", tag = "datasets",
    params(("name" = String, Path, description = "The layout")),
    responses((status = 200, description = "The layout", body = NamedLayout))
)]
pub async fn show(
    State(layouts): State<Layouts>,
    client: Client,
    Named(LayoutName(name)): Named<LayoutName>,
    _query: Params<NoQuery>,
) -> Answer {
    let row = layouts.find(&client.project, &name).await?;
    let row = row.ok_or_else(|| Problem::not_found("layout", &name))?;
    Ok(json(StatusCode::OK, &NamedLayout::from(row)))
}

/// Remove a layout. Recordings that were read with it stay.
#[utoipa::path(
    delete, path = "/v1/layouts/{name}", operation_id = "remove_layout", tag = "datasets",
    params(("name" = String, Path, description = "The layout")),
    responses((status = 204, description = "It is removed"))
)]
pub async fn remove(
    State(layouts): State<Layouts>,
    client: Client,
    Named(LayoutName(name)): Named<LayoutName>,
    _query: Params<NoQuery>,
) -> Answer<Response> {
    match layouts.delete(&client.project, &name).await? {
        true => Ok(StatusCode::NO_CONTENT.into_response()),
        false => Err(Problem::not_found("layout", &name)),
    }
}

fn read(root: &Field<'_>) -> Option<LayoutOptions> {
    let mut object = root.object()?;
    let options = object.required("options");
    object.finish();
    let field = options?;
    let options = field.object()?;
    if options.n_entries() == 0 {
        field.fault("missing_field", "a layout has an option at the least");
    }
    let read: Vec<_> = options
        .entries()
        .map(|(name, text)| read_option(name, &text))
        .collect();
    read.into_iter().collect()
}

fn read_option(name: &str, field: &Field<'_>) -> Option<(String, String)> {
    if !option_names().any(|option| option == name) {
        let hint = did_you_mean(name, option_names());
        field.fault(
            "unknown_field",
            format!("there is no option `{name}`{hint}"),
        );
        return None;
    }
    let text = field.text()?;
    let fault = match (1..=MAX_TEXT).contains(&text.chars().count()) && !text.contains('\0') {
        true => option_fault(name, text).err(),
        false => Some(format!(
            "an option has 1 to {MAX_TEXT} characters, none of them NUL"
        )),
    };
    if let Some(detail) = fault {
        field.fault("invalid_option", detail);
        return None;
    }
    Some((name.to_owned(), text.to_owned()))
}
