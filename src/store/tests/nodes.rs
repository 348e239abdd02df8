//! Several servers on one PostgreSQL.

use std::time::Instant;

use super::*;

/// How long it may take until a node is told of something or found dead.
const PATIENCE: Duration = Duration::from_secs(20);

/// One more server on the same database.
async fn another(fixture: &Fixture) -> (Store, Arc<Mutex<Vec<Change>>>) {
    let changes = Arc::new(Mutex::new(Vec::new()));
    (open(&fixture.settings, &changes).await, changes)
}

impl Fixture {
    /// Has the queue know all slices as at work in the first node.
    async fn is_worked_by_node_1(&self) {
        let work = async |tx: &mut Tx| {
            database::query(
                "update river_job set state = 'running', attempt = 1, attempted_at = now(), \
                 attempted_by = array['greybox-1']",
            )
            .execute(&mut **tx)
            .await?;
            Ok(())
        };
        let writer = &self.store.database().writer;
        let worked = writer.write(move |tx| Box::pin(async move { work(tx).await }));
        worked.await.expect("a write");
    }
}

async fn until(what: &str, mut holds: impl AsyncFnMut() -> bool) {
    let began = Instant::now();
    while !holds().await {
        assert!(began.elapsed() < PATIENCE, "not in time: {what}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

async fn until_heard(changes: &Arc<Mutex<Vec<Change>>>, change: &Change) {
    let heard = async || changes.lock().expect("unpoisoned").contains(change);
    until(&format!("{change:?}"), heard).await;
}

#[tokio::test]
async fn what_one_server_changes_the_others_are_told_and_read() {
    let Some(fixture) = Fixture::on_postgres().await else {
        return;
    };
    let (other, changes) = another(&fixture).await;
    until_heard(&changes, &Change::Missed).await;
    let row = fixture.submit().await;
    let seen = other.jobs().find(row.id).await.expect("a read");
    assert_eq!(seen.as_deref(), Some(&row));
    until_heard(&changes, &Change::Job(row.id)).await;
    until_heard(&changes, &Change::SliceWaits(Project::default())).await;
    other.jobs().pause(row.id).await.expect("a wish");
    assert_eq!(fixture.status(row.id).await, Status::Paused);
    other.close().await;
}

#[tokio::test]
async fn a_server_that_says_no_more_that_it_lives_writes_nothing_more_and_others_have_its_jobs() {
    let Some(fixture) = Fixture::on_postgres().await else {
        return;
    };
    let id = fixture.submit().await.id;
    let slice = fixture.begin(id).await;
    let (other, changes) = another(&fixture).await;
    assert!(matches!(
        other.slices().begin(id, None, 5).await,
        Ok(Begin::Nothing)
    ));
    assert!(!other.nodes().is_in_charge());
    fixture.is_worked_by_node_1().await;
    fixture.store.nodes().close().await;
    let is_in_charge = async || other.nodes().is_in_charge();
    until("another is in charge", is_in_charge).await;
    let silence_ms: i64 = database::query_scalar("select silence_ms from nodes where life = 1")
        .fetch_one(other.readers())
        .await
        .expect("a silence");
    assert!(silence_ms > 0, "an observer that begins goes on with it");
    let record = fixture
        .store
        .slices()
        .record(slice.lease, Record::default())
        .await;
    let refused = record.expect_err("a node that is dead");
    assert_eq!(refused.meaning(), Meaning::Unavailable, "{refused}");
    assert!(fixture.store.submissions().submit(job(None)).await.is_err());
    until_heard(&changes, &Change::SliceWaits(Project::default())).await;
    let next = other.slices().begin(id, None, 5).await;
    let Ok(Begin::Slice(next)) = next else {
        panic!("not taken over: {next:?}");
    };
    assert!(slice.lease.is_followed_by(next.lease));
    other.close().await;
}

#[tokio::test]
async fn a_server_that_is_declared_dead_learns_of_it() {
    let Some(fixture) = Fixture::on_postgres().await else {
        return;
    };
    let (other, _) = another(&fixture).await;
    let taken_over = async || {
        // Between two of its beats.
        other
            .nodes()
            .take_over_from_all_others()
            .await
            .expect("a takeover");
        let lost = fixture.store.nodes().superseded();
        tokio::time::timeout(Duration::from_millis(200), lost)
            .await
            .is_ok()
    };
    until("the node is dead", taken_over).await;
    other.close().await;
}

#[tokio::test]
async fn servers_that_live_do_not_declare_each_other_dead() {
    let Some(fixture) = Fixture::on_postgres().await else {
        return;
    };
    let (second, _) = another(&fixture).await;
    let (third, _) = another(&fixture).await;
    let all = [&fixture.store, &second, &third];
    // A hundred beats of each.
    for _ in 0..100 {
        tokio::time::sleep(fixture.settings.beat).await;
        for store in all {
            assert!(store.submissions().submit(job(None)).await.is_ok());
        }
    }
    let in_charge = all.map(|store| store.nodes().is_in_charge());
    assert_eq!(in_charge, [true, false, false]);
    second.close().await;
    third.close().await;
}

#[tokio::test]
async fn servers_that_begin_together_on_an_empty_database_all_do() {
    let Some(database) = cluster::new_database() else {
        return;
    };
    let options = database.parse().expect("an address");
    let settings = DatabaseSettings {
        place: DatabasePlace::Postgres(Box::new(options)),
        readers: 1,
        busy_timeout: Duration::from_secs(5),
        beat: Duration::from_millis(200),
        keys: Default::default(),
    };
    let openings = (0..6).map(|_| {
        let settings = settings.clone();
        tokio::spawn(async move { Store::open(&settings, Arc::new(|_| ())).await })
    });
    let openings: Vec<_> = openings.collect();
    let mut stores = Vec::new();
    for opening in openings {
        stores.push(opening.await.expect("a task").expect("a database"));
    }
    let Submitted::Created(row) = stores[0]
        .submissions()
        .submit(job(None))
        .await
        .expect("a submission")
    else {
        panic!("not created");
    };
    for store in stores {
        assert!(store.jobs().find(row.id).await.expect("a read").is_some());
        store.close().await;
    }
}

#[tokio::test]
async fn the_same_key_sent_to_many_servers_makes_one_job() {
    let Some(fixture) = Fixture::on_postgres().await else {
        return;
    };
    let (second, _) = another(&fixture).await;
    let (third, _) = another(&fixture).await;
    let stores = [&fixture.store, &second, &third];
    for round in 0..20 {
        let key = format!("key {round}");
        let submissions = (0..9).map(|i| {
            stores[i % 3]
                .submissions()
                .submit(job(Some((&key, "digest"))))
        });
        let answers = futures_util::future::join_all(submissions).await;
        let made = answers
            .iter()
            .filter(|answer| matches!(answer, Ok(Submitted::Created(_))));
        assert_eq!(made.count(), 1, "{answers:?}");
        let again = answers
            .iter()
            .filter(|answer| matches!(answer, Ok(Submitted::Replayed(_))));
        assert_eq!(again.count(), 8, "{answers:?}");
    }
    second.close().await;
    third.close().await;
}
