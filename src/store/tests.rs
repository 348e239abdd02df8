//! The store against a fresh database each: fencing, replay, idempotency, group commit, paging.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use proptest::prelude::*;
use serde_json::{Value, json};

use super::*;
use crate::job::{Event, Failure, GenerationEvent, Phase, Progress, Status};

struct Fixture {
    store: Store,
    changes: Arc<Mutex<Vec<Change>>>,
    settings: DatabaseSettings,
    _folder: tempfile::TempDir,
}

impl Fixture {
    async fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let settings = DatabaseSettings {
            path: folder.path().join("jobs.db"),
            readers: 2,
            busy_timeout: Duration::from_secs(5),
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
        self.store.close().await;
        let Self {
            store,
            changes,
            settings,
            _folder,
        } = self;
        drop(store);
        let store = open(&settings, &changes).await;
        Self {
            store,
            changes,
            settings,
            _folder,
        }
    }

    async fn submit(&self) -> JobRow {
        match self.store.submit(job(None)).await.expect("a submission") {
            Submitted::Created(row) => row,
            other => panic!("not created: {other:?}"),
        }
    }

    async fn begin(&self, id: JobId) -> Slice {
        match self.store.begin_slice(id, None, 5).await.expect("a start") {
            Begin::Slice(slice) => *slice,
            other => panic!("no slice: {other:?}"),
        }
    }

    async fn finish(&self, slice: &Slice, status: Status) -> Hold {
        let ending = Ending {
            status,
            outcome: Some(outcome()),
            error: None,
        };
        self.store
            .finish(slice.lease, Record::default(), ending)
            .await
            .expect("an end")
    }

    async fn events(&self, id: JobId) -> Vec<StoredEvent> {
        self.store.events_after(id, 0, 1000).await.expect("events")
    }

    async fn status(&self, id: JobId) -> Status {
        self.store
            .job(id)
            .await
            .expect("a read")
            .expect("a job")
            .status
    }
}

async fn open(settings: &DatabaseSettings, changes: &Arc<Mutex<Vec<Change>>>) -> Store {
    let changes = changes.clone();
    let on_change = Arc::new(move |change| changes.lock().expect("unpoisoned").push(change));
    Store::open(settings, on_change).await.expect("a database")
}

fn job(key: Option<(&str, &str)>) -> NewJob {
    NewJob {
        name: Some("rig 4".to_owned()),
        labels: BTreeMap::from([("site".to_owned(), "hall 2".to_owned())]),
        model: "positioning_drive".to_owned(),
        spec: json!({"model": "positioning_drive", "parameters": {"mass": {"value": 1e-5}}}),
        datasets: Vec::new(),
        idempotency: key.map(|(key, body_digest)| Idempotency {
            key: key.to_owned(),
            body_digest: body_digest.to_owned(),
        }),
    }
}

fn outcome() -> Value {
    json!({"stop_reason": "paused", "parameters": [{"name": "mass", "estimate": 58.02e-7}], "fit": {}})
}

fn generation(number: u32) -> GenerationEvent {
    GenerationEvent {
        generation: number,
        evaluations: u64::from(number) * 30,
        best_cost: Some(1.0 / f64::from(number)),
        mean_cost: None,
        best_credit: Some(0.1),
        entropy: Some(2.0),
        credit_updates: 400,
        best: serde_json::Map::from_iter([("mass".to_owned(), json!(0.1 + 0.2))]),
    }
}

fn ids(events: &[StoredEvent]) -> Vec<i64> {
    events.iter().map(|event| event.id).collect()
}

fn names(events: &[StoredEvent]) -> Vec<&str> {
    events.iter().map(|event| &*event.name).collect()
}

#[tokio::test]
async fn a_submitted_job_is_shown_listed_and_told_of() {
    let fixture = Fixture::new().await;
    let row = fixture.submit().await;
    assert_eq!(row.status, Status::Queued);
    assert_eq!(
        fixture.store.job(row.id).await.expect("a read"),
        Some(row.clone())
    );
    let events = fixture.events(row.id).await;
    assert_eq!(events[0].data, r#"{"status":"queued"}"#);
    assert_eq!(
        *fixture.changes.lock().expect("unpoisoned"),
        [Change::Job(row.id)]
    );
}

#[tokio::test]
async fn a_job_survives_the_server_that_took_it() {
    let fixture = Fixture::new().await;
    let row = fixture.submit().await;
    let slice = fixture.begin(row.id).await;
    let fixture = fixture.reopen().await;
    assert_eq!(fixture.status(row.id).await, Status::Running);
    let next = fixture.begin(row.id).await;
    assert_eq!(next.job.attempt, 2);
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Lost);
    assert_eq!(fixture.finish(&next, Status::Succeeded).await, Hold::Kept);
}

#[tokio::test]
async fn two_servers_on_one_database_are_refused() {
    let fixture = Fixture::new().await;
    let second = Store::open(&fixture.settings, Arc::new(|_| ())).await;
    assert!(matches!(second, Err(StoreError::Locked { .. })));
}

#[tokio::test]
async fn a_write_with_an_old_epoch_changes_nothing() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let old = fixture.begin(id).await;
    let new = fixture.begin(id).await;
    let before = fixture.store.job(id).await.expect("a read");
    let record = Record {
        generations: vec![generation(1)],
        events: vec![Event::Generation(generation(1))],
        checkpoint: Some(Checkpoint {
            state: vec![1],
            worked_ms: 5,
        }),
        ..Record::default()
    };
    let hold = fixture.store.record(old.lease, record.clone()).await;
    assert_eq!(hold.expect("a write"), Hold::Lost);
    assert_eq!(fixture.finish(&old, Status::Failed).await, Hold::Lost);
    assert_eq!(fixture.store.job(id).await.expect("a read"), before);
    assert_eq!(fixture.events(id).await.len(), 2);
    assert!(
        fixture
            .store
            .generations(id, 0, 10)
            .await
            .expect("rows")
            .is_empty()
    );
    let hold = fixture.store.record(new.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    assert_eq!(fixture.events(id).await.len(), 3);
}

#[tokio::test]
async fn a_slice_goes_on_where_the_last_one_stopped() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let first = fixture.begin(id).await;
    assert_eq!(first.checkpoint, None);
    let progress = Progress {
        phase: Phase::Search,
        generation: 3,
        generations: 10,
        evaluations: 90,
        best_cost: Some(0.1 + 0.2),
        best_credit: None,
        fraction: 0.3,
        eta_s: Some(2.0),
    };
    let told = Told {
        generation: 2,
        refinement: 0,
        at_ms: 77,
    };
    let record = Record {
        generations: (1..=3).map(generation).collect(),
        events: vec![Event::Generation(generation(2))],
        told,
        progress: Some(progress.clone()),
        checkpoint: Some(Checkpoint {
            state: b"state".to_vec(),
            worked_ms: 40,
        }),
    };
    let hold = fixture.store.record(first.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    let second = fixture.begin(id).await;
    assert_eq!(second.checkpoint.as_deref(), Some(&b"state"[..]));
    assert_eq!((second.running_ms, second.told), (40, told));
    assert_eq!(second.untold, Some(generation(3)));
    assert_eq!(second.job.progress, Some(progress));
    assert_eq!(second.job.attempt, 1);
}

#[tokio::test]
async fn a_job_that_takes_its_server_down_five_times_fails() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    for attempt in 1..=5 {
        assert_eq!(fixture.begin(id).await.job.attempt, attempt);
    }
    let sixth = fixture.store.begin_slice(id, None, 5).await;
    assert!(matches!(sixth, Ok(Begin::Poisoned)));
    let row = fixture.store.job(id).await.expect("a read").expect("a job");
    assert_eq!((row.status, row.attempt), (Status::Failed, 5));
    let expected = serde_json::to_value(Failure::crashed_too_often(5)).expect("JSON");
    assert_eq!(row.error, Some(expected));
    assert_eq!(
        names(&fixture.events(id).await),
        ["state", "state", "state", "end"]
    );
}

#[tokio::test]
async fn the_end_of_a_job_is_told_with_its_result() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let slice = fixture.begin(id).await;
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    assert_eq!(fixture.finish(&slice, Status::Failed).await, Hold::Lost);
    let events = fixture.events(id).await;
    assert_eq!(ids(&events), [1, 2, 3, 4, 5]);
    assert_eq!(names(&events), ["state", "state", "result", "state", "end"]);
    assert!(events[4].is_last());
    assert_eq!(
        fixture.store.result(id).await.expect("a read"),
        Some(outcome())
    );
    let begun = fixture.store.begin_slice(id, None, 5).await;
    assert!(matches!(begun, Ok(Begin::Nothing)));
}

#[tokio::test]
async fn the_same_key_never_makes_two_jobs() {
    let fixture = Fixture::new().await;
    let key = Some(("k", "sha256:1"));
    let Ok(Submitted::Created(first)) = fixture.store.submit(job(key)).await else {
        panic!("not created");
    };
    fixture.begin(first.id).await;
    let Ok(Submitted::Replayed(again)) = fixture.store.submit(job(key)).await else {
        panic!("not replayed");
    };
    assert_eq!(again, first);
    let other_body = fixture.store.submit(job(Some(("k", "sha256:2")))).await;
    assert!(matches!(other_body, Ok(Submitted::KeyReused)));
    fixture
        .store
        .request_cancel(first.id)
        .await
        .expect("a wish");
    let slice = fixture.begin(first.id).await;
    assert_eq!(fixture.finish(&slice, Status::Cancelled).await, Hold::Kept);
    let removed = fixture.store.delete_job(first.id).await;
    assert_eq!(removed.expect("a removal"), JobRemoval::Removed);
    let after = fixture.store.submit(job(key)).await;
    assert!(matches!(after, Ok(Submitted::Forgotten(id)) if id == first.id));
}

#[tokio::test]
async fn a_key_raced_by_many_clients_makes_one_job() {
    let fixture = Fixture::new().await;
    let submissions = (0..50).map(|_| fixture.store.submit(job(Some(("k", "sha256:1")))));
    let answers = futures_util::future::join_all(submissions).await;
    let created = answers
        .iter()
        .filter(|answer| matches!(answer, Ok(Submitted::Created(_))))
        .count();
    let replayed = answers
        .iter()
        .filter(|answer| matches!(answer, Ok(Submitted::Replayed(_))))
        .count();
    assert_eq!((created, replayed), (1, 49));
}

#[tokio::test]
async fn a_write_that_fails_harms_none_of_its_group() {
    let fixture = Fixture::new().await;
    let row = fixture.submit().await;
    let broken = fixture.store.inner.writer.write(|tx| {
        Box::pin(async move {
            sqlx::query("insert into idempotency values ('half', '', '')")
                .execute(&mut **tx)
                .await?;
            sqlx::query("insert into results values ('nobody', '')")
                .execute(&mut **tx)
                .await?;
            Ok(())
        })
    });
    let (broken, good) = tokio::join!(broken, fixture.store.submit(job(None)));
    assert!(matches!(broken, Err(StoreError::Database(_))));
    let Ok(Submitted::Created(good)) = good else {
        panic!("not created");
    };
    let half: i64 = sqlx::query_scalar("select count(*) from idempotency")
        .fetch_one(fixture.store.readers())
        .await
        .expect("a count");
    assert_eq!(half, 0);
    let listed = fixture
        .store
        .jobs(&JobFilter {
            limit: 10,
            ..JobFilter::default()
        })
        .await
        .expect("a list");
    let listed: Vec<JobId> = listed.rows.iter().map(|row| row.id).collect();
    assert_eq!(listed, [good.id, row.id]);
}

#[tokio::test]
async fn pages_cover_the_list_once_newest_first() {
    let fixture = Fixture::new().await;
    let mut expected = Vec::new();
    for _ in 0..7 {
        expected.insert(0, fixture.submit().await.id);
    }
    let mut seen = Vec::new();
    let mut filter = JobFilter {
        limit: 3,
        ..JobFilter::default()
    };
    loop {
        let page = fixture.store.jobs(&filter).await.expect("a page");
        seen.extend(page.rows.iter().map(|row| row.id));
        match page.next {
            Some(last) => filter.before = Some(last),
            None => break,
        }
    }
    assert_eq!(seen, expected);
}

#[tokio::test]
async fn lists_are_narrowed_by_state_and_label() {
    let fixture = Fixture::new().await;
    let queued = fixture.submit().await.id;
    let running = fixture.submit().await.id;
    fixture.begin(running).await;
    let list = |status, label: Option<(&str, Option<&str>)>| {
        let filter = JobFilter {
            status,
            label: label.map(|(label, value)| (label.to_owned(), value.map(str::to_owned))),
            before: None,
            limit: 10,
        };
        let store = fixture.store.clone();
        async move {
            let page = store.jobs(&filter).await.expect("a page");
            page.rows.iter().map(|row| row.id).collect::<Vec<_>>()
        }
    };
    assert_eq!(list(Some(Status::Running), None).await, [running]);
    assert_eq!(list(None, Some(("site", None))).await, [running, queued]);
    assert_eq!(
        list(Some(Status::Queued), Some(("site", Some("hall 2")))).await,
        [queued]
    );
    assert!(list(None, Some(("site", Some("hall 3")))).await.is_empty());
}

#[tokio::test]
async fn a_queued_job_is_cancelled_and_paused_at_once() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    fixture.store.request_pause(id).await.expect("a wish");
    assert_eq!(fixture.status(id).await, Status::Paused);
    fixture.store.request_resume(id).await.expect("a wish");
    assert_eq!(fixture.status(id).await, Status::Queued);
    fixture.store.request_cancel(id).await.expect("a wish");
    fixture.store.request_cancel(id).await.expect("a wish");
    let events = fixture.events(id).await;
    assert_eq!(ids(&events), [1, 2, 3, 4, 5]);
    assert!(events[4].is_last());
    let resumed = fixture.store.request_resume(id).await.expect("a wish");
    assert_eq!(resumed, Control::Refused(Status::Cancelled));
}

#[tokio::test]
async fn a_running_job_is_asked_and_a_pause_can_be_taken_back() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    fixture.begin(id).await;
    fixture.store.request_pause(id).await.expect("a wish");
    assert_eq!(fixture.store.stop_requests().await.expect("a read"), [id]);
    let changes = fixture.changes.lock().expect("unpoisoned").clone();
    assert!(changes.contains(&Change::StopRequested(id)));
    fixture.store.request_resume(id).await.expect("a wish");
    assert!(
        fixture
            .store
            .stop_requests()
            .await
            .expect("a read")
            .is_empty()
    );
    assert_eq!(fixture.status(id).await, Status::Running);
}

#[tokio::test]
async fn the_estimate_of_a_paused_job_outlives_its_cancellation() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let slice = fixture.begin(id).await;
    assert_eq!(fixture.finish(&slice, Status::Paused).await, Hold::Kept);
    fixture.store.request_cancel(id).await.expect("a wish");
    let mut expected = outcome();
    expected["stop_reason"] = json!("cancelled");
    let result = fixture.store.result(id).await.expect("a read");
    assert_eq!(result, Some(expected));
    let exact = &result.expect("a result")["parameters"][0]["estimate"];
    assert_eq!(
        exact.as_f64().map(f64::to_bits),
        Some(58.02e-7_f64.to_bits())
    );
}

#[tokio::test]
async fn only_the_newest_queue_entry_begins_a_slice() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let entry = async || -> i64 {
        sqlx::query_scalar("select queue_entry from jobs")
            .fetch_one(fixture.store.readers())
            .await
            .expect("an entry")
    };
    let first = entry().await;
    fixture.store.request_pause(id).await.expect("a wish");
    fixture.store.request_resume(id).await.expect("a wish");
    let second = entry().await;
    assert_ne!(first, second);
    let stale = fixture.store.begin_slice(id, Some(first), 5).await;
    assert!(matches!(stale, Ok(Begin::Nothing)));
    let fresh = fixture.store.begin_slice(id, Some(second), 5).await;
    assert!(matches!(fresh, Ok(Begin::Slice(_))));
}

#[tokio::test]
async fn entries_that_a_dead_server_left_running_are_available_at_once() {
    let fixture = Fixture::new().await;
    fixture.submit().await;
    let lost = fixture.submit().await;
    for statement in [
        "update river_job set state = 'running', attempt = 1",
        "delete from river_job where id = (select max(id) from river_job)",
    ] {
        fixture
            .store
            .inner
            .writer
            .write(move |tx| {
                Box::pin(async move {
                    sqlx::query(statement).execute(&mut **tx).await?;
                    Ok(())
                })
            })
            .await
            .expect("a broken queue");
    }
    let fixture = fixture.reopen().await;
    let entries: Vec<(String, String)> = sqlx::query_as(
        "select jobs.id, river_job.state from jobs join river_job on river_job.id = queue_entry \
         order by jobs.id",
    )
    .fetch_all(fixture.store.readers())
    .await
    .expect("entries");
    assert_eq!(entries.len(), 2);
    assert!(entries.iter().all(|(_, state)| state == "available"));
    assert_eq!(entries[1].0, lost.id.to_string());
}

#[tokio::test]
async fn an_unfinished_job_is_not_deleted() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let removal = fixture.store.delete_job(id).await;
    assert_eq!(
        removal.expect("a removal"),
        JobRemoval::Unfinished(Status::Queued)
    );
    let unknown = fixture.store.delete_job(JobId::new()).await;
    assert_eq!(unknown.expect("a removal"), JobRemoval::NotFound);
}

#[tokio::test]
async fn events_are_replayed_from_any_id() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let slice = fixture.begin(id).await;
    let record = Record {
        events: (1..=2500)
            .map(|iteration| Event::Refinement {
                iteration,
                cost: 1.0,
            })
            .collect(),
        ..Record::default()
    };
    let hold = fixture.store.record(slice.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    let mut seen = Vec::new();
    loop {
        let after = seen.last().copied().unwrap_or(0);
        let page = fixture
            .store
            .events_after(id, after, 700)
            .await
            .expect("a page");
        if page.is_empty() {
            break;
        }
        seen.extend(ids(&page));
    }
    assert_eq!(seen, (1..=2502).collect::<Vec<i64>>());
}

/// What can be done to a job from outside and by its worker.
#[derive(Clone, Copy, Debug)]
enum Deed {
    Cancel,
    Pause,
    Resume,
    Begin,
    Record,
    Finish(Status),
    Reopen,
}

fn deeds() -> impl Strategy<Value = Vec<Deed>> {
    let deed = prop_oneof![
        Just(Deed::Cancel),
        Just(Deed::Pause),
        Just(Deed::Resume),
        Just(Deed::Begin),
        Just(Deed::Begin),
        Just(Deed::Record),
        Just(Deed::Finish(Status::Succeeded)),
        Just(Deed::Finish(Status::Paused)),
        Just(Deed::Finish(Status::Cancelled)),
        Just(Deed::Reopen),
    ];
    proptest::collection::vec(deed, 1..25)
}

async fn live(deeds: Vec<Deed>) -> (Status, Vec<StoredEvent>, Option<Value>) {
    let mut fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    let mut slices: Vec<Slice> = Vec::new();
    for deed in deeds {
        match deed {
            Deed::Cancel => drop(fixture.store.request_cancel(id).await.expect("a wish")),
            Deed::Pause => drop(fixture.store.request_pause(id).await.expect("a wish")),
            Deed::Resume => drop(fixture.store.request_resume(id).await.expect("a wish")),
            Deed::Begin => {
                let begun = fixture
                    .store
                    .begin_slice(id, None, 5)
                    .await
                    .expect("a start");
                if let Begin::Slice(slice) = begun {
                    slices.push(*slice);
                }
            }
            Deed::Record => {
                for slice in &slices {
                    let record = Record {
                        events: vec![Event::Generation(generation(1))],
                        ..Record::default()
                    };
                    let hold = fixture.store.record(slice.lease, record).await;
                    let newest = slices.last().map(|newest| newest.lease);
                    let kept = hold.expect("a write") == Hold::Kept;
                    assert!(!kept || newest == Some(slice.lease));
                }
            }
            Deed::Finish(status) => {
                for slice in &slices {
                    let _ = fixture.finish(slice, status).await;
                }
            }
            Deed::Reopen => fixture = fixture.reopen().await,
        }
    }
    let result = fixture.store.result(id).await.expect("a read");
    (fixture.status(id).await, fixture.events(id).await, result)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_life_has_gap_free_events_and_one_end_at_most(deeds in deeds()) {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .expect("a runtime");
        let (status, events, result) = runtime.block_on(live(deeds));
        prop_assert_eq!(ids(&events), (1..=i64::try_from(events.len()).expect("few")).collect::<Vec<_>>());
        let ends: Vec<usize> = (0..events.len()).filter(|&i| events[i].is_last()).collect();
        if status.is_terminal() {
            prop_assert_eq!(ends, vec![events.len() - 1]);
            let end = format!(r#"{{"status":"{status}"}}"#);
            prop_assert_eq!(&events[events.len() - 1].data, &end);
            prop_assert_eq!(&events[events.len() - 2].data, &end);
        } else {
            prop_assert!(ends.is_empty());
        }
        if status == Status::Succeeded {
            prop_assert!(result.is_some());
        }
    }
}
