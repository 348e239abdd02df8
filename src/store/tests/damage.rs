//! Rows that are changed behind the store's back: each is found when it is read and by `check`, and named.

use super::*;
use crate::access::{Digest, Scope, Secret};
use crate::job::WebhookId;
use crate::store::backup as file;
use crate::store::database::QueryBuilder;
use crate::store::sealed::check::{Checked, look, seal_all};
use crate::store::sealed::{Column, Sealed, sealed_tables};

on_both! {
    a_changed_recording_is_found_when_it_is_read,
    a_changed_job_fails_and_can_be_removed,
    a_changed_checkpoint_is_not_used_and_the_job_goes_back,
    changed_results_events_generations_and_candidates_are_found_when_they_are_read,
    a_changed_token_is_found_when_it_is_used,
    a_job_ends_where_a_webhook_is_damaged,
    a_damaged_delivery_is_not_made_and_holds_up_no_other,
    what_an_older_server_writes_is_sealed_by_the_next_transaction,
    a_changed_number_in_the_queue_keeps_no_job_out,
    rows_in_each_others_place_are_found,
    changes_of_any_column_are_found_by_check,
    rows_without_a_seal_are_counted_until_they_are_sealed,
}

/// Does something to the rows of the database that neither the store nor a trigger knows of.
async fn harm(fixture: &Fixture, statement: &'static str) {
    below(fixture, QueryBuilder::new(statement))
        .await
        .expect("a change");
}

async fn below(fixture: &Fixture, statement: QueryBuilder) -> Result<(), sqlx::Error> {
    let pool = &fixture.store.database().writer_pool;
    let mut tx = pool.begin_write().await?;
    let triggers: Vec<(String, String)> = match tx.kind() {
        Kind::Postgres => {
            database::query("set local session_replication_role = replica")
                .execute(&mut tx)
                .await?;
            Vec::new()
        }
        Kind::Sqlite => {
            database::query_as("select name, sql from sqlite_master where type = 'trigger'")
                .fetch_all(&mut tx)
                .await?
        }
    };
    for (name, _) in &triggers {
        let drop = QueryBuilder::new(&format!("drop trigger {name}"));
        drop.build().execute(&mut tx).await?;
    }
    statement.build().execute(&mut tx).await?;
    for (_, sql) in &triggers {
        QueryBuilder::new(sql).build().execute(&mut tx).await?;
    }
    tx.commit().await
}

async fn looked(fixture: &Fixture) -> Checked {
    let mut checked = Checked::default();
    look(fixture.store.readers(), &mut checked)
        .await
        .expect("a look");
    checked
}

fn is_damage<T>(read: Result<T, StoreError>, what: &str) {
    match read {
        Err(error) => assert_eq!(error.corrupt_row().expect("a row").0, what, "{error}"),
        Ok(_) => panic!("a damaged {what} is read"),
    }
}

/// A job that has left something of each kind, before its end.
async fn at_work(fixture: &Fixture) -> Slice {
    let id = fixture.submit().await.id;
    let slice = fixture.begin(id).await;
    let record = Record {
        generations: (1..=3).map(generation).collect(),
        events: vec![Event::Generation(generation(1))],
        checkpoint: Some(Checkpoint {
            state: b"state".to_vec(),
            refinements: 2,
        }),
        parts: vec![SharedPart {
            name: "refit 1".to_owned(),
            part: "{}".to_owned(),
        }],
        ..candidates::record(vec![candidates::candidate(1, 0)], 1, None)
    };
    let hold = fixture.store.slices().record(slice.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    slice
}

async fn a_changed_recording_is_found_when_it_is_read(fixture: Fixture) {
    let (row, _) = datasets::insert(&fixture, "sha256:1").await;
    let kind = fixture.store.readers().kind();
    harm(
        &fixture,
        kind.either(
            "update dataset_chunks set samples = cast(x'01' || substr(samples, 2) as blob) where position = 2",
            "update dataset_chunks set samples = set_byte(samples, 0, 1) where position = 2",
        ),
    )
    .await;
    is_damage(
        fixture.store.datasets().recording(row.id).await,
        "part of the samples",
    );
    assert_eq!(looked(&fixture).await.findings.len(), 1);
    harm(
        &fixture,
        "update datasets set summary = replace(summary, 'bar', 'Bar')",
    )
    .await;
    let fixture = fixture.reopen().await;
    is_damage(fixture.store.datasets().find(row.id).await, "description");
    is_damage(
        fixture.store.datasets().recording(row.id).await,
        "description",
    );
}

async fn a_changed_job_fails_and_can_be_removed(fixture: Fixture) {
    let id = fixture.submit().await.id;
    harm(&fixture, "update jobs set spec = replace(spec, '1', '2')").await;
    let begun = fixture.store.slices().begin(id, None, 5).await;
    assert!(matches!(begun, Ok(Begin::Ended)), "{begun:?}");
    assert_eq!(fixture.store.damage().seen().rows, 1);
    let events = fixture.events(id).await;
    assert_eq!(names(&events), ["state", "state", "end"]);
    let fixture = fixture.reopen().await;
    is_damage(fixture.store.jobs().find(id).await, "specification");
    let removed = fixture.store.jobs().delete(id).await;
    assert_eq!(removed.expect("an answer"), JobRemoval::Removed);
}

async fn a_changed_checkpoint_is_not_used_and_the_job_goes_back(fixture: Fixture) {
    let slice = at_work(&fixture).await;
    harm(&fixture, "update checkpoints set refinements = 3").await;
    is_damage(
        fixture.store.checkpoints().find(slice.lease.job).await,
        "checkpoint",
    );
    let next = fixture.begin(slice.lease.job).await;
    assert_eq!(next.checkpoint, None);
    assert_eq!(fixture.store.damage().seen().rows, 1);
}

async fn changed_results_events_generations_and_candidates_are_found_when_they_are_read(
    fixture: Fixture,
) {
    let slice = at_work(&fixture).await;
    let id = slice.lease.job;
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    assert_eq!(looked(&fixture).await, Checked::default());
    harm(
        &fixture,
        "update results set outcome = replace(outcome, 'limit', 'Limit')",
    )
    .await;
    harm(
        &fixture,
        "update events set data = replace(data, 'queued', 'paused') where id = 1",
    )
    .await;
    harm(
        &fixture,
        "update generations set row = replace(row, '400', '401') where generation = 2",
    )
    .await;
    harm(&fixture, "update candidate_records set kept = kept + 1").await;
    let store = &fixture.store;
    is_damage(store.results().find(id).await, "result");
    is_damage(store.events().after(id, 0, 10).await, "event");
    assert!(store.events().after(id, 1, 10).await.is_ok());
    is_damage(store.generations().after(id, 0, 10).await, "generation");
    assert_eq!(
        store
            .generations()
            .after(id, 2, 10)
            .await
            .expect("rows")
            .len(),
        1
    );
    is_damage(
        store.candidates().page(id, 0, 10, 10).await,
        "list of candidates",
    );
    assert_eq!(looked(&fixture).await.findings.len(), 4);
}

async fn rows_in_each_others_place_are_found(fixture: Fixture) {
    let slice = at_work(&fixture).await;
    harm(
        &fixture,
        "update generations set generation = 7 - generation where generation > 2",
    )
    .await;
    let read = fixture
        .store
        .generations()
        .after(slice.lease.job, 0, 10)
        .await;
    is_damage(read, "generation");
    assert_eq!(looked(&fixture).await.findings.len(), 1);
}

/// A statement that changes a column of all rows of a table.
fn change(kind: Kind, table: &Sealed, column: Column) -> QueryBuilder {
    let name = column.name();
    let changed = match column {
        Column::Text(_) => format!("coalesce(\"{name}\", '') || ' '"),
        Column::Integer(_) | Column::Real(_) => format!("coalesce(\"{name}\", 0) + 1"),
        Column::Bytes(_) => kind.either(
            format!("cast(\"{name}\" || x'01' as blob)"),
            format!("\"{name}\" || '\\x01'::bytea"),
        ),
    };
    let mut update = QueryBuilder::new("update ");
    update.push(format_args!("{} set \"{name}\" = {changed}", table.table));
    update
}

/// A token for the whole of a project. Gives the digest of its secret.
async fn token(fixture: &Fixture) -> Digest {
    let digest = Secret::new().expect("random bytes").digest();
    let new = tokens::NewToken {
        name: "operator".to_owned(),
        digest: digest.clone(),
        scope: Scope::Submit,
        streams: None,
        project: "hall-2".parse().expect("a name"),
        expires_at: None,
    };
    let made = tokens::create(&fixture.settings.place, new).await;
    assert!(made.expect("a token"));
    digest
}

async fn a_changed_token_is_found_when_it_is_used(fixture: Fixture) {
    let digest = token(&fixture).await;
    let row = fixture.store.tokens().find(&digest).await.expect("a read");
    assert_eq!(row.expect("a token").name, "operator");
    harm(&fixture, "update tokens set project = 'hall-3'").await;
    is_damage(fixture.store.tokens().find(&digest).await, "token");
    assert_eq!(looked(&fixture).await.findings.len(), 1);
}

/// A webhook that is told of the ends of jobs.
async fn webhook(fixture: &Fixture) -> WebhookId {
    let webhook = WebhookRow {
        id: WebhookId::new(),
        project: Project::default(),
        url: "https://mes.plant.example/greybox".to_owned(),
        events: vec!["job.ended".to_owned()],
        secret: "whsec_1".to_owned(),
        created_at: jiff::Timestamp::now(),
    };
    let id = webhook.id;
    let made = fixture.store.webhooks().insert(webhook).await;
    assert!(made.expect("a write"));
    id
}

async fn a_damaged_delivery_is_not_made_and_holds_up_no_other(fixture: Fixture) {
    webhook(&fixture).await;
    for _ in 0..2 {
        let slice = at_work(&fixture).await;
        assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    }
    let deliveries = fixture.store.deliveries();
    let now = jiff::Timestamp::now();
    let (due, _) = deliveries.due(now).await.expect("a look");
    assert_eq!(due.len(), 1);
    harm(
        &fixture,
        "update deliveries set payload = replace(payload, 'succeeded', 'failed') \
         where id = (select min(id) from deliveries)",
    )
    .await;
    let (next, _) = deliveries.due(now).await.expect("a look");
    assert_eq!(next.len(), 1);
    assert_ne!(next[0].id, due[0].id);
    is_damage(deliveries.find(due[0].id).await, "delivery");
    assert_eq!(fixture.store.damage().seen().rows, 1);
}

async fn a_changed_number_in_the_queue_keeps_no_job_out(fixture: Fixture) {
    fixture.submit().await;
    harm(&fixture, "update river_job set id = id + 1").await;
    let submissions = fixture.store.submissions();
    // Where the database has counted on without looking, the next number is taken.
    if let Err(error) = submissions.submit(job(None)).await {
        is_damage(Err::<(), _>(error), "entry of the queue");
    }
    let submitted = submissions.submit(job(None)).await;
    assert!(
        matches!(submitted, Ok(Submitted::Created(_))),
        "{submitted:?}"
    );
}

async fn what_an_older_server_writes_is_sealed_by_the_next_transaction(fixture: Fixture) {
    let slice = at_work(&fixture).await;
    // A trigger takes the seal away, and no writer of this store seals the row.
    let pool = &fixture.store.database().writer_pool;
    let mut tx = pool.begin_write().await.expect("a transaction");
    database::query("update jobs set running_ms = running_ms + 1")
        .execute(&mut tx)
        .await
        .expect("a change");
    tx.commit().await.expect("a change");
    assert_eq!(looked(&fixture).await.unsealed, 1);
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    assert_eq!(looked(&fixture).await, Checked::default());
}

async fn a_job_ends_where_a_webhook_is_damaged(fixture: Fixture) {
    webhook(&fixture).await;
    let slice = at_work(&fixture).await;
    harm(&fixture, "update webhooks set events = '['").await;
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    let row = fixture.store.jobs().find(slice.lease.job).await;
    assert_eq!(
        row.expect("a read").expect("a job").status,
        Status::Succeeded
    );
}

async fn changes_of_any_column_are_found_by_check(fixture: Fixture) {
    token(&fixture).await;
    webhook(&fixture).await;
    let slice = at_work(&fixture).await;
    assert_eq!(fixture.begin(slice.lease.job).await.job.attempt, 1);
    let ended = at_work(&fixture).await;
    assert_eq!(fixture.finish(&ended, Status::Succeeded).await, Hold::Kept);
    datasets::insert(&fixture, "sha256:1").await;
    growth::append(&fixture, growth::batch(0, "key")).await;
    let compared = comparisons::comparison(Some(("compared", "1")));
    let compared = fixture.store.comparisons().submit(compared).await;
    assert!(matches!(compared, Ok(Submitted::Created(_))));
    let person = NewHolder::Person(PersonRow {
        name: "operator".to_owned(),
        groups: Vec::new(),
    });
    let secret = Secret::new().expect("random bytes").digest();
    let session = fixture
        .store
        .sessions()
        .begin(person, secret, jiff::Timestamp::MAX);
    session.await.expect("a session");
    let sound = looked(&fixture).await;
    assert_eq!((sound.findings.len(), sound.unsealed), (0, 0));
    let kind = fixture.store.readers().kind();
    for table in sealed_tables() {
        for column in table.content {
            let mut count = QueryBuilder::new("select count(*) from ");
            count.push(table.table);
            let rows: i64 = count
                .build_query_scalar()
                .fetch_one(fixture.store.readers())
                .await
                .expect("a count");
            // A column with a rule of its own, as one that has to be JSON, may refuse the change.
            if below(&fixture, change(kind, table, *column)).await.is_err() {
                continue;
            }
            let (name, column) = (table.table, column.name());
            assert!(damaged(&fixture).await >= rows.min(1), "{name}.{column}");
            seal_again(&fixture).await;
            assert_eq!(damaged(&fixture).await, 0, "{name}.{column}");
        }
    }
}

/// How many rows are not what was written.
async fn damaged(fixture: &Fixture) -> i64 {
    let findings = looked(fixture).await.findings;
    let rows = findings
        .iter()
        .filter(|finding| finding.starts_with("the stored"));
    rows.count() as i64
}

/// Takes all rows as they are for what was written.
async fn seal_again(fixture: &Fixture) {
    for table in sealed_tables() {
        let mut update = QueryBuilder::new("update ");
        update.push(format_args!("{} set {} = null", table.table, table.seal));
        let pool = &fixture.store.database().writer_pool;
        let mut tx = pool.begin_write().await.expect("a transaction");
        update.build().execute(&mut tx).await.expect("a change");
        tx.commit().await.expect("a change");
    }
    seal_all(&fixture.store.database().writer_pool)
        .await
        .expect("seals");
}

async fn rows_without_a_seal_are_counted_until_they_are_sealed(fixture: Fixture) {
    let slice = at_work(&fixture).await;
    harm(&fixture, "update generations set seal = null").await;
    assert_eq!(looked(&fixture).await.unsealed, 3);
    let rows = fixture
        .store
        .generations()
        .after(slice.lease.job, 0, 10)
        .await;
    assert_eq!(rows.expect("rows").len(), 3);
    let sealed = seal_all(&fixture.store.database().writer_pool).await;
    assert_eq!(sealed.expect("seals"), 3);
    assert_eq!(looked(&fixture).await, Checked::default());
}

#[tokio::test]
async fn check_names_a_damaged_row_of_a_file() {
    let fixture = Fixture::new().await;
    let id = fixture.submit().await.id;
    harm(&fixture, "update events set data = replace(data, 'q', 'k')").await;
    let checked = file::check(fixture.file()).await.expect("a readable file");
    let told = format!("the stored event of {id} 1 does not read back: it is not what was written");
    assert_eq!(checked.findings, [told]);
}
