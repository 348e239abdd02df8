//! What grows is counted, and ends: keys with the answers to batches, the audit log, what jobs write.

use std::time::Duration;

use super::*;
use crate::store::database::QueryBuilder;
use crate::store::{AuditEntry, AuditRow, Keep, NewBatch, Retention, StoredBytes};
use greybox::recording::{Batch, Class, QualityReport, RowColumn, RowSignal, Rows};

on_both! {
    the_key_of_a_job_goes_with_age_and_not_before_the_end_of_the_job,
    an_answer_to_a_batch_is_kept_without_the_signals_and_given_again_whole,
    many_keyed_batches_leave_nothing_behind_once_their_keys_are_too_old,
    an_audit_log_that_is_too_long_says_what_it_lost,
    what_a_project_keeps_is_counted_and_given_back,
    jobs_are_refused_once_a_project_keeps_too_much_and_those_at_work_go_on,
}

/// Lets go what the retention says until nothing more does.
async fn tidy(fixture: &Fixture, retention: Retention) {
    while fixture
        .store
        .tidy(retention)
        .await
        .expect("a write")
        .is_some()
    {}
}

fn keys_for(age: Duration) -> Retention {
    Retention {
        keys: Some(age),
        ..Retention::default()
    }
}

async fn rows_of(fixture: &Fixture, table: &'static str) -> i64 {
    let mut query = QueryBuilder::new("select count(*) from ");
    query.push(table);
    let rows: (i64,) = query
        .build_query_as()
        .fetch_one(fixture.store.readers())
        .await
        .expect("a count");
    rows.0
}

async fn stored(fixture: &Fixture) -> StoredBytes {
    fixture.store.figures().await.expect("figures").stored
}

async fn the_key_of_a_job_goes_with_age_and_not_before_the_end_of_the_job(fixture: Fixture) {
    let submit = async || {
        let submitted = fixture
            .store
            .submissions()
            .submit(job(Some(("order-7", "a"))))
            .await;
        submitted.expect("a submission")
    };
    let Submitted::Created(first) = submit().await else {
        panic!("not created");
    };
    tidy(&fixture, keys_for(Duration::ZERO)).await;
    assert!(matches!(submit().await, Submitted::Replayed(row) if row.id == first.id));
    fixture
        .store
        .jobs()
        .cancel(first.id)
        .await
        .expect("a write");
    tidy(&fixture, keys_for(Duration::from_hours(24))).await;
    assert!(matches!(submit().await, Submitted::Replayed(row) if row.id == first.id));
    tidy(&fixture, keys_for(Duration::ZERO)).await;
    assert_eq!(rows_of(&fixture, "idempotency").await, 0);
    assert!(matches!(submit().await, Submitted::Created(row) if row.id != first.id));
}

/// Second `k` of sixty signals.
pub(super) fn batch(k: u32, key: &str) -> NewBatch {
    let signals = (0..60).map(|number| RowSignal {
        name: format!("signal {number}"),
        unit: "m".to_owned(),
        recorded_unit: "mm".to_owned(),
        interpolation: None,
    });
    let column = RowColumn {
        values: vec![f64::from(k)],
        classes: vec![Class::Good],
    };
    NewBatch {
        project: Default::default(),
        stream: "rig-4".to_owned(),
        batch: Batch {
            signals: signals.collect(),
            rows: Rows {
                instants: vec![i64::from(k) * 1_000_000_000],
                columns: vec![column; 60],
            },
            zone: None,
            report: QualityReport::default(),
            double_hour: None,
        },
        keep: Keep::default(),
        idempotency: Some(Idempotency {
            project: Default::default(),
            key: key.to_owned(),
            body_digest: "a".to_owned(),
        }),
    }
}

pub(super) async fn append(fixture: &Fixture, batch: NewBatch) -> BatchOutcome {
    fixture
        .store
        .streams()
        .append(batch)
        .await
        .expect("a batch")
}

async fn an_answer_to_a_batch_is_kept_without_the_signals_and_given_again_whole(fixture: Fixture) {
    let BatchOutcome::Stored(first, true) = append(&fixture, batch(1, "1")).await else {
        panic!("not stored");
    };
    append(&fixture, batch(2, "2")).await;
    let kept: String =
        database::query_scalar("select answer from stream_batches order by id limit 1")
            .fetch_one(fixture.store.readers())
            .await
            .expect("an answer");
    assert!(kept.len() < 500, "{kept}");
    let mut more = batch(3, "3");
    more.batch.signals.truncate(30);
    more.batch.rows.columns.truncate(30);
    more.batch.signals[0].name = "another".to_owned();
    append(&fixture, more).await;
    let BatchOutcome::Replayed(again) = append(&fixture, batch(1, "1")).await else {
        panic!("not replayed");
    };
    let text = |answer: &Appended| serde_json::to_string(answer).expect("an answer");
    assert_eq!(text(&again), text(&first));
    assert_eq!(rows_of(&fixture, "signal_lists").await, 2);
}

async fn many_keyed_batches_leave_nothing_behind_once_their_keys_are_too_old(fixture: Fixture) {
    let before = stored(&fixture).await;
    for round in 0..3 {
        for k in 0..40 {
            append(&fixture, batch(k, &format!("{round} {k}"))).await;
        }
        assert!(stored(&fixture).await.keys > before.keys);
        tidy(&fixture, keys_for(Duration::ZERO)).await;
        for table in ["idempotency", "stream_batches", "signal_lists"] {
            assert_eq!(rows_of(&fixture, table).await, 0, "{table}");
        }
        assert_eq!(stored(&fixture).await.keys, before.keys);
    }
}

fn refusal(number: u32) -> AuditEntry {
    AuditEntry {
        who: "token mes".to_owned(),
        project: Some("hall-2".parse().expect("a project")),
        address: "10.0.0.1".to_owned(),
        method: "DELETE".to_owned(),
        path: format!("/v1/jobs/{number}"),
        status: 404,
        request_id: format!("r-{number}"),
        left_out: 1,
    }
}

async fn an_audit_log_that_is_too_long_says_what_it_lost(fixture: Fixture) {
    const MOST: u64 = 20;
    let log = async || {
        let project = "hall-2".parse().expect("a project");
        let page = fixture.store.audit().list(&project, false, None, 100).await;
        page.expect("a page").rows
    };
    let mut written = 0;
    let mut first: Option<AuditRow> = None;
    for round in 0..4 {
        for number in 0..30 {
            fixture
                .store
                .audit()
                .add(refusal(number))
                .await
                .expect("a write");
            written += 1 + refusal(number).left_out;
        }
        if round == 0 {
            first = log().await.pop();
        }
        let shorter = Retention {
            most_audit: Some(MOST),
            ..Retention::default()
        };
        tidy(&fixture, shorter).await;
        let rows = log().await;
        assert!(rows.len() as u64 <= MOST, "{}", rows.len());
        assert!(rows.len() as u64 >= MOST / 2, "{}", rows.len());
        let told = rows.iter().map(|row| {
            let itself = u64::from(row.loss.is_none());
            itself + row.entry.left_out
        });
        assert_eq!(told.sum::<u64>(), written);
        let losses: Vec<&AuditRow> = rows.iter().filter(|row| row.loss.is_some()).collect();
        let from = losses.iter().filter_map(|row| Some(row.loss?.from)).min();
        assert_eq!(from, first.as_ref().map(|row| row.at));
    }
    // What no entry states cannot go.
    let pool = &fixture.store.database().writer_pool;
    let removal = database::query("delete from audit").execute(pool).await;
    assert!(removal.is_err());
}

/// What is kept, measured.
async fn measured(fixture: &Fixture) -> StoredBytes {
    database::query_as(
        "select cast((select coalesce(sum(bytes), 0) from datasets) \
             + (select coalesce(sum(bytes), 0) from streams) as bigint) as samples, \
         cast((select coalesce(sum(octet_length(spec)), 0) from jobs) \
             + (select coalesce(sum(octet_length(data)), 0) from events) \
             + (select coalesce(sum(octet_length(generations.row)), 0) from generations) \
             + (select coalesce(sum(octet_length(candidates)), 0) from candidates) \
             + (select coalesce(sum(octet_length(outcome)), 0) from results) as bigint) as jobs, \
         cast((select coalesce(sum(octet_length(key) + octet_length(body_digest) + octet_length(made)), 0) \
                 from idempotency) \
             + (select coalesce(sum(octet_length(answer)), 0) from stream_batches) \
             + (select coalesce(sum(octet_length(signals)), 0) from signal_lists) as bigint) as keys",
    )
    .fetch_one(fixture.store.readers())
    .await
    .expect("sizes")
}

/// A job that wrote generations, candidates, events and a result, the first two generations twice.
async fn worked(fixture: &Fixture, key: &str) -> JobId {
    let Ok(Submitted::Created(row)) = fixture
        .store
        .submissions()
        .submit(job(Some((key, "a"))))
        .await
    else {
        panic!("not created");
    };
    let slice = fixture.begin(row.id).await;
    for upto in [2, 5] {
        let candidates = (1..=upto).map(|number| candidates::candidate(number, 0));
        let mut record = candidates::record(candidates.collect(), u64::from(upto), None);
        record.generations = (1..=upto).map(generation).collect();
        record.generations[0].evaluations *= 1000;
        record.events = vec![Event::Generation(generation(upto))];
        let hold = fixture.store.slices().record(slice.lease, record).await;
        assert_eq!(hold.expect("a write"), Hold::Kept);
    }
    fixture.store.jobs().pause(row.id).await.expect("a write");
    assert_eq!(fixture.finish(&slice, Status::Paused).await, Hold::Kept);
    fixture.store.jobs().cancel(row.id).await.expect("a write");
    row.id
}

async fn what_a_project_keeps_is_counted_and_given_back(fixture: Fixture) {
    let dataset = datasets::insert(&fixture, "sha256:1").await.0.id;
    let jobs = [worked(&fixture, "a").await, worked(&fixture, "b").await];
    append(&fixture, batch(1, "c")).await;
    append(&fixture, batch(2, "d")).await;
    let full = stored(&fixture).await;
    assert!(full.samples > 0 && full.jobs > 0 && full.keys > 0, "{full}");
    assert_eq!(full, measured(&fixture).await);

    let no_candidates = Retention {
        candidates: Some(Duration::ZERO),
        ..Retention::default()
    };
    tidy(&fixture, no_candidates).await;
    let less = stored(&fixture).await;
    assert!(less.jobs < full.jobs, "{less}");
    assert_eq!(less, measured(&fixture).await);

    fixture.store.jobs().delete(jobs[0]).await.expect("a write");
    fixture
        .store
        .datasets()
        .delete(dataset)
        .await
        .expect("a write");
    let project = Default::default();
    let removal = fixture.store.streams().delete(&project, "rig-4").await;
    removal.expect("a write");
    assert_eq!(stored(&fixture).await, measured(&fixture).await);
    let everything = Retention {
        jobs: Some(Duration::ZERO),
        ..keys_for(Duration::ZERO)
    };
    tidy(&fixture, everything).await;
    assert_eq!(stored(&fixture).await, StoredBytes::default());
}

/// Opens the database anew for projects that may keep so many bytes.
async fn with_room(fixture: Fixture, stored_bytes: u64) -> Fixture {
    fixture.store.close().await;
    let Fixture {
        store,
        changes,
        settings,
        _folder,
    } = fixture;
    drop(store);
    let quotas = Quotas {
        stored_bytes,
        ..Quotas::default()
    };
    let store = Store::open_with(&settings, quotas, Arc::new(|_| ())).await;
    Fixture {
        store: store.expect("a database"),
        changes,
        settings,
        _folder,
    }
}

async fn jobs_are_refused_once_a_project_keeps_too_much_and_those_at_work_go_on(fixture: Fixture) {
    let fixture = with_room(fixture, 1000).await;
    let at_work = fixture.submit().await.id;
    let slice = fixture.begin(at_work).await;
    let record = Record {
        generations: (1..=20).map(generation).collect(),
        ..Record::default()
    };
    let hold = fixture.store.slices().record(slice.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    let refused = fixture
        .store
        .submissions()
        .submit(job(None))
        .await
        .expect("an answer");
    let Submitted::Refused(exceeded) = refused else {
        panic!("not refused: {refused:?}");
    };
    let told = exceeded.to_string();
    for part in [
        "0 bytes of recordings",
        "of jobs with their",
        "may have 1000",
    ] {
        assert!(told.contains(part), "{told}");
    }
    let refused = fixture.store.streams().append(batch(1, "a")).await;
    assert!(matches!(refused, Err(StoreError::Quota(_))), "{refused:?}");
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    fixture.store.jobs().delete(at_work).await.expect("a write");
    fixture.submit().await;
}
