//! Taking samples out of a stream: those of a clock that was wrong, or of a sensor that was.

use axum::extract::State;
use axum::http::StatusCode;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::{IntoParams, ToSchema};

use super::stamps::nanoseconds;
use super::{StreamName, read_instants};
use crate::api::audit::ActedOn;
use crate::api::client::Client;
use crate::api::error::{Answer, Problem};
use crate::api::extract::Named;
use crate::api::http_headers::json;
use crate::api::query::{FromQuery, Params, QueryReader};
use crate::store::{StreamRow, Streams};

/// Which samples are to go.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct RemovedSpan {
    /// From this instant on, or from the first sample; with an offset, whose `+` is written `%2B` in a
    /// query. One of `from` and `to` is needed.
    #[param(value_type = Option<String>, format = DateTime, example = "2036-03-02T08:15:00Z")]
    pub from: Option<Timestamp>,
    /// Up to, and without, this instant, or up to the last sample.
    #[param(value_type = Option<String>, format = DateTime, example = "2036-03-02T09:15:00Z")]
    pub to: Option<Timestamp>,
}

impl FromQuery for RemovedSpan {
    fn read(query: &mut QueryReader) -> Self {
        let (from, to) = read_instants(query);
        if from.is_none() && to.is_none() {
            let detail =
                "one of `from` and `to` is needed; `DELETE /v1/streams/{name}` removes all";
            query.fault("from", "missing", detail.to_owned());
        }
        Self { from, to }
    }
}

/// What went, and what is left.
#[derive(Serialize, ToSchema)]
pub struct RemovedSamples {
    /// Samples that went.
    removed: u64,
    /// The stream as it then stood.
    stream: StreamRow,
}

/// Remove samples of a stream. Recordings that were cut out of it stay.
#[utoipa::path(
    delete, path = "/v1/streams/{name}/samples", operation_id = "remove_stream_samples",
    tag = "streams",
    params(("name" = String, Path, description = "The stream"), RemovedSpan),
    responses((status = 200, description = "They are removed", body = RemovedSamples))
)]
pub async fn remove_samples(
    State(streams): State<Streams>,
    client: Client,
    Named(StreamName(name)): Named<StreamName>,
    Params(span): Params<RemovedSpan>,
) -> Answer {
    let text = |instant: Option<Timestamp>| instant.map_or_else(String::new, |at| at.to_string());
    let (from, to) = (text(span.from), text(span.to));
    let acted_on = ActedOn(format!("/v1/streams/{name}/samples?from={from}&to={to}"));
    let ns = |instant: Option<Timestamp>, open| instant.map_or(open, nanoseconds);
    let span = (ns(span.from, i64::MIN), ns(span.to, i64::MAX));
    let cleared = streams.remove_samples(&client.project, &name, span);
    let cleared = cleared.await?;
    let cleared = cleared.ok_or_else(|| Problem::not_found("stream", &name))?;
    let shown = RemovedSamples {
        removed: cleared.removed,
        stream: cleared.stream,
    };
    let mut response = json(StatusCode::OK, &shown);
    response.extensions_mut().insert(acted_on);
    Ok(response)
}
