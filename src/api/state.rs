//! What the service works with, and the part of it that each handler takes.

use std::sync::Arc;

use axum::extract::FromRef;
use metrics_exporter_prometheus::PrometheusHandle;

use super::access::{AccessSettings, Callers};
use super::body::Bodies;
use super::error::Answer;
use super::event_streams::EventStreams;
use super::limits::Limits;
use super::model_library::ModelLibrary;
use super::simulated::ComputedCache;
use super::spec_cache::SpecCache;
use super::work::Work;
use crate::delivery::Destinations;
use crate::event::EventHub;
use crate::identity::Provider;
use crate::store::{
    AuditLog, Comparisons, Damage, Datasets, Deliveries, Jobs, Layouts, Mappings, Monitors,
    Results, Sources, Store, Streams, Webhooks,
};
use greybox::identification::JobSpec;
use greybox::identification::assemble::{ExperimentDisturbances, ExperimentTrajectory};
use greybox::model::Catalogue;
use greybox::parsing::Fault;
use greybox::recording::Recording;

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
    /// The identity provider at which people sign in.
    pub provider: Option<Arc<Provider>>,
    /// Where events may be delivered.
    pub destinations: Arc<Destinations>,
    /// Whether the workers run.
    pub workers_run: Arc<dyn Fn() -> bool + Send + Sync>,
    /// Renders the metrics.
    pub metrics: PrometheusHandle,
}

/// All that handlers work with. A handler takes the part that it needs; where several parts meet it takes
/// the whole state.
#[derive(Clone)]
pub struct ApiState(Arc<StateParts>);

/// The parts, each cheap to clone.
pub struct StateParts {
    /// The database; most handlers take a handle of one resource.
    pub(super) store: Store,
    /// Tells handlers that wait of changes, and that the server goes down.
    pub(super) hub: EventHub,
    /// What one client may ask for.
    pub(super) limits: Arc<Limits>,
    /// Finds models by name, those of the program and those of a project.
    pub(super) library: ModelLibrary,
    /// Runs what takes time beside the threads that serve, so much at once.
    pub(super) work: Work,
    /// Receives bodies and writes large answers, by way of the disk.
    pub(super) bodies: Bodies,
    /// Opens event streams, so many at once.
    pub(super) event_streams: EventStreams,
    /// Remembers who asked lately and how much.
    pub(super) callers: Arc<Callers>,
    /// Remembers specifications that passed, so that a job like them is not checked again.
    pub(super) checked: SpecCache,
    /// Keeps simulated results that were shown lately.
    pub(super) simulated: ComputedCache<ExperimentTrajectory>,
    /// Keeps smoothed results that were shown lately.
    pub(super) smoothed: ComputedCache<ExperimentDisturbances>,
    /// Where events may be delivered.
    pub(super) destinations: Arc<Destinations>,
    /// Whether the workers run, which a server has to be ready.
    pub(super) workers_run: Arc<dyn Fn() -> bool + Send + Sync>,
    /// Renders the metrics.
    pub(super) metrics: PrometheusHandle,
}

impl ApiState {
    /// The state of a service made of `parts`.
    pub fn new(parts: Parts) -> Self {
        let Parts {
            store,
            hub,
            catalogue,
            limits,
            access,
            provider,
            destinations,
            workers_run,
            metrics,
        } = parts;
        let limits = Arc::new(limits);
        let work = Work::new(&limits, hub.clone());
        Self(Arc::new(StateParts {
            library: ModelLibrary::new(catalogue, store.models().clone(), work.clone()),
            bodies: Bodies::new(&limits, hub.clone(), work.clone(), store.datasets().clone()),
            event_streams: EventStreams::new(limits.streams_at_once, store.clone(), hub.clone()),
            callers: Arc::new(Callers::new(access, provider, &limits, &store)),
            checked: SpecCache::default(),
            simulated: ComputedCache::default(),
            smoothed: ComputedCache::default(),
            store,
            hub,
            limits,
            work,
            destinations,
            workers_run,
            metrics,
        }))
    }

    /// The recordings of a job, one for each experiment; those that are gone are faults.
    pub(super) async fn recordings(
        &self,
        spec: &JobSpec,
    ) -> Answer<Result<Vec<Arc<Recording>>, Vec<Fault>>> {
        let mut recordings = Vec::with_capacity(spec.experiments.len());
        let mut faults = Vec::new();
        for (index, experiment) in spec.experiments.iter().enumerate() {
            if let Some(recording) = self.store.datasets().recording(experiment.dataset).await? {
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
}

impl std::ops::Deref for ApiState {
    type Target = StateParts;

    fn deref(&self) -> &StateParts {
        &self.0
    }
}

/// The parts that handlers take by their types.
macro_rules! parts {
    ($($part:ty: $of:ident $(.$handle:ident())?,)*) => {
        $(
            impl FromRef<ApiState> for $part {
                fn from_ref(state: &ApiState) -> Self {
                    state.$of$(.$handle())?.clone()
                }
            }
        )*
    };
}

parts! {
    AuditLog: store.audit(),
    Comparisons: store.comparisons(),
    Damage: store.damage(),
    Datasets: store.datasets(),
    Deliveries: store.deliveries(),
    Jobs: store.jobs(),
    Layouts: store.layouts(),
    Mappings: store.mappings(),
    Monitors: store.monitors(),
    Results: store.results(),
    Sources: store.sources(),
    Store: store,
    Streams: store.streams(),
    Webhooks: store.webhooks(),
    EventHub: hub,
    ModelLibrary: library,
    Bodies: bodies,
    EventStreams: event_streams,
    Arc<Callers>: callers,
    Arc<Destinations>: destinations,
}

#[cfg(test)]
pub(crate) mod tests {
    use std::time::Duration;

    use metrics_exporter_prometheus::PrometheusBuilder;

    use super::*;
    use crate::store::DatabaseSettings;

    /// A service with an empty database and nobody who works its jobs.
    pub(crate) async fn state() -> (ApiState, tempfile::TempDir) {
        let folder = tempfile::tempdir().expect("a folder");
        let hub = EventHub::new();
        let settings = DatabaseSettings {
            place: crate::store::DatabasePlace::File(folder.path().join("jobs.db")),
            readers: 1,
            busy_timeout: Duration::from_secs(5),
            beat: Duration::from_millis(50),
            keys: Default::default(),
        };
        let store = Store::open(&settings, hub.on_change()).await;
        let state = ApiState::new(Parts {
            store: store.expect("a database"),
            hub,
            catalogue: Catalogue::built_in(),
            limits: Limits::default(),
            access: AccessSettings::default(),
            provider: None,
            destinations: Arc::default(),
            workers_run: Arc::new(|| true),
            metrics: PrometheusBuilder::new().build_recorder().handle(),
        });
        (state, folder)
    }
}
