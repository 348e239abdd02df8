//! HTTP to domain types and back: the route table.
//!
//! No SQL and no numerics here. [`resources`] is the API; [`with_middleware()`] puts what every answer
//! shares (request id, problem documents, compression, logging) around it and around the pages that
//! stand beside it.

pub mod access;
mod admission;
pub mod audit;
pub mod body;
pub mod candidates;
pub mod changes;
pub mod client;
pub mod comparisons;
pub mod datasets;
pub mod designs;
pub mod error;
pub mod events;
pub mod extract;
pub mod finished_job;
pub mod health;
pub mod http_headers;
pub mod job_list;
pub mod jobs;
pub mod middleware;
pub mod models;
pub mod monitors;
pub mod openapi;
pub mod origin;
pub mod page;
pub mod query;
mod rates;
pub mod report;
pub mod results;
pub mod session;
mod session_cookie;
mod simulated;
pub mod simulations;
mod spec_cache;
mod spool;
pub mod streams;
pub mod submit;
pub mod trajectory;
mod unpacking;
pub mod verdict_rules;
mod watched_body;
pub mod webhooks;
mod work;

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::middleware::from_fn_with_state;
use metrics_exporter_prometheus::PrometheusHandle;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

use crate::access::Project;
use crate::delivery::Destinations;
use crate::event::EventHub;
use crate::store::Store;
use greybox::identification::JobSpec;
use greybox::model::{Catalogue, Model};
use greybox::parsing::Fault;
use greybox::recording::Recording;

use crate::admission::Permit;
use access::{AccessSettings, Callers};
use admission::Limited;
use error::{Answer, Problem};
pub use middleware::{Around, with_middleware};
pub use openapi::openapi;
use rates::Rates;
use simulated::SimulatedCache;
use spec_cache::SpecCache;
use spool::SpoolRoom;

/// So many seconds' worth of a caller's requests may come together.
const BURST_S: f64 = 2.0;

/// What the service lets one client ask for.
#[derive(Clone, Debug)]
pub struct Limits {
    /// The bytes of a recording at the most, uncompressed.
    pub dataset_bytes: u64,
    /// How far the stamps of a stream's samples may lie ahead of the server's clock.
    pub stamps_ahead: Duration,
    /// The bytes of a JSON document (a job, a simulation) at the most, uncompressed.
    pub document_bytes: u64,
    /// Derivatives that the search of a job may be predicted to take.
    pub job_derivatives: f64,
    /// The longest computing time that a job may ask for `[s]`.
    pub max_duration_s: f64,
    /// Recordings that are in memory at the same time at the most.
    pub recordings_at_once: usize,
    /// Computations for clients that wait, at the same time at the most.
    pub computations_at_once: usize,
    /// Documents and recordings that are read or written at the same time at the most.
    pub conversions_at_once: usize,
    /// The bytes that bodies on their way take of the disk at the most, all together.
    pub spool_bytes: u64,
    /// Event streams that are open at the same time at the most.
    pub streams_at_once: usize,
    /// Requests in a second of each caller that says who it is.
    pub requests_per_second: f64,
    /// Requests, streams among them, that each such caller has under way at the most.
    pub requests_at_once: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            dataset_bytes: 64 << 20,
            stamps_ahead: Duration::from_hours(24),
            document_bytes: 1 << 20,
            job_derivatives: 1e15,
            max_duration_s: 86_400.0,
            recordings_at_once: 4,
            computations_at_once: 2,
            conversions_at_once: 4,
            spool_bytes: 1 << 30,
            streams_at_once: 5000,
            requests_per_second: 200.0,
            requests_at_once: 1000,
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
    /// Who may ask.
    pub access: AccessSettings,
    /// Where events may be delivered.
    pub destinations: Arc<Destinations>,
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
    recordings: Limited,
    computations: Limited,
    conversions: Limited,
    spool_room: SpoolRoom,
    checked: SpecCache,
    simulated: SimulatedCache,
    streams: Limited,
    callers: Callers,
    rates: Rates,
    sign_ins: Rates,
}

impl ApiState {
    /// The state of a service made of `parts`.
    pub fn new(parts: Parts) -> Self {
        let limits = &parts.limits;
        Self(Arc::new(Shared {
            recordings: Limited::new(limits.recordings_at_once, "too many recordings at once"),
            computations: Limited::new(
                limits.computations_at_once,
                "too many computations at once",
            ),
            conversions: Limited::new(limits.conversions_at_once, "too many documents at once"),
            spool_room: SpoolRoom::new(limits.spool_bytes),
            checked: SpecCache::default(),
            simulated: SimulatedCache::default(),
            rates: Rates::new(
                limits.requests_per_second,
                limits.requests_per_second * BURST_S,
                limits.requests_at_once,
            ),
            sign_ins: session::sign_ins(),
            callers: Callers::new(parts.access.clone()),
            streams: Limited::new(limits.streams_at_once, "too many event streams are open"),
            parts,
        }))
    }

    /// A whole recording takes memory: only so many at once, others wait.
    async fn recording_permit(&self) -> Answer<Permit> {
        self.0.recordings.take().await
    }

    /// The recordings of a job, one for each experiment; those that are gone are faults.
    async fn recordings(&self, spec: &JobSpec) -> Answer<Result<Vec<Arc<Recording>>, Vec<Fault>>> {
        let mut recordings = Vec::with_capacity(spec.experiments.len());
        let mut faults = Vec::new();
        for (index, experiment) in spec.experiments.iter().enumerate() {
            if let Some(recording) = self.store.recording(experiment.dataset).await? {
                recordings.push(recording);
            } else {
                let pointer = format!("/experiments/{index}/dataset");
                let detail = format!("there is no dataset {}", experiment.dataset);
                faults.push(Fault::new(pointer, "unknown_dataset", detail));
            }
        }
        Ok(if faults.is_empty() {
            Ok(recordings)
        } else {
            Err(faults)
        })
    }

    /// A model by its name: one of the program's, or one of the project by its reference.
    async fn model(&self, project: &Project, name: &str) -> Answer<Arc<Model>> {
        if let Some(model) = self.catalogue.get(name) {
            return Ok(model.clone());
        }
        let row = self.store.model_of(project, name).await?;
        let row = row.ok_or_else(|| Problem::not_found("model", name))?;
        let read = models::read(self, row.document).await?;
        Ok(read.map_err(Problem::of_document)?.model)
    }

    /// An event stream takes a connection and a place: only so many at once.
    fn stream_permit(&self) -> Answer<Permit> {
        self.0.streams.try_take()
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
        .routes(routes!(models::create, models::list))
        .routes(routes!(models::show, models::remove))
        .routes(routes!(streams::list))
        .routes(routes!(streams::append, streams::show, streams::remove))
        .routes(routes!(streams::cut::cut))
        .routes(routes!(streams::removal::remove_samples))
        .routes(routes!(monitors::create, monitors::list))
        .routes(routes!(monitors::show, monitors::remove))
        .routes(routes!(monitors::moving::move_to))
        .routes(routes!(monitors::windows))
        .routes(routes!(monitors::alarms))
        .routes(routes!(monitors::events::events))
        .routes(routes!(simulations::simulate))
        .routes(routes!(designs::design))
        .routes(routes!(comparisons::submit_comparison, comparisons::list))
        .routes(routes!(comparisons::show))
        .routes(routes!(submit::submit, job_list::list))
        .routes(routes!(jobs::show, jobs::remove))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::pause))
        .routes(routes!(jobs::resume))
        .routes(routes!(events::events))
        .routes(routes!(changes::changes))
        .routes(routes!(results::generations))
        .routes(routes!(candidates::candidates))
        .routes(routes!(results::result))
        .routes(routes!(trajectory::trajectory))
        .routes(routes!(report::report))
        .routes(routes!(verdict_rules::list))
        .routes(routes!(session::sign_in, session::show, session::sign_out))
        .routes(routes!(audit::list))
        .routes(routes!(webhooks::create, webhooks::list))
        .routes(routes!(webhooks::show, webhooks::remove))
        .routes(routes!(webhooks::deliveries))
        .routes(routes!(webhooks::show_delivery))
        .routes(routes!(webhooks::resend))
}

/// The resources, without what [`with_middleware()`] puts around them.
pub fn resources(state: ApiState) -> Router {
    let (router, _openapi) = described().split_for_parts();
    router
        .layer(from_fn_with_state(state.clone(), access::authorise))
        .layer(from_fn_with_state(state.clone(), health::note_damage))
        .with_state(state)
}

#[cfg(test)]
mod tests {
    use metrics_exporter_prometheus::PrometheusBuilder;

    use super::*;
    use crate::store::DatabaseSettings;

    /// A service with an empty database and nobody who works its jobs.
    pub(super) async fn state() -> (ApiState, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a folder");
        let hub = EventHub::new();
        let settings = DatabaseSettings {
            place: crate::store::DatabasePlace::File(folder.path().join("jobs.db")),
            readers: 1,
            busy_timeout: Duration::from_secs(5),
            beat: Duration::from_millis(50),
        };
        let store = Store::open(&settings, hub.on_change()).await;
        let state = ApiState::new(Parts {
            store: store.expect("a database"),
            hub,
            catalogue: Catalogue::built_in(),
            limits: Limits::default(),
            access: AccessSettings::default(),
            destinations: Arc::default(),
            workers_run: Arc::new(|| true),
            metrics: PrometheusBuilder::new().build_recorder().handle(),
        });
        (state, folder)
    }
}
