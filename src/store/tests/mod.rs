//! The store against a fresh database each: fencing, replay, idempotency, group commit, paging.

mod audit;
mod backup;
mod candidates;
mod cluster;
mod comparisons;
mod damage;
mod database_copy;
mod datasets;
mod full;
mod growth;
mod jobs;
mod life;
mod long_streams;
mod nodes;
mod retention;
mod secrets;
mod slices;
mod streams;
mod upgrades;
mod ways;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use indexmap::IndexMap;

use super::database::Kind;
use super::writer::Tx;
use super::*;
use crate::access::Project;
use crate::job::{Event, Failure, GenerationEvent, JobTask, ResultOfJob, Status};
use greybox::estimation::{Phase, Progress, StopReason};
use greybox::identification::{DatasetId, JobId};

/// Tests that hold on SQLite and on PostgreSQL.
macro_rules! on_both {
    ($($name:ident),* $(,)?) => {
        mod on_sqlite {
            $(
                #[tokio::test]
                async fn $name() {
                    super::$name(super::Fixture::new().await).await;
                }
            )*
        }

        mod on_postgres {
            $(
                #[tokio::test]
                async fn $name() {
                    if let Some(fixture) = super::Fixture::on_postgres().await {
                        super::$name(fixture).await;
                    }
                }
            )*
        }
    };
}
use on_both;

struct Fixture {
    store: Store,
    changes: Arc<Mutex<Vec<Change>>>,
    settings: DatabaseSettings,
    _folder: tempfile::TempDir,
}

impl Fixture {
    /// On SQLite.
    async fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let place = DatabasePlace::File(folder.path().join("jobs.db"));
        Self::of(place, folder).await
    }

    /// On PostgreSQL; nothing where that is not installed.
    async fn on_postgres() -> Option<Self> {
        let database = cluster::new_database()?;
        let options = database.parse().expect("an address");
        let folder = tempfile::tempdir().expect("a temporary folder");
        Some(Self::of(DatabasePlace::Postgres(Box::new(options)), folder).await)
    }

    async fn of(place: DatabasePlace, folder: tempfile::TempDir) -> Self {
        let settings = DatabaseSettings {
            place,
            readers: 2,
            busy_timeout: Duration::from_secs(5),
            beat: Duration::from_millis(50),
            keys: Default::default(),
        };
        let changes = Arc::new(Mutex::new(Vec::new()));
        let store = open(&settings, &changes).await;
        Self {
            store,
            changes,
            settings,
            _folder: folder,
        }
    }

    /// Closes the database and opens it again, as the next server does.
    async fn reopen(self) -> Self {
        self.try_to_reopen().await.expect("a database")
    }

    /// Closes the database and tries to open it again.
    async fn try_to_reopen(self) -> Result<Self, StoreError> {
        self.store.close().await;
        let Self {
            store,
            changes,
            settings,
            _folder,
        } = self;
        drop(store);
        let store = try_to_open(&settings, &changes).await?;
        Ok(Self {
            store,
            changes,
            settings,
            _folder,
        })
    }

    /// Opens the database again after a server that did not end in order.
    async fn cut_off(self) -> Self {
        self.store.database().writer.close().await;
        let next = self.reopen().await;
        let taken_over = next.store.nodes().take_over_from_all_others().await;
        taken_over.expect("the jobs of the dead server");
        next
    }

    /// The file of the database.
    fn file(&self) -> &Path {
        match &self.settings.place {
            DatabasePlace::File(path) => path,
            DatabasePlace::Postgres(_) => panic!("it is no file"),
        }
    }

    async fn submit(&self) -> JobRow {
        match self
            .store
            .submissions()
            .submit(job(None))
            .await
            .expect("a submission")
        {
            Submitted::Created(row) => row,
            other => panic!("not created: {other:?}"),
        }
    }

    async fn begin(&self, id: JobId) -> Slice {
        match self
            .store
            .slices()
            .begin(id, None, 5)
            .await
            .expect("a start")
        {
            Begin::Slice(slice) => *slice,
            other => panic!("no slice: {other:?}"),
        }
    }

    async fn finish(&self, slice: &Slice, status: Status) -> Hold {
        let ending = match status {
            Status::Succeeded => Ending::Succeeded(outcome(StopReason::GenerationLimit)),
            Status::Failed => Ending::Failed(Failure::no_estimate()),
            _ => Ending::Stopped(Some(outcome(StopReason::Paused))),
        };
        self.store
            .slices()
            .finish(slice.lease, Record::default(), ending)
            .await
            .expect("an end")
    }

    async fn events(&self, id: JobId) -> Vec<StoredEvent> {
        self.store
            .events()
            .after(id, 0, 1000)
            .await
            .expect("events")
    }

    async fn status(&self, id: JobId) -> Status {
        self.store
            .jobs()
            .find(id)
            .await
            .expect("a read")
            .expect("a job")
            .status
    }
}

async fn try_to_open(
    settings: &DatabaseSettings,
    changes: &Arc<Mutex<Vec<Change>>>,
) -> Result<Store, StoreError> {
    let changes = changes.clone();
    let on_change = Arc::new(move |change| changes.lock().expect("unpoisoned").push(change));
    Store::open(settings, on_change).await
}

async fn open(settings: &DatabaseSettings, changes: &Arc<Mutex<Vec<Change>>>) -> Store {
    try_to_open(settings, changes).await.expect("a database")
}

fn job(key: Option<(&str, &str)>) -> NewJob {
    NewJob {
        project: Default::default(),
        name: Some("rig 4".to_owned()),
        labels: BTreeMap::from([("site".to_owned(), "hall 2".to_owned())]),
        model: "positioning_drive".to_owned(),
        task: JobTask::nominal(),
        datasets: Vec::new(),
        idempotency: key.map(|(key, body_digest)| Idempotency {
            project: Default::default(),
            key: key.to_owned(),
            body_digest: body_digest.to_owned(),
        }),
    }
}

fn outcome(stop_reason: StopReason) -> ResultOfJob {
    ResultOfJob::sample(stop_reason, "mass", 58.02e-7)
}

fn generation(number: u32) -> GenerationEvent {
    GenerationEvent {
        generation: number,
        evaluations: u64::from(number) * 30,
        best_cost: Some(1.0 / f64::from(number)),
        generation_best_cost: None,
        mean_cost: None,
        best_credit: Some(0.1),
        entropy: Some(2.0),
        credit_updates: 400,
        best: IndexMap::from([("mass".to_owned(), Some(0.1 + 0.2))]),
    }
}

fn ids(events: &[StoredEvent]) -> Vec<i64> {
    events.iter().map(|event| event.id).collect()
}

fn names(events: &[StoredEvent]) -> Vec<&str> {
    events.iter().map(|event| &*event.name).collect()
}
