//! Spans for OpenTelemetry: how long the service was busy with what, and in whose trace. They are not
//! made while nobody asked for them.

use axum::http::{HeaderMap, Method};
use opentelemetry::global;
use opentelemetry::propagation::Extractor;
use tracing::field::Empty;
use tracing::{Span, info_span};
use tracing_opentelemetry::OpenTelemetrySpanExt as _;

use crate::access::Project;
use greybox::identification::JobId;

/// The target of all spans, by which they are told from the log.
pub const TARGET: &str = "greybox::span";
/// The status of an answer, once there is one.
const STATUS: &str = "http.response.status_code";

/// A request, from its head to the head of its answer, named by its method and its route. It belongs to
/// the trace that `traceparent` names.
pub fn request(
    method: &Method,
    route: &str,
    (path, id): (&str, &str),
    headers: &HeaderMap,
) -> Span {
    let span = info_span!(
        target: TARGET,
        "request",
        otel.name = format_args!("{method} {route}"),
        otel.kind = "server",
        http.request.method = %method,
        http.route = route,
        url.path = path,
        request_id = id,
        http.response.status_code = Empty,
        otel.status_code = Empty,
    );
    if !span.is_disabled() {
        let parent =
            global::get_text_map_propagator(|propagator| propagator.extract(&Headers(headers)));
        // A span that no exporter sees has no parent either.
        let _ = span.set_parent(parent);
    }
    span
}

/// Notes how a request was answered.
pub fn answered(span: &Span, status: u16) {
    span.record(STATUS, status);
    if status >= 500 {
        span.record("otel.status_code", "ERROR");
    }
}

/// A slice of a job, from its first look at the database to its last write.
pub fn slice(job: JobId, project: &Project) -> Span {
    info_span!(target: TARGET, "slice", %job, %project)
}

/// What a propagator reads of a request.
struct Headers<'h>(&'h HeaderMap);

impl Extractor for Headers<'_> {
    fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key)?.to_str().ok()
    }

    fn keys(&self) -> Vec<&str> {
        self.0.keys().map(|name| name.as_str()).collect()
    }
}
