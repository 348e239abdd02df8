//! Submitting, showing, listing, controlling and deleting jobs.

use super::*;
use crate::store::lock::FileLock;
use crate::store::opening::Opened;

on_both! {
    a_submitted_job_is_shown_listed_and_told_of,
    the_same_key_never_makes_two_jobs,
    a_key_raced_by_many_clients_makes_one_job,
    submissions_written_together_are_answered_each_for_itself,
    as_many_submissions_as_may_wait_are_written_together_with_all_their_labels,
    a_change_is_seen_by_the_next_read,
    a_write_that_fails_harms_none_of_its_group,
    pages_cover_the_list_once_newest_first,
    lists_are_newest_first_after_the_clock_was_set_back_and_the_server_started_again,
    lists_are_narrowed_by_state_and_label,
    a_queued_job_is_cancelled_and_paused_at_once,
    a_running_job_is_asked_and_a_pause_can_be_taken_back,
    the_estimate_of_a_paused_job_outlives_its_cancellation,
    an_unfinished_job_is_not_deleted,
}

async fn a_submitted_job_is_shown_listed_and_told_of(fixture: Fixture) {
    let row = fixture.submit().await;
    assert_eq!(row.status, Status::Queued);
    assert_eq!(
        fixture
            .store
            .jobs()
            .find(row.id)
            .await
            .expect("a read")
            .as_deref(),
        Some(&row)
    );
    let events = fixture.events(row.id).await;
    assert_eq!(events[0].data, r#"{"status":"queued"}"#);
    let mut changes = fixture.changes.lock().expect("unpoisoned").clone();
    changes.retain(|change| *change != Change::Missed);
    assert_eq!(
        changes,
        [Change::SliceWaits(row.project.clone()), Change::Job(row.id)]
    );
}

#[tokio::test]
async fn two_servers_on_one_file_are_refused() {
    let fixture = Fixture::new().await;
    let second = Store::open(&fixture.settings, Arc::new(|_| ())).await;
    assert!(matches!(second, Err(StoreError::Locked { .. })));
}

#[tokio::test]
async fn a_server_waits_for_a_command_that_has_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("jobs.db");
    let command = FileLock::take(&path).expect("nobody has it");
    let settings = DatabaseSettings::of_a_command(&DatabasePlace::File(path));
    // The server tries first, and the command ends after that.
    let (opened, ()) = tokio::join!(Opened::open_in_turn(&settings), async { drop(command) });
    opened.expect("a database").close().await;
}

async fn the_same_key_never_makes_two_jobs(fixture: Fixture) {
    let key = Some(("k", "sha256:1"));
    let Ok(Submitted::Created(first)) = fixture.store.submissions().submit(job(key)).await else {
        panic!("not created");
    };
    fixture.begin(first.id).await;
    let Ok(Submitted::Replayed(again)) = fixture.store.submissions().submit(job(key)).await else {
        panic!("not replayed");
    };
    assert_eq!(again, first);
    let other_body = fixture
        .store
        .submissions()
        .submit(job(Some(("k", "sha256:2"))))
        .await;
    assert!(matches!(other_body, Ok(Submitted::KeyReused)));
    fixture.store.jobs().cancel(first.id).await.expect("a wish");
    let slice = fixture.begin(first.id).await;
    assert_eq!(fixture.finish(&slice, Status::Cancelled).await, Hold::Kept);
    let removed = fixture.store.jobs().delete(first.id).await;
    assert_eq!(removed.expect("a removal"), JobRemoval::Removed);
    let after = fixture.store.submissions().submit(job(key)).await;
    assert!(matches!(after, Ok(Submitted::Forgotten(id)) if id == first.id.to_string()));
}

async fn a_key_raced_by_many_clients_makes_one_job(fixture: Fixture) {
    let submissions = (0..50).map(|_| {
        fixture
            .store
            .submissions()
            .submit(job(Some(("k", "sha256:1"))))
    });
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

async fn submissions_written_together_are_answered_each_for_itself(fixture: Fixture) {
    let nowhere = DatasetId::new();
    let with_model = |model: &str| NewJob {
        project: Default::default(),
        model: model.to_owned(),
        ..job(None)
    };
    let without_dataset = NewJob {
        project: Default::default(),
        datasets: vec![nowhere],
        ..job(Some(("k", "sha256:1")))
    };
    let submissions = [
        without_dataset,
        job(Some(("k", "sha256:2"))),
        job(Some(("k", "sha256:3"))),
        job(Some(("k", "sha256:2"))),
        with_model("nobody@0123"),
        with_model("positioning_drive"),
    ];
    let submissions = submissions.map(|job| fixture.store.submissions().submit(job));
    let answers = futures_util::future::join_all(submissions).await;
    let mut answers = answers.into_iter().map(|answer| answer.expect("an answer"));
    assert!(matches!(answers.next(), Some(Submitted::NoDataset(id)) if id == nowhere));
    let Some(Submitted::Created(first)) = answers.next() else {
        panic!("not created");
    };
    assert!(matches!(answers.next(), Some(Submitted::KeyReused)));
    let Some(Submitted::Replayed(again)) = answers.next() else {
        panic!("not replayed");
    };
    assert_eq!(again, first);
    assert!(matches!(answers.next(), Some(Submitted::NoModel(_))));
    let Some(Submitted::Created(last)) = answers.next() else {
        panic!("not created");
    };
    for row in [first, last] {
        assert_eq!(
            fixture
                .store
                .jobs()
                .find(row.id)
                .await
                .expect("a read")
                .as_deref(),
            Some(&row)
        );
        assert_eq!(ids(&fixture.events(row.id).await), [1]);
        fixture.begin(row.id).await;
    }
}

async fn as_many_submissions_as_may_wait_are_written_together_with_all_their_labels(
    fixture: Fixture,
) {
    let labels: BTreeMap<String, String> = (0..16)
        .map(|n| (format!("label{n}"), "x".to_owned()))
        .collect();
    let submissions = (0..1000).map(|_| {
        let labels = labels.clone();
        fixture.store.submissions().submit(NewJob {
            project: Default::default(),
            labels,
            ..job(None)
        })
    });
    let answers = futures_util::future::join_all(submissions).await;
    let created = |answer: &Result<Submitted, StoreError>| matches!(answer, Ok(Submitted::Created(row)) if row.labels == labels);
    assert!(answers.iter().all(created));
}

async fn a_change_is_seen_by_the_next_read(fixture: Fixture) {
    let row = fixture.submit().await;
    assert_eq!(fixture.status(row.id).await, Status::Queued);
    fixture.begin(row.id).await;
    assert_eq!(fixture.status(row.id).await, Status::Running);
    let asked = fixture.store.jobs().cancel(row.id).await.expect("a wish");
    let shown = fixture
        .store
        .jobs()
        .find(row.id)
        .await
        .expect("a read")
        .expect("a job");
    assert!(matches!(asked, Control::Accepted(asked) if *asked == *shown));
}

async fn a_write_that_fails_harms_none_of_its_group(fixture: Fixture) {
    let row = fixture.submit().await;
    let broken = fixture.store.database().writer.write(|tx| {
        Box::pin(async move {
            database::query("insert into idempotency values ('half', '', '')")
                .execute(&mut **tx)
                .await?;
            database::query("insert into results values ('nobody', '')")
                .execute(&mut **tx)
                .await?;
            Ok(())
        })
    });
    let (broken, good) = tokio::join!(broken, fixture.store.submissions().submit(job(None)));
    assert!(matches!(broken, Err(StoreError::Database(_))));
    let Ok(Submitted::Created(good)) = good else {
        panic!("not created");
    };
    let half: i64 = database::query_scalar("select count(*) from idempotency")
        .fetch_one(fixture.store.readers())
        .await
        .expect("a count");
    assert_eq!(half, 0);
    let listed = fixture
        .store
        .jobs()
        .list(&JobFilter {
            limit: 10,
            ..JobFilter::default()
        })
        .await
        .expect("a list");
    let listed: Vec<JobId> = listed.rows.iter().map(|row| row.id).collect();
    assert_eq!(listed, [good.id, row.id]);
}

async fn pages_cover_the_list_once_newest_first(fixture: Fixture) {
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
        let page = fixture.store.jobs().list(&filter).await.expect("a page");
        seen.extend(page.rows.iter().map(|row| row.id));
        match page.next {
            Some(last) => filter.before = Some(last),
            None => break,
        }
    }
    assert_eq!(seen, expected);
}

async fn lists_are_newest_first_after_the_clock_was_set_back_and_the_server_started_again(
    fixture: Fixture,
) {
    let before = fixture.submit().await.id;
    // A job of the days when the clock was ahead.
    let pool = &fixture.store.database().writer_pool;
    database::query(
        "insert into jobs (id, name, labels, model, spec, status, queue_entry, last_event, created_at) \
         select 'job_0fffffffffff7d8e9f00112233445566', name, labels, model, spec, status, queue_entry, \
         last_event, created_at from jobs",
    )
    .execute(pool)
    .await
    .expect("a job");
    let ahead: JobId = "job_0fffffffffff7d8e9f00112233445566"
        .parse()
        .expect("an identifier");
    let fixture = fixture.reopen().await;
    let first = fixture.submit().await.id;
    let second = fixture.submit().await.id;
    let filter = JobFilter {
        limit: 10,
        ..JobFilter::default()
    };
    let listed = fixture.store.jobs().list(&filter).await.expect("a list");
    let listed: Vec<JobId> = listed.rows.iter().map(|row| row.id).collect();
    assert_eq!(listed, [second, first, ahead, before]);
}

async fn lists_are_narrowed_by_state_and_label(fixture: Fixture) {
    let queued = fixture.submit().await.id;
    let running = fixture.submit().await.id;
    fixture.begin(running).await;
    let list = |status, label: Option<(&str, Option<&str>)>| {
        let filter = JobFilter {
            project: Default::default(),
            status,
            label: label.map(|(label, value)| (label.to_owned(), value.map(str::to_owned))),
            limit: 10,
            ..JobFilter::default()
        };
        let store = fixture.store.clone();
        async move {
            let page = store.jobs().list(&filter).await.expect("a page");
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

async fn a_queued_job_is_cancelled_and_paused_at_once(fixture: Fixture) {
    let id = fixture.submit().await.id;
    fixture.store.jobs().pause(id).await.expect("a wish");
    assert_eq!(fixture.status(id).await, Status::Paused);
    fixture.store.jobs().resume(id).await.expect("a wish");
    assert_eq!(fixture.status(id).await, Status::Queued);
    fixture.store.jobs().cancel(id).await.expect("a wish");
    fixture.store.jobs().cancel(id).await.expect("a wish");
    let events = fixture.events(id).await;
    assert_eq!(ids(&events), [1, 2, 3, 4, 5]);
    assert!(events[4].is_last());
    let resumed = fixture.store.jobs().resume(id).await.expect("a wish");
    assert_eq!(resumed, Control::Refused(Status::Cancelled));
}

async fn a_running_job_is_asked_and_a_pause_can_be_taken_back(fixture: Fixture) {
    let id = fixture.submit().await.id;
    fixture.begin(id).await;
    fixture.store.jobs().pause(id).await.expect("a wish");
    assert_eq!(
        fixture.store.jobs().stop_requests().await.expect("a read"),
        [id]
    );
    let changes = fixture.changes.lock().expect("unpoisoned").clone();
    assert!(changes.contains(&Change::StopRequested(id)));
    fixture.store.jobs().resume(id).await.expect("a wish");
    assert!(
        fixture
            .store
            .jobs()
            .stop_requests()
            .await
            .expect("a read")
            .is_empty()
    );
    assert_eq!(fixture.status(id).await, Status::Running);
}

async fn the_estimate_of_a_paused_job_outlives_its_cancellation(fixture: Fixture) {
    let id = fixture.submit().await.id;
    let slice = fixture.begin(id).await;
    fixture.store.jobs().pause(id).await.expect("a wish");
    assert_eq!(fixture.finish(&slice, Status::Paused).await, Hold::Kept);
    fixture.store.jobs().cancel(id).await.expect("a wish");
    let result = fixture.store.results().find(id).await.expect("a read");
    let cancelled = columns::json(&outcome(StopReason::Cancelled));
    assert_eq!(result.map(StoredResult::into_json), Some(cancelled));
}

async fn an_unfinished_job_is_not_deleted(fixture: Fixture) {
    let id = fixture.submit().await.id;
    let removal = fixture.store.jobs().delete(id).await;
    assert_eq!(
        removal.expect("a removal"),
        JobRemoval::Unfinished(Status::Queued)
    );
    let unknown = fixture.store.jobs().delete(JobId::new()).await;
    assert_eq!(unknown.expect("a removal"), JobRemoval::NotFound);
}
