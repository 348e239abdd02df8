//! From a file to a PostgreSQL and back.

use super::super::database_copy::{self, CopiedTable, TABLES};
use super::*;
use crate::store::tokens::{self, NewToken};

/// Tables that are not copied: who worked with the database, what the queue and the migrations keep, and
/// what is found or counted again.
const NOT_COPIED: [&str; 6] = [
    "_sqlx_migrations",
    "job_bytes",
    "nodes",
    "shared_parts",
    "stored_bytes",
    "write_probes",
];

fn is_copied(table: &str) -> bool {
    let is_own = !table.starts_with("sqlite_") && !table.starts_with("river_");
    is_own && !NOT_COPIED.contains(&table)
}

/// A file with something of most kinds, one job at work in it.
async fn filled() -> (Fixture, JobId) {
    let fixture = Fixture::new().await;
    let ended = fixture.submit().await.id;
    let slice = fixture.begin(ended).await;
    let candidates = candidates::record(vec![candidates::candidate(1, 0)], 1, None);
    let hold = fixture.store.slices().record(slice.lease, candidates).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    assert_eq!(fixture.finish(&slice, Status::Succeeded).await, Hold::Kept);
    datasets::insert(&fixture, "sha256:1").await;
    let at_work = fixture
        .store
        .submissions()
        .submit(job(Some(("key", "digest"))))
        .await;
    let Ok(Submitted::Created(at_work)) = at_work else {
        panic!("not created: {at_work:?}");
    };
    let slice = fixture.begin(at_work.id).await;
    let record = Record {
        generations: (1..=300).map(generation).collect(),
        events: vec![Event::Generation(generation(300))],
        checkpoint: Some(Checkpoint {
            state: vec![0, 255, 7],
            refinements: 2,
        }),
        ..Record::default()
    };
    let hold = fixture.store.slices().record(slice.lease, record).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    let token = NewToken {
        name: "historian".to_owned(),
        digest: crate::access::Secret::new().expect("random bytes").digest(),
        scope: crate::access::Scope::Submit,
        streams: None,
        project: Default::default(),
        expires_at: None,
    };
    let made = tokens::create(&fixture.settings.place, token).await;
    assert!(made.expect("a token"));
    (fixture, at_work.id)
}

/// What is left of a database whose server has ended.
async fn ended(fixture: Fixture) -> (DatabaseSettings, tempfile::TempDir) {
    fixture.store.close().await;
    (fixture.settings, fixture._folder)
}

fn file(folder: &tempfile::TempDir) -> DatabasePlace {
    DatabasePlace::File(folder.path().join("copy.db"))
}

fn postgres() -> Option<DatabasePlace> {
    let options = cluster::new_database()?.parse().expect("an address");
    Some(DatabasePlace::Postgres(Box::new(options)))
}

/// How many entries of the queue a job has.
async fn entries_of(store: &Store, job: JobId) -> i64 {
    database::query_scalar(
        "select count(*) from jobs join river_job on river_job.id = queue_entry where jobs.id = $1",
    )
    .bind(job.to_string())
    .fetch_one(store.readers())
    .await
    .expect("a count")
}

#[tokio::test]
async fn a_file_moves_to_postgresql_and_back_and_its_jobs_go_on() {
    let Some(there) = postgres() else {
        return;
    };
    let (fixture, at_work) = filled().await;
    let events = fixture.events(at_work).await;
    let row = fixture.store.jobs().find(at_work).await.expect("a read");
    let stored = fixture.store.figures().await.expect("figures").stored;
    let (settings, _folder) = ended(fixture).await;
    let copied = database_copy::copy(&settings.place, &there)
        .await
        .expect("a copy");
    let rows = |name: &str| {
        copied
            .iter()
            .find(|table| table.name == name)
            .map(|table| table.rows)
    };
    assert_eq!(
        (rows("jobs"), rows("generations"), rows("tokens")),
        (Some(2), Some(300), Some(1))
    );

    let again = database_copy::copy(&settings.place, &there).await;
    assert!(matches!(again, Err(StoreError::NotEmpty(_))), "{again:?}");

    let at = |place: DatabasePlace| DatabaseSettings {
        place,
        ..settings.clone()
    };
    let store = open(&at(there.clone()), &Arc::default()).await;
    let counted = store.figures().await.expect("figures").stored;
    assert_eq!(counted, stored);
    assert_eq!(store.jobs().find(at_work).await.expect("a read"), row);
    let copied_events = store.events().after(at_work, 0, 1000).await;
    assert_eq!(copied_events.expect("events"), events);
    assert_eq!(entries_of(&store, at_work).await, 1);
    let in_use = database_copy::copy(&there, &settings.place).await;
    assert!(
        matches!(in_use, Err(StoreError::Locked { .. })),
        "{in_use:?}"
    );
    store.close().await;

    let folder = tempfile::tempdir().expect("a folder");
    let back = database_copy::copy(&there, &file(&folder))
        .await
        .expect("a copy");
    assert_eq!(back, copied);
    let store = open(&at(file(&folder)), &Arc::default()).await;
    let counted = store.figures().await.expect("figures").stored;
    assert_eq!(counted, stored);
    let begun = store
        .slices()
        .begin(at_work, None, 5)
        .await
        .expect("a slice");
    let Begin::Slice(slice) = begun else {
        panic!("not begun: {begun:?}");
    };
    let checkpoint = slice.checkpoint.expect("its checkpoint");
    assert_eq!(
        (checkpoint.state, checkpoint.refinements),
        (vec![0, 255, 7], 2)
    );
    store.close().await;
}

#[tokio::test]
async fn a_file_is_not_copied_to_a_file() {
    let (fixture, _) = filled().await;
    let (settings, _folder) = ended(fixture).await;
    let folder = tempfile::tempdir().expect("a folder");
    let copied: Result<Vec<CopiedTable>, _> =
        database_copy::copy(&settings.place, &file(&folder)).await;
    assert!(matches!(copied, Err(StoreError::SameKind)), "{copied:?}");
}

#[tokio::test]
async fn every_table_is_copied_or_left_on_purpose() {
    let fixture = Fixture::new().await;
    let mut tables: Vec<String> =
        database::query_scalar("select name from sqlite_master where type = 'table'")
            .fetch_all(fixture.store.readers())
            .await
            .expect("tables");
    tables.retain(|table| is_copied(table));
    tables.sort();
    let mut copied = TABLES.map(str::to_owned);
    copied.sort();
    assert_eq!(tables, copied);
}
