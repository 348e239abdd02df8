//! Puts a server together (store, events, worker, router) and takes it apart in order.

mod addresses;
mod connections;
pub mod doctor;
mod memory;
mod system;
mod tls;

use std::net::SocketAddr;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle};
use tokio::net::TcpListener;
use tokio::task::{JoinHandle, JoinSet};
use tokio_util::sync::CancellationToken;

use crate::api::access::AccessSettings;
use crate::api::audit::Audit;
use crate::api::{self, ApiState, Around, Parts};
use crate::config::{SHUTDOWN_LIMIT, Settings, SettingsError};
use crate::dashboard;
use crate::delivery::Sender;
use crate::event::EventHub;
use crate::identity::Provider;
use crate::priority::{self, LowerPriority};
use crate::store::{Retention, Store, StoreError};
use crate::watcher::Watcher;
use crate::worker::Worker;
use crate::worker::method::Methods;
use crate::worker::run::Method;
use addresses::Addresses;
use greybox::model::Catalogue;
use memory::limits_within_memory;
pub use memory::{TooLittleMemory, spare_address_space};
use system::ConnectionLimits;
pub use system::TooFewFiles;
use tls::Tls;
pub use tls::TlsError;

/// What is left of the shutdown's time for the connections after the slices were handed back.
const LAST_WORDS: Duration = Duration::from_millis(300);
/// How often what was measured is put together.
const UPKEEP_INTERVAL: Duration = Duration::from_secs(5);
/// How often it is looked whether something is older than it is kept for.
const TIDY_INTERVAL: Duration = Duration::from_secs(600);
/// How soon it is looked again while there is more.
const TIDY_PAUSE: Duration = Duration::from_secs(1);
/// The ends of the buckets in which the durations of answers are counted `[s]`.
const DURATION_BUCKETS: [f64; 12] = [
    0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 60.0, 120.0,
];

/// Why a server did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A setting cannot be.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The store did not open.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Others than the server's own machine would reach it, and nobody would have to say who they
    /// are.
    #[error(
        "nobody would have to say who they are to a server that listens on {0}: make a token first \
         (`greybox token create --name NAME --scope submit`, with the same --database), or name the \
         identity provider (--oidc-issuer) or the proxy (--trusted-proxy) that knows people, or listen on 127.0.0.1"
    )]
    NobodyAsked(SocketAddr),
    /// The files of its TLS are of no use.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// The system allows the process fewer files than a server needs.
    #[error(transparent)]
    TooFewFiles(#[from] TooFewFiles),
    /// The system allows the process less memory than a server needs.
    #[error(transparent)]
    TooLittleMemory(#[from] TooLittleMemory),
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
}

/// A server at work.
pub struct App {
    address: SocketAddr,
    speaks_tls: bool,
    store: Store,
    hub: EventHub,
    worker: Worker,
    watcher: Watcher,
    closing: CancellationToken,
    server: JoinHandle<()>,
    /// What goes on beside: upkeep, deliveries.
    tasks: JoinSet<()>,
}

impl App {
    /// Starts a server: when this returns it answers, and works the jobs that wait.
    pub async fn start(settings: Settings) -> Result<Self, StartError> {
        let method = Methods::new(Catalogue::built_in());
        Self::start_with(settings, Arc::new(method)).await
    }

    /// Starts a server that works its jobs by another method.
    pub async fn start_with(
        settings: Settings,
        method: Arc<dyn Method>,
    ) -> Result<Self, StartError> {
        let worker_settings = settings.worker()?;
        let access = settings.access()?;
        let provider = settings.oidc.provider()?.map(Provider::new).map(Arc::new);
        let files = settings.tls.files();
        let tls = files.map(Tls::new).transpose()?.map(Arc::new);
        let speaks_tls = tls.is_some();
        let proxies = access.proxies.clone();
        let destinations = Arc::new(settings.destinations()?);
        let connections = ConnectionLimits::of_the_system(settings.connections_per_address)?;
        let limits = limits_within_memory(&settings)?;
        system::outlive_the_largest_file();
        share_threads(settings.threads());
        let hub = EventHub::new();
        let (store, listener) = open(&settings, &access, provider.is_some(), &hub).await?;
        let address = listener.local_addr().map_err(|source| StartError::Listen {
            address: settings.listen,
            source,
        })?;
        let worker = Worker::start(store.clone(), hub.clone(), method, worker_settings)?;
        let watcher = Watcher::start(store.clone(), hub.clone(), Catalogue::built_in());
        let alive = worker.alive();
        let state = ApiState::new(Parts {
            store: store.clone(),
            hub: hub.clone(),
            catalogue: Catalogue::built_in(),
            limits,
            access,
            provider,
            destinations: Arc::clone(&destinations),
            workers_run: Arc::new(move || *alive.borrow()),
            metrics: metrics(),
        });
        let closing = CancellationToken::new();
        let audit = Audit::new(store.audit().clone());
        let routes = routes(state, audit, &settings);
        let mut tasks = JoinSet::new();
        if let Some(tls) = &tls {
            tasks.spawn(Arc::clone(tls).watch(closing.clone()));
        }
        let listening = connections::Listening {
            listener,
            tls,
            at_once: connections.at_once,
            addresses: Addresses::new(connections.of_an_address, &proxies),
        };
        let server = tokio::spawn(connections::serve(listening, routes, closing.clone()));
        let sender = Sender::new(store.clone(), destinations);
        tasks.spawn(sender.run(hub.clone(), closing.clone()));
        tasks.spawn(keep_up(metrics(), closing.clone()));
        tasks.spawn(tidy(store.clone(), settings.retention(), closing.clone()));
        if store.is_shared() {
            tasks.spawn(hub.clone().look_again_and_again(closing.clone()));
        }
        tracing::info!(%address, "listening");
        Ok(Self {
            address,
            speaks_tls,
            store,
            hub,
            worker,
            watcher,
            closing,
            server,
            tasks,
        })
    }

    /// The address that it listens on.
    pub fn local_addr(&self) -> SocketAddr {
        self.address
    }

    /// The address at which clients reach the server, as a URL.
    pub fn url(&self) -> String {
        let scheme = if self.speaks_tls { "https" } else { "http" };
        format!("{scheme}://{}", self.address)
    }

    /// Returns when the process is asked to end (SIGTERM or ctrl-c), and with an error when other nodes
    /// have declared this one dead.
    pub async fn wait_for_signal(&self) -> std::io::Result<()> {
        tokio::select! {
            asked = system::terminated() => asked,
            () = self.store.nodes().superseded() => Err(std::io::Error::other(
                "other nodes have declared this one dead and gone on without it",
            )),
        }
    }

    /// Takes no more connections, ends the streams, hands the slices back and closes the
    /// database, in less than five seconds.
    pub async fn shutdown(self) {
        let Self {
            store,
            hub,
            worker,
            watcher,
            closing,
            mut server,
            mut tasks,
            ..
        } = self;
        closing.cancel();
        hub.close();
        let slices = tokio::time::timeout(SHUTDOWN_LIMIT - LAST_WORDS, worker.shutdown());
        if slices.await.is_err() {
            tracing::warn!("a slice did not stop in time; it goes on from its last checkpoint");
        }
        match tokio::time::timeout(LAST_WORDS, &mut server).await {
            Ok(Ok(())) => {}
            Ok(Err(error)) => tracing::error!(%error, "the server ended badly"),
            Err(_) => {
                tracing::warn!("connections that did not end were cut");
                server.abort();
            }
        }
        let ends = async {
            while let Some(ended) = tasks.join_next().await {
                let note = |error| tracing::error!(%error, "a task beside the server ended badly");
                ended.unwrap_or_else(note);
            }
        };
        wait_a_while(ends, "a task beside the server was cut off").await;
        let step = "a step of a monitor did not end in time; it is taken again";
        wait_a_while(watcher.ended(), step).await;
        let file = "the database was not closed in time; what it acknowledged is on disk";
        wait_a_while(store.close(), file).await;
    }
}

/// Waits for the end of a part of the server, and warns where that takes too long.
async fn wait_a_while<T>(end: impl Future<Output = T>, too_long: &str) {
    if tokio::time::timeout(LAST_WORDS, end).await.is_err() {
        tracing::warn!("{too_long}");
    }
}

/// Opens the database and the port. One that others reach is opened only where callers have to say who
/// they are, which the database knows.
async fn open(
    settings: &Settings,
    access: &AccessSettings,
    has_provider: bool,
    hub: &EventHub,
) -> Result<(Store, TcpListener), StartError> {
    let is_alone = settings.listen.ip().to_canonical().is_loopback();
    let early = match is_alone {
        true => Some(listen(settings.listen)?),
        false => None,
    };
    let quotas = settings.quotas()?;
    let store = Store::open_with(&settings.database()?, quotas, hub.on_change()).await?;
    if let Some(listener) = early {
        return Ok((store, listener));
    }
    let knows_people = has_provider || !access.proxies.is_empty();
    if !knows_people && !store.tokens().exist().await? {
        store.close().await;
        return Err(StartError::NobodyAsked(settings.listen));
    }
    if access.proxies.is_empty() && !access.speaks_tls {
        let address = settings.listen;
        tracing::warn!(%address, "tokens come over plain HTTP, where others can read them: use --tls-cert");
    }
    let listener = listen(settings.listen)?;
    Ok((store, listener))
}

/// The API and the pages, with what every answer shares.
fn routes(state: ApiState, audit: Audit, settings: &Settings) -> axum::Router {
    let around = Around {
        names: Arc::new(settings.names()),
        audit: Some(audit),
        speaks_tls: settings.tls.files().is_some(),
    };
    let pages = dashboard::router(api::openapi);
    api::with_middleware(api::resources(state).merge(pages), around)
}

/// Puts what was measured together now and then, so that it takes no more room for each request
/// when nobody reads it.
async fn keep_up(metrics: PrometheusHandle, closing: CancellationToken) {
    let mut due = tokio::time::interval(UPKEEP_INTERVAL);
    loop {
        tokio::select! {
            () = closing.cancelled() => return,
            _ = due.tick() => metrics.run_upkeep(),
        }
    }
}

/// Lets go what is older than it is kept for, now and then, a little at a time.
async fn tidy(store: Store, retention: Retention, closing: CancellationToken) {
    let mut wait = TIDY_PAUSE;
    loop {
        tokio::select! {
            () = closing.cancelled() => return,
            () = tokio::time::sleep(wait) => {}
        }
        wait = TIDY_INTERVAL;
        if !store.nodes().is_in_charge() {
            continue;
        }
        match store.tidy(retention).await {
            Ok(tidied) if tidied.is_some() => {
                tracing::info!(?tidied, "what is older than it is kept for has gone");
                wait = TIDY_PAUSE;
            }
            Ok(_) => {}
            Err(error) => tracing::error!(%error, "the database could not be tidied"),
        }
    }
}

fn listen(address: SocketAddr) -> Result<TcpListener, StartError> {
    connections::listen(address).map_err(|source| StartError::Listen { address, source })
}

/// Gives the computation its threads. They are the process's; the first server decides.
fn share_threads(threads: usize) {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .start_handler(|_| priority::give_way(LowerPriority::Jobs))
        .thread_name(|number| format!("compute-{number}"));
    if let Err(error) = pool.build_global() {
        tracing::debug!(%error, "the process has its threads already");
    }
}

/// The metrics of the process.
fn metrics() -> PrometheusHandle {
    static HANDLE: OnceLock<PrometheusHandle> = OnceLock::new();
    HANDLE
        .get_or_init(|| {
            let builder = PrometheusBuilder::new().set_buckets(&DURATION_BUCKETS);
            let recorder = builder.expect("there are buckets").build_recorder();
            let handle = recorder.handle();
            if let Err(error) = metrics::set_global_recorder(recorder) {
                tracing::warn!(%error, "the metrics stay empty: something else records them");
            }
            handle
        })
        .clone()
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use serde_json::json;

    use super::*;
    use crate::config::DatabaseArguments;
    use crate::job::Status;
    use crate::store::{NewJob, Submitted};
    use crate::worker::tests::descent::{Descent, Gate};
    use greybox::identification::JobId;

    struct Fixture {
        app: App,
        gate: Arc<Gate>,
        settings: Settings,
        _folder: tempfile::TempDir,
    }

    async fn fixture() -> Fixture {
        let folder = tempfile::tempdir().expect("a folder");
        let settings = Settings {
            listen: (std::net::Ipv4Addr::LOCALHOST, 0).into(),
            database: DatabaseArguments::of(format!(
                "sqlite://{}",
                folder.path().join("jobs.db").display()
            )),
            ..Settings::default()
        };
        let gate = Arc::new(Gate::default());
        Fixture {
            app: start(&settings, &gate).await.expect("a server"),
            gate,
            settings,
            _folder: folder,
        }
    }

    async fn start(settings: &Settings, gate: &Arc<Gate>) -> Result<App, StartError> {
        let method = Arc::new(Descent { gate: gate.clone() });
        App::start_with(settings.clone(), method).await
    }

    async fn submit_a_job_that_waits(store: &Store) -> JobId {
        let orders = json!({"generations": 9, "refinements": 0, "wait_at": 5});
        let job = NewJob {
            project: Default::default(),
            name: None,
            labels: [("orders".to_owned(), orders.to_string())].into(),
            model: "descent".to_owned(),
            task: crate::job::JobTask::nominal(),
            datasets: Vec::new(),
            idempotency: None,
        };
        match store.submissions().submit(job).await.expect("a submission") {
            Submitted::Created(row) => row.id,
            other => panic!("not created: {other:?}"),
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_started_server_is_ready() {
        let Fixture { app, _folder, .. } = fixture().await;
        let url = format!("http://{}/readyz", app.local_addr());
        let answer = reqwest::get(url).await.expect("an answer");
        assert_eq!(answer.status(), 200);
        app.shutdown().await;
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_taken_port_and_a_taken_database_are_named() {
        let Fixture {
            app,
            gate,
            settings,
            _folder,
        } = fixture().await;
        let taken_port = Settings {
            listen: app.local_addr(),
            ..settings.clone()
        };
        let refused = start(&taken_port, &gate)
            .await
            .err()
            .expect("the port is taken");
        let message = refused.to_string();
        let expected = format!("cannot listen on {}: ", app.local_addr());
        assert!(message.starts_with(&expected), "{message}");
        let refused = start(&settings, &gate)
            .await
            .err()
            .expect("the file is taken");
        let message = refused.to_string();
        assert!(
            message.ends_with("is in use by another greybox server"),
            "{message}"
        );
        app.shutdown().await;
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_shutdown_ends_streams_and_hands_slices_back_within_five_seconds() {
        let Fixture {
            app,
            gate,
            settings,
            _folder,
        } = fixture().await;
        let id = submit_a_job_that_waits(&app.store).await;
        gate.wait_for_arrival();
        let url = format!("http://{}/v1/jobs/{id}/events", app.local_addr());
        let stream = reqwest::get(url).await.expect("a stream");
        assert_eq!(stream.status(), 200);
        let reader = tokio::spawn(stream.text());
        let asked = Instant::now();
        app.shutdown().await;
        assert!(asked.elapsed() < Duration::from_secs(5));
        let told = reader.await.expect("a reader").expect("an orderly end");
        assert!(told.contains("event: state"), "{told}");

        let app = start(&settings, &gate).await.expect("the same database");
        let job = app
            .store
            .jobs()
            .find(id)
            .await
            .expect("a read")
            .expect("the job");
        assert_eq!(job.status, Status::Running);
        assert_eq!(job.progress.as_ref().expect("progress").generation, 4);
        app.shutdown().await;
    }
}
