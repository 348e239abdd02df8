//! The models that can be identified.

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use serde::Serialize;
use utoipa::ToSchema;

use super::ApiState;
use super::error::Answer;
use super::extract::Named;
use super::manners::{json, tagged_json};
use super::query::{NoQuery, Params};
use crate::model::ModelDescription;

/// All models.
#[derive(Serialize, ToSchema)]
pub struct Models<'a> {
    /// The models, in the order of the catalogue.
    #[schema(value_type = Vec<ModelDescription>)]
    items: Vec<&'a ModelDescription>,
}

/// List the models with their signals, parameters and equations.
#[utoipa::path(
    get, path = "/v1/models", operation_id = "list_models", tag = "models",
    responses((status = 200, description = "All models", body = Models))
)]
pub async fn list(State(state): State<ApiState>, _query: Params<NoQuery>) -> Response {
    let items = state.catalogue.iter().map(|model| model.description());
    let items = items.collect();
    json(StatusCode::OK, &Models { items })
}

/// Show one model.
#[utoipa::path(
    get, path = "/v1/models/{name}", operation_id = "show_model", tag = "models",
    params(("name" = String, Path, description = "The model's name",
            example = "single_rod_servo")),
    responses((status = 200, description = "The model", body = ModelDescription))
)]
pub async fn show(
    State(state): State<ApiState>,
    Named(name): Named<String>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    Ok(tagged_json(&headers, state.model(&name)?.description()))
}
