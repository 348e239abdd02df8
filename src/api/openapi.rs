//! The record of the contract: OpenAPI 3.1, generated from the handlers.

mod names;
mod refusals;

use std::collections::BTreeMap;

use serde_json::{Value, json};
use utoipa::ToSchema;
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::link::Link;
use utoipa::openapi::path::{Operation, PathItem};
use utoipa::openapi::response::Response as Description;
use utoipa::openapi::schema::{Schema, SchemaType, Type};
use utoipa::openapi::{
    InfoBuilder, LicenseBuilder, OpenApi, OpenApiBuilder, Ref, RefOr, Required, ResponseBuilder,
    tag::TagBuilder,
};

use super::error::{PROBLEM_JSON, ProblemDocument};
use super::sinks::protocol::Protocol;
use super::sinks::{Influx1Error, Influx2Error};
use crate::job::Event;
use greybox::intake::units;
use greybox::recording::RecordingVersion;

/// The description of the handlers, with what they do not say themselves.
pub(super) fn completed(mut openapi: OpenApi) -> Value {
    let mut unnamed = Vec::new();
    name_schema::<ProblemDocument>(&mut unnamed);
    name_schema::<Event>(&mut unnamed);
    name_schema::<RecordingVersion>(&mut unnamed);
    name_schema::<Influx1Error>(&mut unnamed);
    name_schema::<Influx2Error>(&mut unnamed);
    let components = openapi.components.get_or_insert_default();
    components.schemas.extend(unnamed);
    link_created(&mut openapi);
    for (path, item) in &mut openapi.paths.paths {
        for operation in operations(item) {
            never_null(operation);
            // No operation that takes a body can do without.
            if let Some(RefOr::T(body)) = &mut operation.request_body {
                body.required = Some(Required::True);
            }
            match Protocol::of_path(path) {
                Some(protocol) => refusals::describe(protocol, operation),
                None => describe_problems(path, operation),
            }
        }
    }
    let mut description = serde_json::to_value(openapi).expect("a description has only text keys");
    names::name_all(&mut description);
    names::name_files(&mut description);
    let functions = greybox::model::document::functions().collect::<BTreeMap<_, _>>();
    description["x-functions"] = json!(functions);
    description["x-units"] = json!(display_units());
    // An empty page of jobs is one of both kinds.
    let page = description.pointer_mut("/components/schemas/JobsPage");
    if let Some(page) = page.and_then(Value::as_object_mut)
        && let Some(forms) = page.remove("oneOf")
    {
        page.insert("anyOf".to_owned(), forms);
    }
    description
}

/// The units in which people read values, by SI unit: a value in SI is the factor times the value in the
/// unit, plus the offset.
fn display_units() -> BTreeMap<&'static str, Vec<Value>> {
    let choices = |names: &[&'static str]| {
        let units = names
            .iter()
            .filter_map(|name| Some((name, units::parse(name)?)));
        let shown = units.map(
            |(name, unit)| json!({ "name": name, "factor": unit.factor, "offset": unit.offset }),
        );
        shown.collect()
    };
    let units = units::READ_IN.iter();
    units.map(|(si, names)| (*si, choices(names))).collect()
}

/// Names a type and those that it is made of, for what no handler takes or answers as a body.
fn name_schema<T: ToSchema>(schemas: &mut Vec<(String, RefOr<Schema>)>) {
    schemas.push((T::name().into_owned(), T::schema()));
    T::schemas(schemas);
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
        ("streams", "Recordings that grow."),
        (
            "agents",
            "What collecting agents write as to InfluxDB, and where it goes.",
        ),
        ("monitors", "Streams that are watched, window by window."),
        ("models", "The structures that can be identified."),
        ("jobs", "Estimations, from submission to result."),
        ("health", "The server itself."),
        (
            "access",
            "Who asks, who did what, and where events are delivered.",
        ),
    ];
    let tags =
        tags.map(|(name, text)| TagBuilder::new().name(name).description(Some(text)).build());
    OpenApiBuilder::new().info(info).tags(Some(tags)).build()
}

fn operations(item: &mut PathItem) -> impl Iterator<Item = &mut Operation> {
    [
        &mut item.get,
        &mut item.post,
        &mut item.put,
        &mut item.patch,
        &mut item.delete,
    ]
    .into_iter()
    .filter_map(Option::as_mut)
}

/// Says of each resource that is made by a POST where one goes on with its identifier.
fn link_created(openapi: &mut OpenApi) {
    let mut by_path: Vec<(String, String)> = Vec::new();
    for (path, item) in &mut openapi.paths.paths {
        let ids = operations(item).filter_map(|operation| operation.operation_id.clone());
        by_path.extend(ids.map(|id| (path.clone(), id)));
    }
    for (path, item) in &mut openapi.paths.paths {
        let made = item
            .post
            .iter_mut()
            .flat_map(|post| &mut post.responses.responses);
        let made = made.filter(|(status, _)| ["201", "202"].contains(&status.as_str()));
        let below = format!("{path}/{{id}}");
        for (_, response) in made {
            let RefOr::T(response) = response else {
                continue;
            };
            for (_, id) in by_path.iter().filter(|(path, _)| path.starts_with(&below)) {
                let link = Link::builder().operation_id(id);
                let link = link.parameter("id", "$response.body#/id").build();
                response.links.insert(id.clone(), RefOr::T(link));
            }
        }
    }
}

/// A parameter is there or not; it has no way to say `null`.
fn never_null(operation: &mut Operation) {
    for parameter in operation.parameters.iter_mut().flatten() {
        if let RefOr::T(parameter) = parameter
            && let Some(RefOr::T(Schema::Object(schema))) = &mut parameter.schema
            && let SchemaType::Array(types) = &mut schema.schema_type
        {
            types.retain(|kind| *kind != Type::Null);
            if let [only] = types.as_slice() {
                schema.schema_type = SchemaType::Type(only.clone());
            }
        }
    }
}

/// Adds the problems that every operation of a kind can answer, and gives those that a handler
/// named the form of a problem.
fn describe_problems(path: &str, operation: &mut Operation) {
    let mut common: Vec<(u16, &str)> = vec![
        (
            403,
            "The caller may not do that, or the request comes from a page of another site",
        ),
        (421, "The server has another name than the request asks"),
        (500, "The server failed"),
        (503, "The server is busy, starting or shutting down"),
    ];
    if path.starts_with("/v1/") || path == "/metrics" {
        common.extend([
            (
                401,
                "The server asks who calls, and the request does not say, or wrongly",
            ),
            (
                429,
                "The caller asks too much at once, or its project has as much as it may",
            ),
        ]);
    }
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
            (507, "The server's disk is full; nothing was stored"),
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

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::api::openapi;

    /// Path, method and description of every operation.
    fn all() -> Vec<(String, Value)> {
        let described = openapi();
        let paths = described["paths"].as_object().unwrap().clone();
        let operations = paths.into_iter().flat_map(|(path, item)| {
            let methods = item.as_object().unwrap().clone();
            methods
                .into_iter()
                .map(move |(method, operation)| (format!("{method} {path}"), operation))
        });
        operations.collect()
    }

    #[test]
    fn every_operation_has_its_own_name() {
        let names: Vec<String> = all()
            .iter()
            .map(|(_, operation)| operation["operationId"].as_str().unwrap().to_owned())
            .collect();
        let distinct: HashSet<&String> = names.iter().collect();
        assert_eq!(distinct.len(), names.len(), "{names:?}");
    }

    #[test]
    fn every_error_is_described_as_a_problem_document() {
        let of_problems = |(name, _): &(String, Value)| {
            let path = name.split_once(' ').map_or("", |(_, path)| path);
            Protocol::of_path(path).is_none()
        };
        for (name, operation) in all().into_iter().filter(of_problems) {
            let responses = operation["responses"].as_object().unwrap().iter();
            for (status, response) in responses.filter(|(status, _)| status.as_str() >= "400") {
                let content = response["content"].as_object().unwrap();
                assert!(content.contains_key(PROBLEM_JSON), "{name} {status}");
            }
        }
    }

    #[test]
    fn every_display_unit_is_a_multiple_of_its_si_unit() {
        let units = display_units();
        for (si, names) in units::READ_IN {
            assert_eq!(units[si].len(), names.len(), "{si}: every name is known");
            let si = units::parse(names[0]).expect("a known unit").si;
            for name in *names {
                assert_eq!(units::parse(name).expect("a known unit").si, si, "{name}");
            }
        }
        assert_eq!(
            units["K"][1],
            json!({ "name": "°C", "factor": 1.0, "offset": 273.15 })
        );
    }

    #[test]
    fn every_request_body_has_an_example() {
        let described = openapi();
        let bodies = all().into_iter().filter_map(|(name, operation)| {
            let body = operation.get("requestBody")?;
            Some((name, body["content"].as_object()?.clone()))
        });
        let mut n_bodies = 0;
        for (name, content) in bodies {
            for (media_type, body) in content {
                let schema = body["schema"]["$ref"].as_str().unwrap_or_default();
                let named = described.pointer(schema.trim_start_matches('#'));
                // There is no text that shows the bytes of a file.
                let is_file = named.is_some_and(|schema| schema["format"] == "binary");
                let has_example = body.get("example").is_some()
                    || named.is_some_and(|schema| schema.get("example").is_some());
                assert!(has_example || is_file, "{name} as {media_type}");
                n_bodies += usize::from(!is_file);
            }
        }
        assert_eq!(
            n_bodies, 31,
            "three forms of a recording and of a batch, a version, a recipe, two of a layout and one that is kept, two of a model, a simulation, a design, a selection, \
             a job and its words, a comparison, a part of a stream and its marks, a monitor and its move, a webhook, a token, \
             a mapping, the lines of two protocols and two of messages"
        );
    }
}
