//! HTTP to domain types and back: the route table.
//!
//! No SQL and no numerics here. [`router`] is the whole service; [`finish`] puts the manners that
//! every answer shares (request id, problem documents, compression, logging) around routes, so
//! that pages added beside the API have them too.

pub mod body;
pub mod datasets;
pub mod error;
pub mod events;
pub mod extract;
pub mod finish;
pub mod health;
pub mod jobs;
pub mod manners;
pub mod models;
pub mod openapi;
pub mod page;
pub mod query;
pub mod results;
pub mod submit;

use std::sync::Arc;

use axum::Router;
use metrics_exporter_prometheus::PrometheusHandle;
use tokio::sync::Semaphore;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::event::EventHub;
use crate::model::Catalogue;
use crate::store::Store;

pub use finish::finish;
pub use openapi::openapi;

/// What the service lets one client ask for.
#[derive(Clone, Debug)]
pub struct Limits {
    /// The bytes of a recording at the most, uncompressed.
    pub dataset_bytes: u64,
    /// The bytes of a JSON document (a job, a simulation) at the most, uncompressed.
    pub document_bytes: u64,
    /// The longest computing time that a job may ask for [s].
    pub max_duration_s: f64,
    /// Recordings that are read or written at the same time at the most.
    pub recordings_at_once: usize,
    /// Event streams that are open at the same time at the most.
    pub streams_at_once: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            dataset_bytes: 64 << 20,
            document_bytes: 1 << 20,
            max_duration_s: 86_400.0,
            recordings_at_once: 4,
            streams_at_once: 1000,
        }
    }
}

/// What the service works with.
pub struct Parts {
    /// The database.
    pub store: Store,
    /// Says when a job has more events; closing it ends streams and waiting answers.
    pub hub: EventHub,
    /// The models.
    pub catalogue: Catalogue,
    /// What one client may ask for.
    pub limits: Limits,
    /// Whether the workers run.
    pub workers_run: Arc<dyn Fn() -> bool + Send + Sync>,
    /// Renders the metrics.
    pub metrics: PrometheusHandle,
}

/// What every handler can reach.
#[derive(Clone)]
pub struct ApiState(Arc<Shared>);

/// The parts, and the permits for what is dear.
pub struct Shared {
    parts: Parts,
    recordings: Arc<Semaphore>,
    streams: Arc<Semaphore>,
}

impl ApiState {
    /// The state of a service made of `parts`.
    pub fn new(parts: Parts) -> Self {
        Self(Arc::new(Shared {
            recordings: Arc::new(Semaphore::new(parts.limits.recordings_at_once)),
            streams: Arc::new(Semaphore::new(parts.limits.streams_at_once)),
            parts,
        }))
    }
}

impl std::ops::Deref for ApiState {
    type Target = Parts;

    fn deref(&self) -> &Parts {
        &self.0.parts
    }
}

/// Every resource of the service, with its description.
fn described() -> OpenApiRouter<ApiState> {
    OpenApiRouter::with_openapi(openapi::preamble())
        .routes(routes!(health::livez))
        .routes(routes!(health::readyz))
        .routes(routes!(health::version))
        .routes(routes!(health::metrics))
        .routes(routes!(openapi::document))
        .routes(routes!(datasets::create, datasets::list))
        .routes(routes!(datasets::show, datasets::remove))
        .routes(routes!(datasets::samples))
        .routes(routes!(models::list))
        .routes(routes!(models::show))
        .routes(routes!(submit::submit, jobs::list))
        .routes(routes!(jobs::show, jobs::remove))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::pause))
        .routes(routes!(jobs::resume))
        .routes(routes!(events::events))
        .routes(routes!(results::generations))
        .routes(routes!(results::result))
}

/// The resources, without the manners of [`finish`].
pub fn resources(state: ApiState) -> Router {
    let (router, _openapi) = described().split_for_parts();
    router.with_state(state)
}

/// The whole service.
pub fn router(state: ApiState) -> Router {
    finish(resources(state))
}
