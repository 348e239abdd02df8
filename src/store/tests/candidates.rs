//! The record of candidates: its form on disk, its parts, its fence, and databases without one.

use sqlx::Connection as _;

use super::*;

on_both! {
    candidates_come_back_as_they_were_in_parts_of_whole_generations,
    a_slice_that_lost_its_job_keeps_no_candidates_and_a_deleted_job_has_none,
}
use crate::job::candidate::Failure;
use crate::job::{Candidate, CandidateColumn};

fn column(name: &str) -> CandidateColumn {
    CandidateColumn {
        name: name.to_owned(),
        unit: "kg".to_owned(),
        experiment: None,
        state: None,
    }
}

pub(super) fn candidate(generation: u32, place: u32) -> Candidate {
    Candidate {
        generation,
        place,
        cost: Some(1.0 / f64::from(generation + place)),
        failure: None,
        values: vec![0.1 + 0.2, f64::from(place)],
    }
}

fn failed(generation: u32, place: u32, failure: Failure) -> Candidate {
    Candidate {
        cost: None,
        failure: Some(failure),
        ..candidate(generation, place)
    }
}

pub(super) fn record(
    candidates: Vec<Candidate>,
    kept: u64,
    cut_in_generation: Option<u32>,
) -> Record {
    Record {
        candidates: Some(NewCandidates {
            columns: [column("mass"), column("damping")].into(),
            candidates,
            kept,
            cut_in_generation,
        }),
        ..Record::default()
    }
}

async fn candidates_come_back_as_they_were_in_parts_of_whole_generations(fixture: Fixture) {
    let id = fixture.submit().await.id;
    let part = async |after, generations, enough| {
        let part = fixture
            .store
            .candidates()
            .page(id, after, generations, enough);
        part.await.expect("a read")
    };
    assert_eq!(part(0, 10, 10).await, CandidatePage::default());
    let slice = fixture.begin(id).await;
    let all = vec![
        candidate(1, 0),
        failed(1, 1, Failure::Diverged),
        failed(1, 7, Failure::OutOfRange),
        failed(2, 3, Failure::StepBudget),
        candidate(5, 2),
    ];
    let (first, second) = all.split_at(3);
    for (candidates, kept, cut) in [(first, 3, None), (second, 5, Some(6))] {
        let record = record(candidates.to_vec(), kept, cut);
        let hold = fixture.store.slices().record(slice.lease, record).await;
        assert_eq!(hold.expect("a write"), Hold::Kept);
    }
    let whole = part(0, 10, 100).await;
    assert_eq!(whole.candidates, all);
    assert_eq!(whole.columns, [column("mass"), column("damping")]);
    assert_eq!((whole.kept, whole.cut_in_generation), (5, Some(6)));
    assert_eq!(whole.more_after, None);
    let by_generations = part(0, 2, 100).await;
    assert_eq!(by_generations.candidates, all[..4]);
    assert_eq!(by_generations.more_after, Some(2));
    let by_number = part(0, 10, 1).await;
    assert_eq!(by_number.candidates, first);
    assert_eq!(by_number.more_after, Some(1));
    assert_eq!(part(2, 10, 100).await.candidates, all[4..]);
    assert_eq!(part(5, 10, 100).await.candidates, []);
    let bytes: i64 = database::query_scalar("select sum(length(candidates)) from candidates")
        .fetch_one(fixture.store.readers())
        .await
        .expect("a sum");
    assert_eq!(bytes, 5 * (13 + 2 * 8), "what the setting promises");
}

async fn a_slice_that_lost_its_job_keeps_no_candidates_and_a_deleted_job_has_none(
    fixture: Fixture,
) {
    let id = fixture.submit().await.id;
    let old = fixture.begin(id).await;
    let new = fixture.begin(id).await;
    let late = record(vec![candidate(1, 0)], 1, None);
    let hold = fixture.store.slices().record(old.lease, late.clone()).await;
    assert_eq!(hold.expect("a write"), Hold::Lost);
    let kept = fixture.store.candidates().page(id, 0, 10, 10).await;
    assert_eq!(kept.expect("a read"), CandidatePage::default());
    let hold = fixture.store.slices().record(new.lease, late).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    assert_eq!(fixture.finish(&new, Status::Succeeded).await, Hold::Kept);
    let removed = fixture.store.jobs().delete(id).await.expect("a write");
    assert!(matches!(removed, JobRemoval::Removed));
    let left: i64 = database::query_scalar(
        "select (select count(*) from candidates) + (select count(*) from candidate_records)",
    )
    .fetch_one(fixture.store.readers())
    .await
    .expect("a count");
    assert_eq!(left, 0);
}

/// Makes a database what it was before candidates were recorded and comparisons had a table.
const AS_BEFORE: &str = "drop trigger recordings_come; drop trigger recordings_go; drop trigger streams_come; \
     drop trigger streams_grow; drop trigger streams_go; drop trigger jobs_come; \
     drop trigger jobs_go; drop trigger events_come; drop trigger generations_come; \
     drop trigger generations_change; drop trigger candidates_come; drop trigger candidates_go; \
     drop trigger results_come; drop trigger results_change; drop trigger keys_come; \
     drop trigger keys_go; drop trigger signal_lists_come; drop trigger signal_lists_go; \
     drop table job_bytes; drop table stored_bytes; drop table candidates; drop table candidate_records; \
     drop table comparison_jobs; drop table comparisons; drop table nodes; drop table shared_parts; drop index jobs_shared; \
     alter table jobs drop column is_shared; \
     alter table jobs drop column seal; alter table datasets drop column seal; \
     alter table dataset_chunks drop column seal; alter table checkpoints drop column seal; \
     alter table results drop column seal; alter table events drop column seal; \
     alter table generations drop column seal; \
     drop table write_probes; drop index jobs_at_work; drop index jobs_with_deaths; \
     drop table monitor_events; drop table monitor_alarms; drop table monitor_windows; \
     drop table monitors; drop table stream_batches; drop table signal_lists; drop table stream_blocks; \
     drop table streams; drop table deliveries; drop table webhooks; drop table project_days; \
     drop table audit; drop table sessions; drop table tokens; drop index jobs_by_project; \
     drop index jobs_by_project_and_status; drop index jobs_by_project_and_model; \
     alter table jobs drop column project; alter table jobs drop column deaths; \
     alter table jobs drop column at_work_in; alter table jobs drop column method; \
     drop index datasets_by_project; alter table datasets drop column bytes; \
     update datasets set identity = digest; alter table datasets drop column digest; \
     alter table datasets rename column identity to digest; \
     alter table datasets drop column project; \
     drop index results_by_trust; alter table results drop column trust; \
     drop table models; create table models (reference text not null primary key, \
         name text not null, digest text not null unique, document text not null, \
         created_at text not null) strict; \
     drop table idempotency; create table idempotency (key text not null primary key, \
         body_digest text not null, job text not null) strict, without rowid; \
     delete from _sqlx_migrations where version >= 4; \
     insert into job_labels (job, label, value) \
         select id, 'comparison', 'cmp_0192d3a4b5c67d8e9f00112233445566' from jobs";

/// A job that was submitted before there was a record has an empty one, and goes on with one; what
/// was a comparison by its label is one.
#[tokio::test]
async fn a_database_of_the_version_before_migrates() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    fixture.store.close().await;
    let mut connection = sqlx::SqliteConnection::connect_with(&sqlite::options(
        fixture.file(),
        fixture.settings.busy_timeout,
    ))
    .await
    .expect("the database");
    sqlx::raw_sql(AS_BEFORE)
        .execute(&mut connection)
        .await
        .expect("the schema before");
    connection.close().await.expect("a close");
    let fixture = fixture.reopen().await;
    let before = fixture.store.candidates().page(id, 0, 10, 10).await;
    assert_eq!(before.expect("a read"), CandidatePage::default());
    let comparison = "cmp_0192d3a4b5c67d8e9f00112233445566".parse();
    let comparison = fixture
        .store
        .comparisons()
        .find(comparison.expect("an identifier"));
    let comparison = comparison.await.expect("a read").expect("a comparison");
    assert_eq!(comparison.jobs.len(), 1);
    assert_eq!(comparison.jobs[0].id, id);
    let slice = fixture.begin(id).await;
    let hold = fixture
        .store
        .slices()
        .record(slice.lease, record(vec![candidate(1, 0)], 1, None))
        .await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    let after = fixture.store.candidates().page(id, 0, 10, 10).await;
    assert_eq!(after.expect("a read").kept, 1);
}
