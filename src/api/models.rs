//! The models that can be identified: those of the program and those that users wrote.

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::body::ModelDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::{ModelName, Named};
use super::http_headers::{json, tagged_json};
use super::model_library::{ModelLibrary, new_model};
use super::query::{NoQuery, Params};
use crate::store::{ModelRemoval, ModelRow, ModelStored};
use greybox::model::ModelDescription;
use greybox::model::document::{self, Referenced};
use greybox::parsing::Fault;

/// All models.
#[derive(Serialize, ToSchema)]
pub struct Models {
    /// The models of the program in the order of the catalogue, then models that users wrote,
    /// newest first.
    items: Vec<ModelDescription>,
}

/// A model, with the document that it was read from where there is one.
#[derive(Serialize, ToSchema)]
pub struct ShownModel {
    /// What the model says of itself.
    #[serde(flatten)]
    description: ModelDescription,
    /// The document; nothing for a model that is part of the program.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Object, nullable = false)]
    document: Option<Value>,
}

/// A stored model.
#[derive(Serialize, ToSchema)]
pub struct StoredModel {
    /// `name@digest`, by which jobs and simulations name it.
    #[schema(example = "dc_motor@0123456789abcdef")]
    name: String,
    /// The digest of the whole document.
    digest: String,
    /// When it was stored.
    #[schema(value_type = String, format = DateTime)]
    created_at: jiff::Timestamp,
    /// What its author should know.
    warnings: Vec<Fault>,
    /// What the model says of itself.
    model: ModelDescription,
}

impl StoredModel {
    fn new(row: ModelRow, read: &Referenced) -> Self {
        Self {
            name: row.reference,
            digest: row.digest,
            created_at: row.created_at,
            warnings: read.warnings.clone(),
            model: read.model.description().clone(),
        }
    }
}

/// Store a model: differential equations as text, in a JSON or YAML document.
///
/// With `Content-Type: application/yaml` the same document in YAML (1.2, core schema, without
/// anchors and tags) is taken; it is stored and named as its JSON.
///
/// A stored model never changes: its name is that of the document, `@` and part of its digest. The
/// server keeps all that jobs were made with, and the 500 others that are newest; one more takes the
/// place of the oldest of whoever brought the most.
/// Everything that is wrong with a document is told at once, with line and column in the
/// expression.
#[utoipa::path(
    post, path = "/v1/models", operation_id = "create_model", tag = "models",
    params(("Content-Encoding" = Option<String>, Header, example = "gzip",
          description = "`gzip` where the body is compressed")),
    request_body(
        content(
            (Object = "application/json", example = json!({
                "name": "lag",
                "inputs": {"u": {"unit": "V"}},
                "parameters": {"time": {"symbol": "T", "unit": "s", "default": 1, "lower": 0.1,
                                        "upper": 10, "scale": "log", "unknown": true}},
                "states": {"y": {"unit": "V", "derivative": "(u - y)/T", "initial": 0}},
                "outputs": {"y_measured": {"unit": "V", "expression": "y"}}
            })),
            (String = "application/yaml", example = "name: lag\ninputs:\n  u: {unit: V}\nparameters:\n  \
                time: {symbol: T, unit: s, default: 1, lower: 0.1, upper: 10, scale: log, unknown: true}\n\
                states:\n  y: {unit: V, derivative: (u - y)/T, initial: 0}\noutputs:\n  \
                y_measured: {unit: V, expression: y}\n")
        ),
        description = "The model document"
    ),
    responses(
        (status = 201, description = "It is stored", body = StoredModel,
         headers(("Location" = String, description = "Where the model is"))),
        (status = 200, description = "The same document came before", body = StoredModel,
         headers(("Location" = String, description = "Where the model is")))
    )
)]
pub async fn create(
    State(library): State<ModelLibrary>,
    _query: Params<NoQuery>,
    client: Client,
    ModelDocument(document): ModelDocument,
) -> Answer {
    // A document that is refused is also taken apart beside the threads that serve.
    let read = library
        .work
        .convert(move || Ok(document::referenced(&document).map(|read| (read, document))));
    let (read, document) = read.await?.map_err(Problem::of_document)?;
    let new = new_model(&read, document, client);
    let (status, row) = match library.models.insert(new).await? {
        ModelStored::Created(row) => (StatusCode::CREATED, row),
        ModelStored::There(row) => (StatusCode::OK, row),
    };
    let location = format!("/v1/models/{}", row.reference);
    let mut response = json(status, &StoredModel::new(row, &read));
    // A name may hold letters that a header may not; the body names it too.
    if let Ok(location) = HeaderValue::from_str(&location) {
        response.headers_mut().insert(header::LOCATION, location);
    }
    Ok(response)
}

/// List the models with their signals, parameters and equations.
#[utoipa::path(
    get, path = "/v1/models", operation_id = "list_models", tag = "models",
    responses((status = 200, description = "All models", body = Models))
)]
pub async fn list(
    State(library): State<ModelLibrary>,
    client: Client,
    _query: Params<NoQuery>,
) -> Answer {
    let mut items: Vec<ModelDescription> = library
        .catalogue
        .iter()
        .map(|model| model.description().clone())
        .collect();
    let rows = library.models.list(&client.project).await?;
    let written = library.work.convert(move || {
        let read = rows
            .iter()
            .filter_map(|row| document::referenced(&row.document).ok());
        Ok(read
            .map(|read| read.model.description().clone())
            .collect::<Vec<_>>())
    });
    items.extend(written.await?);
    Ok(json(StatusCode::OK, &Models { items }))
}

/// Show one model.
#[utoipa::path(
    get, path = "/v1/models/{name}", operation_id = "show_model", tag = "models",
    params(("name" = String, Path,
            description = "The model's name; `name@digest` for one that a user wrote",
            example = "single_rod_servo")),
    responses((status = 200, description = "The model", body = ShownModel))
)]
pub async fn show(
    State(library): State<ModelLibrary>,
    client: Client,
    Named(ModelName(name)): Named<ModelName>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    let model = library.model(&client.project, &name).await?;
    let document = match model.document() {
        Some(document) => Some(document.clone()),
        None => {
            let row = library.models.find(&client.project, &name).await?;
            row.map(|row| row.document)
        }
    };
    let shown = ShownModel {
        description: model.description().clone(),
        document,
    };
    Ok(tagged_json(&headers, &shown))
}

/// Remove a model that no job was made with.
#[utoipa::path(
    delete, path = "/v1/models/{name}", operation_id = "delete_model", tag = "models",
    params(("name" = String, Path, description = "The model's `name@digest`")),
    responses(
        (status = 204, description = "It is gone"),
        (status = 409, description = "A job was made with it, or it is part of the program")
    )
)]
pub async fn remove(
    State(library): State<ModelLibrary>,
    client: Client,
    Named(ModelName(name)): Named<ModelName>,
    _query: Params<NoQuery>,
) -> Answer {
    if library.catalogue.get(&name).is_some() {
        let detail = format!("`{name}` is part of the program");
        return Err(Problem::new(Kind::WrongState, detail));
    }
    match library.models.delete(&client.project, &name).await? {
        ModelRemoval::Removed => Ok(StatusCode::NO_CONTENT.into_response()),
        ModelRemoval::NotFound => Err(Problem::not_found("model", &name)),
        ModelRemoval::InUse(jobs) => {
            let jobs: Vec<String> = jobs.iter().map(ToString::to_string).collect();
            let detail = format!("needed by {}", jobs.join(", "));
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}
