//! Whatever happens to a job, in whatever order: its events have no gap and it ends once, and both
//! databases say the same of it.

use proptest::prelude::*;

use super::*;

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

async fn live(mut fixture: Fixture, deeds: Vec<Deed>) -> (Status, Vec<StoredEvent>, Option<Value>) {
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
        let (lived, lived_again) = runtime.block_on(async {
            let again = match Fixture::on_postgres().await {
                Some(fixture) => Some(live(fixture, deeds.clone()).await),
                None => None,
            };
            (live(Fixture::new().await, deeds).await, again)
        });
        if let Some(again) = &lived_again {
            prop_assert_eq!(again, &lived, "the two databases differ");
        }
        let (status, events, result) = lived;
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
