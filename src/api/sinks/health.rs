//! What agents ask before they write: whether a server of InfluxDB is there and healthy.

use axum::extract::State;
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

use super::protocol::{IsWhole, VERSION, name_version};
use crate::api::ApiState;
use crate::api::health::ready;
use crate::api::http_headers::json;

/// The version, for who asks for more than that the server is there.
#[derive(Serialize, ToSchema)]
pub struct PingAnswer {
    /// The version of InfluxDB whose protocol is spoken.
    #[schema(value_type = String, example = "1.8.10")]
    version: &'static str,
}

/// Whether the server is well, in the form of InfluxDB 2.
#[derive(Serialize, ToSchema)]
pub struct HealthCheck {
    /// The name of the program.
    #[schema(value_type = String, example = "greybox")]
    name: &'static str,
    /// A sentence on the state.
    #[schema(example = "ready for queries and writes")]
    message: String,
    /// `pass`, or `fail` where the server cannot work.
    #[schema(value_type = String, example = "pass")]
    status: &'static str,
    /// Checks of parts; there are none.
    #[schema(value_type = Vec<Object>)]
    checks: [(); 0],
    /// The version of greybox.
    #[schema(value_type = String, example = "0.1.0")]
    version: &'static str,
}

/// Say that the server is there, as InfluxDB does.
///
/// With `verbose=true` the answer has a body.
#[utoipa::path(
    get, path = "/ping", operation_id = "ping", tag = "agents",
    params(("verbose" = Option<String>, Query, description = "`true` for an answer with a body")),
    responses(
        (status = 204, description = "It is there",
         headers(("X-Influxdb-Version" = String,
                  description = "The version of InfluxDB whose protocol is spoken"))),
        (status = 200, description = "It is there, for `verbose=true`", body = PingAnswer)
    )
)]
pub async fn ping(uri: Uri) -> Response {
    let pairs = uri.query().unwrap_or_default().split('&');
    let verbose = pairs
        .filter_map(|pair| pair.strip_prefix("verbose="))
        .next();
    let is_verbose = verbose.is_some_and(|value| !["", "0", "false"].contains(&value));
    let mut response = match is_verbose {
        true => json(StatusCode::OK, &PingAnswer { version: VERSION }),
        false => StatusCode::NO_CONTENT.into_response(),
    };
    name_version(response.headers_mut());
    response
}

/// Say whether the server is well, as InfluxDB 2 does; `GET /readyz` says the same in its own form.
#[utoipa::path(
    get, path = "/health", operation_id = "influx_health", tag = "agents",
    responses((status = 200, description = "It is well", body = HealthCheck),
              (status = 503, description = "It cannot work; `message` says why", body = HealthCheck))
)]
pub async fn health(State(state): State<ApiState>) -> Response {
    let why_not = ready(&state).await.err();
    let is_well = why_not.is_none();
    let message = why_not.map_or_else(
        || "ready for queries and writes".to_owned(),
        |problem| problem.into_parts().1,
    );
    let check = HealthCheck {
        name: "greybox",
        message,
        status: if is_well { "pass" } else { "fail" },
        checks: [],
        version: env!("CARGO_PKG_VERSION"),
    };
    let status = match is_well {
        true => StatusCode::OK,
        false => StatusCode::SERVICE_UNAVAILABLE,
    };
    let mut response = json(status, &check);
    response.extensions_mut().insert(IsWhole);
    name_version(response.headers_mut());
    response
}
