//! A disk without room: SQLite's own limit of pages stands for its end.

use super::*;

pub(super) async fn execute(fixture: &Fixture, statement: &'static str) -> Result<(), StoreError> {
    let work = fixture.store.database().writer.write(move |tx| {
        Box::pin(async move {
            database::query(statement).execute(&mut **tx).await?;
            Ok(())
        })
    });
    work.await
}

/// A job that takes pages of its own.
fn large() -> NewJob {
    NewJob {
        project: Default::default(),
        name: Some("x".repeat(100_000)),
        ..job(None)
    }
}

#[tokio::test]
async fn a_disk_that_was_full_is_written_again_once_there_is_room() {
    let fixture = Fixture::new().await;
    let kept = fixture.submit().await.id;
    for _ in 0..8 {
        // The limit does not go below the pages that there are.
        execute(&fixture, "pragma max_page_count = 1")
            .await
            .expect("a limit");
        let small = (0..20).map(|_| fixture.store.submissions().submit(job(None)));
        let small = futures_util::future::join_all(small);
        let (refused, small) = tokio::join!(fixture.store.submissions().submit(large()), small);
        let error = refused.expect_err("there is no room");
        assert_eq!(error.meaning(), Meaning::NoRoom, "{error}");
        for error in small.into_iter().filter_map(Result::err) {
            assert_eq!(error.meaning(), Meaning::NoRoom, "{error}");
        }
        execute(&fixture, "pragma max_page_count = 1000000")
            .await
            .expect("room");
        fixture.store.probe().await.expect("a write");
        let submitted = fixture.store.submissions().submit(large()).await;
        assert!(
            matches!(submitted, Ok(Submitted::Created(_))),
            "{submitted:?}"
        );
    }
    assert_eq!(fixture.status(kept).await, Status::Queued);
    let fixture = fixture.reopen().await;
    assert_eq!(fixture.status(kept).await, Status::Queued);
}

#[tokio::test]
async fn a_write_that_fails_is_not_told_as_the_end_of_the_server() {
    let fixture = Fixture::new().await;
    // What a connection meets whose transaction the database has ended behind its back.
    let broken = execute(&fixture, "rollback")
        .await
        .expect_err("no transaction is left");
    assert_ne!(broken.meaning(), Meaning::ShuttingDown, "{broken}");
    fixture.submit().await;
}
