//! Recordings: stored once, read back to the bit, kept while a job needs them.

use proptest::prelude::*;

use super::*;

on_both! {
    the_same_recording_is_stored_once,
    a_recording_is_kept_while_a_job_needs_it,
    a_job_on_a_recording_that_is_not_there_is_refused,
    a_recording_of_many_chunks_comes_back_whole_from_memory_and_from_the_scratch,
    a_large_recording_that_comes_twice_at_once_is_stored_once,
    a_large_recording_that_does_not_read_back_leaves_nothing,
    the_parts_of_a_server_that_is_gone_go,
}
use greybox::intake::{self, MediaKind};
use greybox::recording::{Recording, Signal, TimeAxis, Warning};

fn recording(time: TimeAxis, values: Vec<f64>) -> Recording {
    Recording {
        start: Some("2026-03-02T08:15:00Z".parse().expect("a time")),
        notes: vec![Warning::of_recording(
            "dropped_row",
            "row 7 was empty".to_owned(),
        )],
        ..Recording::new(
            time,
            vec![
                Signal::new("position", "m", values.clone()),
                Signal {
                    recorded_unit: "bar".to_owned(),
                    ..Signal::new("pressure", "Pa", values)
                },
            ],
        )
    }
}

fn new_dataset(digest: &str, recording: Recording) -> NewDataset {
    NewDataset {
        project: Default::default(),
        name: Some("rig 4, run 3".to_owned()),
        digest: digest.to_owned(),
        summary: recording.summary(),
        recording: recording.into(),
    }
}

fn uniform(samples: usize) -> TimeAxis {
    TimeAxis::Uniform {
        sample_time: 0.01,
        samples,
    }
}

pub(super) async fn insert(fixture: &Fixture, digest: &str) -> (DatasetRow, bool) {
    let recording = recording(uniform(3), vec![1.0, f64::NAN, 3.0]);
    fixture
        .store
        .datasets()
        .insert(new_dataset(digest, recording))
        .await
        .expect("a dataset")
}

async fn the_same_recording_is_stored_once(fixture: Fixture) {
    let (first, created) = insert(&fixture, "sha256:1").await;
    let (again, created_again) = insert(&fixture, "sha256:1").await;
    assert!(created && !created_again);
    assert_eq!(first, again);
    let (other, _) = insert(&fixture, "sha256:2").await;
    let page = fixture
        .store
        .datasets()
        .list(&Default::default(), None, 1)
        .await
        .expect("a page");
    assert_eq!(page.rows, std::slice::from_ref(&other));
    let page = fixture
        .store
        .datasets()
        .list(&Default::default(), page.next, 1)
        .await
        .expect("a page");
    assert_eq!((page.rows, page.next), (vec![first.clone()], None));
    let shown = fixture
        .store
        .datasets()
        .find(first.id)
        .await
        .expect("a read");
    assert_eq!(shown.as_deref(), Some(&first));
}

async fn a_recording_is_kept_while_a_job_needs_it(fixture: Fixture) {
    let (dataset, _) = insert(&fixture, "sha256:1").await;
    let mut reader = job(None);
    reader.datasets = vec![dataset.id, dataset.id];
    let Ok(Submitted::Created(reader)) = fixture.store.submissions().submit(reader).await else {
        panic!("not created");
    };
    let delete = || fixture.store.datasets().delete(dataset.id);
    let refused = delete().await.expect("a removal");
    assert_eq!(refused, DatasetRemoval::InUse(vec![reader.id]));
    fixture
        .store
        .jobs()
        .cancel(reader.id)
        .await
        .expect("a wish");
    assert_eq!(delete().await.expect("a removal"), DatasetRemoval::Removed);
    assert_eq!(delete().await.expect("a removal"), DatasetRemoval::NotFound);
    let gone = fixture
        .store
        .datasets()
        .recording(dataset.id)
        .await
        .expect("a read");
    assert!(gone.is_none());
}

async fn a_job_on_a_recording_that_is_not_there_is_refused(fixture: Fixture) {
    let missing = DatasetId::new();
    let mut reader = job(None);
    reader.datasets = vec![missing];
    let refused = fixture.store.submissions().submit(reader).await;
    assert!(matches!(refused, Ok(Submitted::NoDataset(id)) if id == missing));
}

async fn a_recording_of_many_chunks_comes_back_whole_from_memory_and_from_the_scratch(
    fixture: Fixture,
) {
    let samples = 3 * (1 << 20) / 8 + 3;
    let values: Vec<f64> = (0..samples).map(|k| (k as f64).sqrt()).collect();
    let in_memory = recording(uniform(samples), values);
    let mut text = Vec::new();
    in_memory.write_csv(&mut text).expect("memory takes all");
    let scratch = fixture.store.datasets().scratch();
    let mut put_aside = intake::receive(
        text.as_slice(),
        MediaKind::Csv,
        &intake::Options::default(),
        Some(scratch),
    )
    .expect("what is written can be read");
    let mut summary = in_memory.summary();
    summary.signals[1].recorded_unit = "Pa".to_owned();
    summary.report.warnings.clear();
    // A CSV does not say when it began where its times are seconds.
    summary.start = None;
    summary.source.format = "wide_csv".to_owned();
    assert_eq!(put_aside.summary().expect("a scratch"), summary);
    let put_aside = NewDataset {
        project: Default::default(),
        name: None,
        digest: "sha256:2".to_owned(),
        summary,
        recording: put_aside,
    };
    for new in [new_dataset("sha256:1", in_memory.clone()), put_aside] {
        let (row, _) = fixture
            .store
            .datasets()
            .insert(new)
            .await
            .expect("a dataset");
        let back = fixture
            .store
            .datasets()
            .recording(row.id)
            .await
            .expect("a read");
        let back = back.expect("a recording");
        assert_eq!(back.time, in_memory.time);
        for (back, stored) in back.signals.iter().zip(&in_memory.signals) {
            assert!(back.values == stored.values, "{}", back.name);
        }
        let name = in_memory.signals[0].name.clone();
        // Across the border of two chunks, and from before the first sample up to it.
        for (from, to) in [(13_000.05, 13_200.0), (-5.0, 0.0), (0.0, 1e9), (1e8, 1e9)] {
            let wanted = DatasetPart {
                signals: Some(vec![name.clone(), "nothing".to_owned()]),
                from: Some(from),
                to: Some(to),
            };
            let part = fixture.store.datasets().part(row.id, wanted).await;
            let part = part.expect("a read").expect("a recording");
            let range = in_memory.time.between(Some(from), Some(to));
            let instants = range.clone().map(|sample| in_memory.time.instant(sample));
            assert_eq!(part.time, TimeAxis::Instants(instants.collect()));
            assert_eq!(part.signals.len(), 1);
            assert!(
                part.signals[0].values == in_memory.signals[0].values[range],
                "{from}"
            );
        }
    }
}

/// Recordings whose samples come in several chunks.
fn large(digest: &str) -> NewDataset {
    let values: Vec<f64> = (0..200_000).map(f64::from).collect();
    new_dataset(digest, recording(uniform(200_000), values))
}

/// Chunks of recordings, and recordings on their way in.
async fn parts(fixture: &Fixture) -> [i64; 2] {
    let mut counts = [0; 2];
    for (count, table) in counts
        .iter_mut()
        .zip(["dataset_chunks", "unfinished_datasets"])
    {
        let mut query = database::QueryBuilder::new("select count(*) from ");
        query.push(table);
        let counted = query.build_query_scalar();
        *count = counted
            .fetch_one(fixture.store.readers())
            .await
            .expect("a count");
    }
    counts
}

async fn a_large_recording_that_comes_twice_at_once_is_stored_once(fixture: Fixture) {
    let datasets = fixture.store.datasets();
    let (first, second) = tokio::join!(
        datasets.insert(large("sha256:1")),
        datasets.insert(large("sha256:1"))
    );
    let (first, second) = (first.expect("a dataset"), second.expect("a dataset"));
    assert_eq!(first.0, second.0);
    assert!(first.1 != second.1);
    assert_eq!(parts(&fixture).await, [4, 0]);
    let read = datasets.recording(first.0.id).await.expect("a read");
    assert_eq!(
        read.expect("a recording").signals[1].values[199_999],
        199_999.0
    );
    let removed = datasets.delete(first.0.id).await.expect("a removal");
    assert_eq!(removed, DatasetRemoval::Removed);
    assert_eq!(parts(&fixture).await, [0, 0]);
}

async fn a_large_recording_that_does_not_read_back_leaves_nothing(fixture: Fixture) {
    let mut new = large("sha256:1");
    // The samples of the last signal are in a column that is not there.
    let mut wide = recording(uniform(1), vec![1.0]);
    wide.signals.push(wide.signals[0].clone());
    let wide = new_dataset("sha256:2", wide).recording;
    new.recording.header.signals[1] = wide.header.signals[2].clone();
    let refused = fixture.store.datasets().insert(new).await;
    assert!(refused.is_err());
    assert_eq!(parts(&fixture).await, [0, 0]);
}

async fn the_parts_of_a_server_that_is_gone_go(fixture: Fixture) {
    let stored = fixture.store.datasets().insert(large("sha256:1")).await;
    stored.expect("a dataset");
    for statement in [
        "insert into unfinished_datasets (dataset, life) values ('ds_gone', 0)",
        "insert into dataset_chunks (dataset, position, chunk, samples, seal) \
         select 'ds_gone', position, chunk, samples, seal from dataset_chunks",
    ] {
        full::execute(&fixture, statement).await.expect("rows");
    }
    assert_eq!(parts(&fixture).await, [8, 1]);
    let tidied = fixture.store.tidy(Retention::default()).await;
    tidied.expect("a tidy store");
    assert_eq!(parts(&fixture).await, [4, 0]);
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

async fn round_trip(recording: Recording) -> Recording {
    let fixture = Fixture::new().await;
    let (row, _) = fixture
        .store
        .datasets()
        .insert(new_dataset("sha256:1", recording))
        .await
        .expect("a dataset");
    let back = fixture
        .store
        .datasets()
        .recording(row.id)
        .await
        .expect("a read");
    Arc::unwrap_or_clone(back.expect("a recording"))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    #[test]
    fn a_recording_comes_back_to_the_bit(
        values in prop::collection::vec(prop::num::f64::ANY, 2..50),
        is_uniform in any::<bool>(),
    ) {
        let time = if is_uniform {
            uniform(values.len())
        } else {
            TimeAxis::Instants((0..values.len()).map(|k| (k as f64).sqrt()).collect())
        };
        let stored = recording(time, values);
        let runtime = tokio::runtime::Runtime::new().expect("a runtime");
        let back = runtime.block_on(round_trip(stored.clone()));
        prop_assert_eq!(&back.time, &stored.time);
        prop_assert_eq!(back.start, stored.start);
        prop_assert_eq!(&back.notes, &stored.notes);
        for (back, stored) in back.signals.iter().zip(&stored.signals) {
            prop_assert_eq!(&back.name, &stored.name);
            prop_assert_eq!(&back.recorded_unit, &stored.recorded_unit);
            prop_assert_eq!(bits(&back.values), bits(&stored.values));
        }
    }
}
