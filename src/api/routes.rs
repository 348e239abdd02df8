//! The route table, and what is described of it.

use std::sync::LazyLock;

use axum::Router;
use axum::http::HeaderMap;
use axum::middleware::from_fn_with_state;
use axum::response::Response;
use serde_json::Value;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use super::http_headers::tagged_json;
use super::state::ApiState;
use super::{
    audit, authorise, candidates, changes, comparisons, dataset_samples, dataset_versions,
    datasets, demonstration, designs, disturbance, events, health, job_list, job_words, jobs,
    layouts, mappings, models, monitors, named_layouts, posterior, prepared_datasets, report,
    results, selections, session, simulations, sinks, sources, streams, submit, time_left,
    trajectory, verdict_rules, webhooks,
};

/// Every resource of the service, with its description.
fn described() -> OpenApiRouter<ApiState> {
    OpenApiRouter::with_openapi(super::openapi::preamble())
        .routes(routes!(health::livez))
        .routes(routes!(health::readyz))
        .routes(routes!(health::version))
        .routes(routes!(health::metrics))
        .routes(routes!(document))
        .merge(recordings_and_models())
        .merge(streams_and_monitors())
        .merge(jobs_and_computations())
        .routes(routes!(session::sign_in, session::show, session::sign_out))
        .routes(routes!(session::provider::leave))
        .routes(routes!(session::provider::arrive))
        .routes(routes!(audit::list))
        .routes(routes!(webhooks::create, webhooks::list))
        .routes(routes!(webhooks::show, webhooks::remove))
        .routes(routes!(webhooks::deliveries))
        .routes(routes!(webhooks::show_delivery))
        .routes(routes!(webhooks::resend))
}

fn recordings_and_models() -> OpenApiRouter<ApiState> {
    OpenApiRouter::new()
        .routes(routes!(datasets::create, datasets::list))
        .routes(routes!(datasets::show, datasets::remove))
        .routes(routes!(dataset_samples::samples))
        .routes(routes!(dataset_versions::create, dataset_versions::list))
        .routes(routes!(dataset_versions::show))
        .routes(routes!(prepared_datasets::create))
        .routes(routes!(layouts::show, named_layouts::list))
        .routes(routes!(
            named_layouts::put,
            named_layouts::show,
            named_layouts::remove
        ))
        .routes(routes!(models::create, models::list))
        .routes(routes!(models::show, models::remove))
}

fn streams_and_monitors() -> OpenApiRouter<ApiState> {
    OpenApiRouter::new()
        .routes(routes!(streams::list))
        .routes(routes!(streams::append, streams::show, streams::remove))
        .routes(routes!(streams::cut::cut))
        .routes(routes!(streams::marks::show, streams::marks::put))
        .routes(routes!(streams::removal::remove_samples))
        .routes(routes!(mappings::list))
        .routes(routes!(mappings::put, mappings::show, mappings::remove))
        .routes(routes!(sources::list))
        .routes(routes!(sources::put, sources::show, sources::forget))
        .routes(routes!(sinks::write_influx_1))
        .routes(routes!(sinks::write_influx_2))
        .routes(routes!(sinks::omf::write_default))
        .routes(routes!(sinks::omf::write))
        .routes(routes!(sinks::health::ping))
        .routes(routes!(sinks::health::health))
        .routes(routes!(monitors::create, monitors::list))
        .routes(routes!(monitors::show, monitors::remove))
        .routes(routes!(monitors::moving::move_to))
        .routes(routes!(monitors::windows))
        .routes(routes!(monitors::alarms))
        .routes(routes!(monitors::events::events))
}

fn jobs_and_computations() -> OpenApiRouter<ApiState> {
    OpenApiRouter::new()
        .routes(routes!(simulations::simulate))
        .routes(routes!(demonstration::show))
        .routes(routes!(designs::design))
        .routes(routes!(selections::select))
        .routes(routes!(selections::estimate))
        .routes(routes!(comparisons::submit_comparison, comparisons::list))
        .routes(routes!(comparisons::show))
        .routes(routes!(submit::submit, job_list::list))
        .routes(routes!(jobs::show, jobs::remove, job_words::rename))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::pause))
        .routes(routes!(jobs::resume))
        .routes(routes!(events::events))
        .routes(routes!(changes::changes))
        .routes(routes!(results::generations))
        .routes(routes!(candidates::candidates))
        .routes(routes!(results::result))
        .routes(routes!(time_left::show))
        .routes(routes!(trajectory::trajectory))
        .routes(routes!(disturbance::disturbance))
        .routes(routes!(posterior::posterior))
        .routes(routes!(report::report))
        .routes(routes!(verdict_rules::list))
}

/// The resources, without what [`with_middleware`](super::with_middleware) puts around them.
pub fn resources(state: ApiState) -> Router {
    let (router, _openapi) = described().split_for_parts();
    router
        .layer(from_fn_with_state(
            state.callers.clone(),
            authorise::authorise,
        ))
        .layer(from_fn_with_state(
            state.store.damage().clone(),
            health::note_damage,
        ))
        .with_state(state)
}

/// The description of the whole API.
pub fn openapi() -> Value {
    let (_router, openapi) = described().split_for_parts();
    super::openapi::completed(openapi)
}

/// The description of this API.
#[utoipa::path(
    get, path = "/openapi.json", operation_id = "openapi", tag = "health",
    responses((status = 200, description = "OpenAPI 3.1", body = Object))
)]
async fn document(headers: HeaderMap) -> Response {
    static OPENAPI: LazyLock<Value> = LazyLock::new(openapi);
    tagged_json(&headers, &*OPENAPI)
}
