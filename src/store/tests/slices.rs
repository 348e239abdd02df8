//! What workers write: slices, fences, checkpoints and ends.

use super::*;

on_both! {
    a_job_survives_the_server_that_took_it,
    a_write_with_an_old_epoch_changes_nothing,
    a_slice_goes_on_where_the_last_one_stopped,
    a_job_that_five_lives_of_the_server_end_with_fails,
    a_life_that_is_cut_off_without_a_job_clears_it,
    slices_that_come_to_nothing_in_a_life_that_goes_on_are_not_held_against_their_job,
    a_job_that_many_lives_ended_with_waits_for_the_server_to_have_been_up,
    the_end_of_a_job_is_told_with_its_result,
    only_the_newest_queue_entry_begins_a_slice,
    entries_that_a_dead_server_left_running_are_available_at_once,
    events_are_replayed_from_any_id,
}

async fn a_job_survives_the_server_that_took_it(fixture: Fixture) {
    let row = fixture.submit().await;
    let slice = fixture.begin(row.id).await;
    let fixture = fixture.reopen().await;
    assert_eq!(fixture.status(row.id).await, Status::Running);
    let next = fixture.begin(row.id).await;
    assert_eq!(next.job.attempt, 2);
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Lost);
    assert_eq!(fixture.finish(&next, Status::Succeeded).await, Hold::Kept);
}

async fn a_write_with_an_old_epoch_changes_nothing(fixture: Fixture) {
    let id = fixture.submit().await.id;
    let old = fixture.begin(id).await;
    let new = fixture.begin(id).await;
    let before = fixture.store.jobs().find(id).await.expect("a read");
    let record = Record {
        generations: vec![generation(1)],
        events: vec![Event::Generation(generation(1))],
        checkpoint: Some(Checkpoint {
            state: vec![1],
            refinements: 0,
        }),
        worked_ms: 5,
        ..Record::default()
    };
    let hold = fixture
        .store
        .slices()
        .record(old.lease, record.clone())
        .await;
    assert_eq!(hold.expect("a write"), Hold::Lost);
    assert_eq!(fixture.finish(&old, Status::Failed).await, Hold::Lost);
    assert_eq!(fixture.store.jobs().find(id).await.expect("a read"), before);
    assert_eq!(fixture.events(id).await.len(), 2);
    assert!(
        fixture
            .store
            .generations()
            .after(id, 0, 10)
            .await
            .expect("rows")
            .is_empty()
    );
    let hold = fixture.store.slices().record(new.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    assert_eq!(fixture.events(id).await.len(), 3);
}

async fn a_slice_goes_on_where_the_last_one_stopped(fixture: Fixture) {
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
    let reported = Reported {
        generation: 2,
        refinements: 0,
        at_ms: 77,
    };
    let record = Record {
        generations: (1..=3).map(generation).collect(),
        candidates: None,
        events: vec![Event::Generation(generation(2))],
        reported,
        progress: Some(progress.clone()),
        checkpoint: Some(Checkpoint {
            state: b"state".to_vec(),
            refinements: 2,
        }),
        worked_ms: 40,
        ..Record::default()
    };
    let hold = fixture.store.slices().record(first.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    let second = fixture.begin(id).await;
    let checkpoint = second.checkpoint.expect("a checkpoint");
    assert_eq!(
        (&*checkpoint.state, checkpoint.refinements),
        (&b"state"[..], 2)
    );
    assert_eq!((second.running_ms, second.reported), (40, reported));
    assert_eq!(second.unreported, Some(generation(3)));
    assert_eq!(second.job.progress, Some(progress));
    assert_eq!(second.job.attempt, 1);
}

async fn a_job_that_five_lives_of_the_server_end_with_fails(mut fixture: Fixture) {
    let id = fixture.submit().await.id;
    for attempt in 1..=5 {
        assert_eq!(fixture.begin(id).await.job.attempt, attempt);
        fixture = fixture.cut_off().await;
    }
    let sixth = fixture.store.slices().begin(id, None, 5).await;
    assert!(matches!(sixth, Ok(Begin::Ended)));
    let row = fixture
        .store
        .jobs()
        .find(id)
        .await
        .expect("a read")
        .expect("a job");
    assert_eq!((row.status, row.attempt), (Status::Failed, 5));
    assert_eq!(row.error, Some(Failure::crashed_too_often(5)));
    assert_eq!(
        names(&fixture.events(id).await),
        ["state", "state", "state", "end"]
    );
}

async fn a_life_that_is_cut_off_without_a_job_clears_it(mut fixture: Fixture) {
    let id = fixture.submit().await.id;
    for life in 0..30 {
        if life % 5 != 4 {
            fixture.begin(id).await;
        }
        fixture = fixture.cut_off().await;
    }
    fixture.begin(id).await;
}

async fn slices_that_come_to_nothing_in_a_life_that_goes_on_are_not_held_against_their_job(
    fixture: Fixture,
) {
    let id = fixture.submit().await.id;
    for _ in 0..20 {
        fixture.begin(id).await;
    }
    let fixture = fixture.reopen().await;
    let row = fixture.begin(id).await.job;
    assert_eq!((row.status, row.attempt), (Status::Running, 21));
}

async fn a_job_that_many_lives_ended_with_waits_for_the_server_to_have_been_up(
    mut fixture: Fixture,
) {
    let id = fixture.submit().await.id;
    for _ in 0..9 {
        assert!(matches!(
            fixture.store.slices().begin(id, None, 20).await,
            Ok(Begin::Slice(_))
        ));
        fixture = fixture.cut_off().await;
    }
    let entry: i64 = database::query_scalar("select queue_entry from jobs")
        .fetch_one(fixture.store.readers())
        .await
        .expect("an entry");
    // A minute, after nine.
    let soon = fixture.store.slices().begin(id, Some(entry), 20).await;
    assert!(matches!(soon, Ok(Begin::NotYet)), "{soon:?}");
    // Whoever wants to stop it does not wait.
    fixture.store.jobs().cancel(id).await.expect("a wish");
    let stop = fixture.store.slices().begin(id, None, 20).await;
    assert!(matches!(stop, Ok(Begin::Slice(_))), "{stop:?}");
}

async fn the_end_of_a_job_is_told_with_its_result(fixture: Fixture) {
    let id = fixture.submit().await.id;
    let slice = fixture.begin(id).await;
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    assert_eq!(fixture.finish(&slice, Status::Failed).await, Hold::Lost);
    let events = fixture.events(id).await;
    assert_eq!(ids(&events), [1, 2, 3, 4, 5]);
    assert_eq!(names(&events), ["state", "state", "result", "state", "end"]);
    assert!(events[4].is_last());
    let result = fixture.store.results().find(id).await.expect("a read");
    let written = columns::json(&outcome(StopReason::GenerationLimit));
    assert_eq!(result.map(StoredResult::into_json), Some(written));
    let begun = fixture.store.slices().begin(id, None, 5).await;
    assert!(matches!(begun, Ok(Begin::Nothing)));
}

async fn only_the_newest_queue_entry_begins_a_slice(fixture: Fixture) {
    let id = fixture.submit().await.id;
    let entry = async || -> i64 {
        database::query_scalar("select queue_entry from jobs")
            .fetch_one(fixture.store.readers())
            .await
            .expect("an entry")
    };
    let first = entry().await;
    fixture.store.jobs().pause(id).await.expect("a wish");
    fixture.store.jobs().resume(id).await.expect("a wish");
    let second = entry().await;
    assert_ne!(first, second);
    let stale = fixture.store.slices().begin(id, Some(first), 5).await;
    assert!(matches!(stale, Ok(Begin::Nothing)));
    let fresh = fixture.store.slices().begin(id, Some(second), 5).await;
    assert!(matches!(fresh, Ok(Begin::Slice(_))));
}

async fn execute(tx: &mut writer::Tx, statement: &'static str) -> Result<(), StoreError> {
    database::query(statement).execute(&mut **tx).await?;
    Ok(())
}

async fn entries_that_a_dead_server_left_running_are_available_at_once(fixture: Fixture) {
    fixture.submit().await;
    let lost = fixture.submit().await;
    for statement in [
        "update river_job set state = 'running', attempt = 1",
        "delete from river_job where id = (select max(id) from river_job)",
    ] {
        fixture
            .store
            .database()
            .writer
            .write(move |tx| Box::pin(execute(tx, statement)))
            .await
            .expect("a broken queue");
    }
    let fixture = fixture.reopen().await;
    let entries: Vec<(String, String)> = database::query_as(
        "select jobs.id, cast(river_job.state as text) from jobs join river_job on river_job.id = queue_entry \
         order by jobs.id",
    )
    .fetch_all(fixture.store.readers())
    .await
    .expect("entries");
    assert_eq!(entries.len(), 2);
    assert!(entries.iter().all(|(_, state)| state == "available"));
    assert_eq!(entries[1].0, lost.id.to_string());
}

async fn events_are_replayed_from_any_id(fixture: Fixture) {
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
    let hold = fixture.store.slices().record(slice.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    let mut seen = Vec::new();
    loop {
        let after = seen.last().copied().unwrap_or(0);
        let page = fixture
            .store
            .events()
            .after(id, after, 700)
            .await
            .expect("a page");
        if page.is_empty() {
            break;
        }
        seen.extend(ids(&page));
    }
    assert_eq!(seen, (1..=2502).collect::<Vec<i64>>());
}
