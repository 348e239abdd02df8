//! The record of the contract: OpenAPI 3.1, generated from the handlers.

use axum::http::HeaderMap;
use axum::response::Response;
use utoipa::ToSchema;
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::response::Response as Description;
use utoipa::openapi::schema::Schema;
use utoipa::openapi::{InfoBuilder, LicenseBuilder, OpenApi, OpenApiBuilder, Ref, RefOr};
use utoipa::openapi::{ResponseBuilder, tag::TagBuilder};

use super::error::{PROBLEM_JSON, ProblemDocument};
use super::manners::tagged_json;
use crate::job::Event;

/// The description of the whole API.
pub fn openapi() -> OpenApi {
    let (_router, mut openapi) = super::described().split_for_parts();
    let mut unnamed = Vec::new();
    name_schema::<ProblemDocument>(&mut unnamed);
    name_schema::<Event>(&mut unnamed);
    let components = openapi.components.get_or_insert_default();
    components.schemas.extend(unnamed);
    for (path, item) in &mut openapi.paths.paths {
        for operation in operations(item) {
            describe_problems(path, operation);
        }
    }
    openapi
}

/// Names a type and those that it is made of, for what no handler takes or answers as a body.
fn name_schema<T: ToSchema>(schemas: &mut Vec<(String, RefOr<Schema>)>) {
    schemas.push((T::name().into_owned(), T::schema()));
    T::schemas(schemas);
}

/// The description of this API.
#[utoipa::path(
    get, path = "/openapi.json", operation_id = "openapi", tag = "health",
    responses((status = 200, description = "OpenAPI 3.1", body = Object))
)]
pub async fn document(headers: HeaderMap) -> Response {
    tagged_json(&headers, &openapi())
}

/// What the handlers do not say.
pub(super) fn preamble() -> OpenApi {
    let license = LicenseBuilder::new()
        .name("MIT")
        .identifier(Some("MIT"))
        .build();
    let info = InfoBuilder::new()
        .title("greybox")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some(
            "Finds the physical parameters of a plant from recorded data: store a recording, \
             submit a job, follow it, read the estimate.\n\n\
             Every number is in SI unless a unit stands beside it. Errors are RFC 9457 problem \
             documents that list all faults at once. Unknown fields and parameters are faults.",
        ))
        .license(Some(license))
        .build();
    let tags = [
        ("datasets", "Recordings of a plant."),
        ("models", "The structures that can be identified."),
        ("jobs", "Estimations, from submission to result."),
        ("health", "The server itself."),
    ];
    let tags =
        tags.map(|(name, text)| TagBuilder::new().name(name).description(Some(text)).build());
    OpenApiBuilder::new().info(info).tags(Some(tags)).build()
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    [&mut item.get, &mut item.post, &mut item.delete]
        .into_iter()
        .filter_map(Option::as_mut)
}

/// Adds the problems that every operation of a kind can answer, and gives those that a handler
/// named the form of a problem.
fn describe_problems(path: &str, operation: &mut Operation) {
    let mut common: Vec<(u16, &str)> = vec![
        (500, "The server failed"),
        (503, "The server is busy, starting or shutting down"),
    ];
    if path.starts_with("/v1/") {
        common.push((
            422,
            "The request was understood but is wrong; all faults are listed",
        ));
    }
    if path.contains('{') {
        common.push((404, "There is no such thing"));
    }
    if operation.request_body.is_some() {
        common.extend([
            (400, "The body cannot be read; with line and column"),
            (408, "The body came too slowly"),
            (413, "The body is larger than the limit, which is told"),
            (415, "The body's type or encoding is not understood"),
        ]);
    }
    let responses = &mut operation.responses.responses;
    for (status, text) in common {
        responses
            .entry(status.to_string())
            .or_insert_with(|| ResponseBuilder::new().description(text).build().into());
    }
    for (status, response) in responses {
        if let (true, RefOr::T(response)) = (status.as_str() >= "400", response) {
            as_problem(response);
        }
    }
}

fn as_problem(response: &mut Description) {
    let schema = Ref::from_schema_name("Problem");
    let content = ContentBuilder::new().schema(Some(schema)).build();
    let content = RefOr::T(content);
    response.content.insert(PROBLEM_JSON.to_owned(), content);
}
