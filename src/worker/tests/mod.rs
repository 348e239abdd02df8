//! Jobs worked to their end, by a small real method, through everything that can come between.

pub(crate) mod descent;
mod requests;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};

use super::{Worker, WorkerSettings};
use crate::event::EventHub;
use crate::job::{JobTask, Status};
use crate::store::{
    CandidatePage, DatabaseSettings, JobRow, NewJob, Store, StoredEvent, Submitted,
};
use descent::{Descent, Gate, unbroken};
use greybox::estimation::StopReason;
use greybox::identification::{JobId, Outcome};

/// Nothing here takes so long unless it hangs.
const PATIENCE: Duration = Duration::from_secs(60);

/// More than the 30 of each of 20 generations.
const MAX_CANDIDATES: u64 = 1000;

/// A job as the store hands it to a worker.
pub(crate) fn at_work(model: &str, task: JobTask) -> JobRow {
    JobRow {
        project: Default::default(),
        id: JobId::new(),
        name: None,
        labels: BTreeMap::new(),
        model: model.to_owned(),
        task,
        status: Status::Running,
        stop_request: None,
        progress: None,
        attempt: 1,
        error: None,
        created_at: jiff::Timestamp::UNIX_EPOCH,
        started_at: None,
        finished_at: None,
        last_event: 1,
        revision: 1,
    }
}

/// A server without its HTTP half.
struct Server {
    store: Store,
    hub: EventHub,
    worker: Worker,
    gate: Arc<Gate>,
}

impl Server {
    async fn start(folder: &Path, jobs_at_once: usize, slice_length: Duration) -> Self {
        let settings = DatabaseSettings {
            place: crate::store::DatabasePlace::File(folder.join("jobs.db")),
            readers: 2,
            busy_timeout: Duration::from_secs(5),
            beat: Duration::from_millis(50),
            keys: Default::default(),
        };
        let hub = EventHub::new();
        let store = Store::open(&settings, hub.on_change())
            .await
            .expect("a database");
        let gate = Arc::new(Gate::default());
        let method = Arc::new(Descent { gate: gate.clone() });
        let settings = WorkerSettings {
            jobs_at_once,
            slice_length,
            max_candidates: MAX_CANDIDATES,
        };
        let worker = Worker::start(store.clone(), hub.clone(), method, settings);
        Self {
            store,
            hub,
            worker: worker.expect("a worker"),
            gate,
        }
    }

    async fn submit(&self, orders: Value, limits: Value) -> JobId {
        let task = json!({"model": "descent", "experiments": [], "seed": 1, "limits": limits});
        let job = NewJob {
            project: Default::default(),
            name: None,
            labels: BTreeMap::from([("orders".to_owned(), orders.to_string())]),
            model: "descent".to_owned(),
            task: JobTask::read(&task.to_string()).expect("a task"),
            datasets: Vec::new(),
            idempotency: None,
        };
        match self
            .store
            .submissions()
            .submit(job)
            .await
            .expect("a submission")
        {
            Submitted::Created(row) => row.id,
            other => panic!("not created: {other:?}"),
        }
    }

    /// Waits for an event that `is_it`, and returns all up to it.
    async fn wait(&self, id: JobId, is_it: impl Fn(&StoredEvent) -> bool) -> Vec<StoredEvent> {
        let mut feed = self.hub.feed(self.store.clone(), id, 0);
        let mut seen = Vec::new();
        let waiting = async {
            while !seen.iter().any(&is_it) {
                let news = feed.next().await.expect("a read");
                let news = news.expect("the stream goes on until it is there");
                seen.extend(news.iter().map(|event| StoredEvent::clone(event)));
            }
        };
        tokio::time::timeout(PATIENCE, waiting).await.expect("news");
        seen
    }

    async fn wait_for_end(&self, id: JobId) -> Vec<StoredEvent> {
        let events = self.wait(id, StoredEvent::is_last).await;
        let ids: Vec<i64> = events.iter().map(|event| event.id).collect();
        assert!(ids.iter().copied().eq(1..=ids.len() as i64), "{ids:?}");
        events
    }

    async fn wait_for_status(&self, id: JobId, status: Status) {
        let data = format!(r#"{{"status":"{status}"}}"#);
        self.wait(id, |event| event.name == "state" && event.data == data)
            .await;
    }

    async fn job(&self, id: JobId) -> JobRow {
        let row = self
            .store
            .jobs()
            .find(id)
            .await
            .expect("a read")
            .expect("a job");
        JobRow::clone(&row)
    }

    async fn result(&self, id: JobId) -> Outcome {
        let result = self.store.results().find(id).await.expect("a read");
        let Some(result) = result else {
            let job = self.job(id).await;
            panic!("a job without a result: {:?} {:?}", job.status, job.error);
        };
        let outcome = result.outcome();
        outcome.expect("the result of an identification")
    }

    /// Every candidate that is kept.
    async fn candidates(&self, id: JobId) -> CandidatePage {
        let all = self.store.candidates().page(id, 0, u32::MAX, usize::MAX);
        all.await.expect("a read")
    }

    async fn estimate(&self, id: JobId) -> u64 {
        let result = self.result(id).await;
        result.parameters[0].estimate.estimate.to_bits()
    }

    async fn shutdown(self) {
        self.worker.shutdown().await;
        self.store.close().await;
    }
}

fn orders(generations: u32, refinements: u32) -> Value {
    json!({"generations": generations, "refinements": refinements})
}

fn names(events: &[StoredEvent]) -> Vec<&str> {
    events.iter().map(|event| &*event.name).collect()
}

const LONG: Duration = Duration::from_secs(10);
const ONE_UNIT: Duration = Duration::ZERO;

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_worked_to_its_end_with_all_its_history() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let id = server.submit(orders(200, 3), json!({})).await;
    let events = server.wait_for_end(id).await;
    let names = names(&events);
    assert_eq!(names[..3], ["state", "state", "generation"]);
    assert_eq!(
        names[names.len() - 6..],
        [
            "refinement",
            "refinement",
            "refinement",
            "result",
            "state",
            "end"
        ]
    );
    let last_generation = events.iter().rfind(|event| event.name == "generation");
    let data: Value = serde_json::from_str(&last_generation.expect("one").data).expect("JSON");
    assert_eq!(data["generation"], 200);
    let rows = server
        .store
        .generations()
        .after(id, 0, 1000)
        .await
        .expect("rows");
    let numbers: Vec<u32> = rows.iter().map(|row| row.generation).collect();
    assert_eq!(numbers, (1..=200).collect::<Vec<u32>>());
    let candidates = server.candidates(id).await;
    assert_eq!(candidates.candidates.len() as u64, MAX_CANDIDATES);
    assert_eq!(candidates.kept, MAX_CANDIDATES);
    assert_eq!(candidates.cut_in_generation, Some(34), "30 a generation");
    let job = server.job(id).await;
    assert_eq!((job.status, job.attempt), (Status::Succeeded, 1));
    assert_eq!(job.progress.expect("progress").fraction, 1.0);
    assert_eq!(server.estimate(id).await, unbroken(200, 3));
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn slices_of_one_unit_come_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 2, ONE_UNIT).await;
    let a = server.submit(orders(12, 3), json!({})).await;
    let b = server.submit(orders(9, 0), json!({})).await;
    let events = server.wait_for_end(a).await;
    server.wait_for_end(b).await;
    let refinements = names(&events)
        .iter()
        .filter(|n| **n == "refinement")
        .count();
    assert_eq!(refinements, 3);
    assert_eq!(server.estimate(a).await, unbroken(12, 3));
    assert_eq!(server.estimate(b).await, unbroken(9, 0));
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_at_work_is_cancelled_and_keeps_its_best_estimate() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let held = json!({"generations": 50, "refinements": 0, "wait_at": 21});
    let id = server.submit(held, json!({})).await;
    server.gate.wait_for_arrival();
    server.store.jobs().cancel(id).await.expect("a wish");
    let events = server.wait_for_end(id).await;
    assert_eq!(
        events.last().expect("an end").data,
        r#"{"status":"cancelled"}"#
    );
    assert_eq!(server.result(id).await.stop_reason, StopReason::Cancelled);
    assert_eq!(server.estimate(id).await, unbroken(20, 0));
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_paused_job_shows_its_best_and_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, ONE_UNIT).await;
    let id = server.submit(orders(30, 2), json!({})).await;
    server.wait_for_status(id, Status::Running).await;
    server.store.jobs().pause(id).await.expect("a wish");
    server.wait_for_status(id, Status::Paused).await;
    assert_eq!(server.result(id).await.stop_reason, StopReason::Paused);
    assert_eq!(server.job(id).await.stop_request, None);
    server.store.jobs().resume(id).await.expect("a wish");
    server.wait_for_end(id).await;
    assert_eq!(server.estimate(id).await, unbroken(30, 2));
    assert_eq!(
        server.result(id).await.stop_reason,
        StopReason::GenerationLimit
    );
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_between_slices_is_stopped_though_every_place_is_taken() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, ONE_UNIT).await;
    let waiting = server.submit(orders(1_000_000, 0), json!({})).await;
    server
        .wait(waiting, |event| event.name == "generation")
        .await;
    let held = json!({"generations": 5, "refinements": 0, "wait_at": 1});
    let at_work = server.submit(held, json!({})).await;
    server.gate.wait_for_arrival();
    assert_eq!(server.job(waiting).await.status, Status::Running);
    server.store.jobs().cancel(waiting).await.expect("a wish");
    server.wait_for_end(waiting).await;
    assert_eq!(
        server.result(waiting).await.stop_reason,
        StopReason::Cancelled
    );
    assert_eq!(server.job(at_work).await.status, Status::Running);
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_panic_fails_its_job_and_no_other() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 2, LONG).await;
    let cursed = json!({"generations": 50, "refinements": 0, "panic_at": 7});
    let cursed = server.submit(cursed, json!({})).await;
    let sound = server.submit(orders(50, 0), json!({})).await;
    server.wait_for_end(cursed).await;
    server.wait_for_end(sound).await;
    let job = server.job(cursed).await;
    assert_eq!(job.status, Status::Failed);
    let detail = job.error.expect("a problem").detail;
    assert_eq!(detail, "the method panicked: unit 7 is cursed");
    assert_eq!(server.estimate(sound).await, unbroken(50, 0));
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_cannot_begin_fails_with_the_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let id = server.submit(json!({"generations": 1}), json!({})).await;
    server.wait_for_end(id).await;
    let error = server.job(id).await.error.expect("a problem");
    let expected = "missing field `refinements`";
    assert!(error.detail.starts_with(expected), "{}", error.detail);
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_uses_up_its_time_ends_with_its_best() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let held = json!({"generations": 50, "refinements": 0, "wait_at": 11});
    let id = server.submit(held, json!({"max_duration_s": 0.3})).await;
    server.wait_for_end(id).await;
    assert_eq!(server.job(id).await.status, Status::Succeeded);
    assert_eq!(server.result(id).await.stop_reason, StopReason::TimeLimit);
    assert_eq!(server.estimate(id).await, unbroken(10, 0));
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_ordered_shutdown_hands_the_slice_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let id = server.submit(orders(3_000_000, 2), json!({})).await;
    server.wait(id, |event| event.name == "generation").await;
    server.shutdown().await;

    let server = Server::start(folder.path(), 1, LONG).await;
    let job = server.job(id).await;
    assert_eq!((job.status, job.attempt), (Status::Running, 0));
    let progress = job.progress.expect("progress");
    server.store.jobs().cancel(id).await.expect("a wish");
    server.wait_for_end(id).await;
    let after = server.job(id).await.progress.expect("progress");
    assert!(after.generation >= progress.generation);
    server.shutdown().await;
}

/// Lives a part of a job's life and dies without a word.
fn live_and_crash(folder: &Path, slice_length: Duration, id: Option<JobId>) -> JobId {
    let runtime = tokio::runtime::Runtime::new().expect("a runtime");
    let id = runtime.block_on(async {
        let server = Server::start(folder, 1, slice_length).await;
        let id = match id {
            Some(id) => id,
            None => server.submit(orders(20, 3), json!({})).await,
        };
        let seen = server
            .store
            .events()
            .after(id, 0, 1000)
            .await
            .expect("events");
        let news = server
            .hub
            .feed(server.store.clone(), id, seen.len() as i64)
            .next()
            .await;
        // A quick worker may have ended the job before its events were read: then nothing follows.
        let has_ended = seen.iter().any(StoredEvent::is_last);
        assert!(news.expect("a read").is_some() || has_ended);
        id
    });
    runtime.shutdown_timeout(PATIENCE);
    id
}

#[test]
fn crashes_cost_a_slice_at_most_and_leave_no_trace_in_the_bits() {
    for slice_length in [ONE_UNIT, Duration::from_millis(5)] {
        let folder = tempfile::tempdir().expect("a folder");
        let id = live_and_crash(folder.path(), slice_length, None);
        live_and_crash(folder.path(), slice_length, Some(id));
        let runtime = tokio::runtime::Runtime::new().expect("a runtime");
        runtime.block_on(async {
            let server = Server::start(folder.path(), 1, slice_length).await;
            let events = server.wait_for_end(id).await;
            let ends = events.iter().filter(|event| event.is_last()).count();
            assert_eq!(ends, 1);
            let reported: Vec<u64> = events
                .iter()
                .filter(|event| event.name == "generation")
                .map(|event| serde_json::from_str::<Value>(&event.data).expect("JSON"))
                .map(|data| data["generation"].as_u64().expect("a number"))
                .collect();
            assert!(reported.is_sorted_by(|a, b| a < b), "{reported:?}");
            assert_eq!(server.estimate(id).await, unbroken(20, 3));
            let kept = server.candidates(id).await;
            let places = kept
                .candidates
                .iter()
                .map(|one| (one.generation, one.place));
            let each_once = (1..=20).flat_map(|generation| (0..30).map(move |p| (generation, p)));
            assert!(places.eq(each_once), "{kept:?}");
            assert_eq!((kept.kept, kept.cut_in_generation), (600, None));
            server.shutdown().await;
        });
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_is_cancelled_ends_soon_however_long_its_analysis_takes() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let held = json!({"generations": 50, "refinements": 0, "wait_at": 21,
                      "analyse_for_ever": true});
    let id = server.submit(held, json!({})).await;
    server.gate.wait_for_arrival();
    server.store.jobs().cancel(id).await.expect("a wish");
    server.wait_for_end(id).await;
    assert_eq!(server.result(id).await.stop_reason, StopReason::Cancelled);
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_time_is_up_while_the_server_goes_down_is_analysed_by_the_next() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let held = json!({"generations": 50, "refinements": 0, "wait_at": 11,
                      "analyse_for_ever": true});
    let id = server.submit(held, json!({"max_duration_s": 0.1})).await;
    server.gate.wait_for_arrivals(2);
    server.shutdown().await;
    let server = Server::start(folder.path(), 1, LONG).await;
    assert_eq!(server.job(id).await.status, Status::Running);
    server.store.jobs().cancel(id).await.expect("a wish");
    server.wait_for_end(id).await;
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_job_waits_for_a_clock_that_was_set_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let held = json!({"generations": 5, "refinements": 0, "wait_at": 1});
    let at_work = server.submit(held, json!({})).await;
    server.gate.wait_for_arrival();
    let waiting = server.submit(orders(3, 0), json!({})).await;
    let later = server.submit(orders(3, 0), json!({})).await;
    server
        .store
        .queue()
        .postpone_entries("+1 day")
        .await
        .expect("a write");
    server.store.jobs().cancel(at_work).await.expect("a wish");
    for id in [waiting, later] {
        server.wait_for_end(id).await;
    }
    server.shutdown().await;
}
