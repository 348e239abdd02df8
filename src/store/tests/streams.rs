//! Streams: what is kept, what is taken out, and the hour that comes twice.

use super::*;
use greybox::recording::{Batch, Class, DoubleHour, QualityReport, RowColumn, RowSignal, Rows};
use jiff::Timestamp;

/// Nanoseconds in a second, and in an hour.
pub(super) const S: i64 = 1_000_000_000;
const HOUR: i64 = 3600 * S;
/// When clocks were set back in Berlin: 2025-10-26T01:00:00Z, nanoseconds since 1970.
const SET_BACK: i64 = 1_761_440_400 * S;

pub(super) fn new_batch(samples: impl Iterator<Item = (i64, f64)>, keep: Keep) -> NewBatch {
    let (instants, values): (Vec<i64>, Vec<f64>) = samples.unzip();
    let signal = RowSignal {
        name: "position".to_owned(),
        unit: "m".to_owned(),
        recorded_unit: "mm".to_owned(),
        interpolation: None,
    };
    let column = RowColumn {
        classes: vec![Class::Good; values.len()],
        values,
    };
    NewBatch {
        project: Default::default(),
        stream: "rig-4".to_owned(),
        batch: Batch {
            signals: vec![signal],
            rows: Rows {
                instants,
                columns: vec![column],
            },
            zone: None,
            report: QualityReport::default(),
            double_hour: None,
        },
        keep,
        idempotency: None,
    }
}

/// A batch of local times of the hour that came twice, which nothing in the batch tells apart.
fn in_double_hour(minutes: std::ops::Range<i64>, value: f64) -> NewBatch {
    let first_pass = minutes.map(|minute| (SET_BACK - HOUR + minute * 60 * S, value));
    let mut new = new_batch(first_pass, Keep::default());
    new.batch.double_hour = Some(DoubleHour {
        end_ns: SET_BACK,
        length_ns: HOUR,
    });
    new
}

pub(super) async fn append(store: &Store, new: NewBatch) -> Appended {
    match store.streams().append(new).await.expect("an append") {
        BatchOutcome::Stored(appended, _) => *appended,
        other => panic!("not stored: {other:?}"),
    }
}

pub(super) async fn rows(store: &Store) -> Rows {
    let stream = store.streams().find(&Project::default(), "rig-4").await;
    let stream = stream.expect("a read").expect("a stream");
    let rows = store.streams().rows(&stream, i64::MIN..i64::MAX, 1 << 20);
    rows.await.expect("a read").expect("not too many")
}

on_both!(
    samples_of_a_clock_that_was_wrong_push_none_out_and_can_be_taken_out,
    a_part_is_taken_out_across_blocks,
    a_stream_that_everything_was_taken_out_of_goes_on,
    the_two_passes_of_an_hour_come_in_two_batches,
    a_batch_of_an_hour_that_both_passes_have_is_refused,
    an_hour_that_comes_sample_by_sample_is_told_apart,
);

async fn samples_of_a_clock_that_was_wrong_push_none_out_and_can_be_taken_out(fixture: Fixture) {
    let week = Keep {
        seconds: Some(7.0 * 86_400.0),
        mib: None,
    };
    let now = i64::try_from(Timestamp::now().as_nanosecond()).expect("this century");
    let begin = now - 60_000 * S;
    let real = (0..60_000).map(|k| (begin + k * S, k as f64));
    append(&fixture.store, new_batch(real, week)).await;
    let in_2062 = 2_903_040_000 * S;
    let wrong = [(in_2062, 1.0), (in_2062 + S, 2.0)].into_iter();
    let told = append(&fixture.store, new_batch(wrong, Keep::default())).await;
    assert_eq!((told.removed, told.stream.samples), (0, 60_002));
    let more = [(now - S / 2, 3.0)].into_iter();
    let told = append(&fixture.store, new_batch(more, Keep::default())).await;
    assert_eq!((told.removed, told.stream.samples), (0, 60_003));
    let reached = fixture
        .store
        .streams()
        .last_instant(&told.stream, now)
        .await;
    assert_eq!(reached.expect("a read"), Some(now - S / 2));

    let project = Project::default();
    let cleared = fixture
        .store
        .streams()
        .remove_samples(&project, "rig-4", now..i64::MAX);
    let cleared = cleared.await.expect("a removal").expect("a stream");
    assert_eq!((cleared.removed, cleared.stream.samples), (2, 60_001));
    let last = cleared.stream.last.expect("samples").as_nanosecond();
    assert_eq!(last, i128::from(now - S / 2));
}

async fn a_part_is_taken_out_across_blocks(fixture: Fixture) {
    let samples = 100_000;
    let all = (0..samples).map(|k| (k * S, k as f64));
    append(&fixture.store, new_batch(all, Keep::default())).await;
    let project = Project::default();
    let span = 20_000 * S..80_000 * S;
    let cleared = fixture
        .store
        .streams()
        .remove_samples(&project, "rig-4", span.clone())
        .await;
    let cleared = cleared.expect("a removal").expect("a stream");
    assert_eq!(cleared.removed, 60_000);
    let left = rows(&fixture.store).await;
    let expected: Vec<f64> = (0..20_000)
        .chain(80_000..samples)
        .map(|k| k as f64)
        .collect();
    assert_eq!(left.columns[0].values, expected);
    let none = fixture
        .store
        .streams()
        .remove_samples(&project, "rig-5", span)
        .await;
    assert!(none.expect("a look").is_none());
}

async fn a_stream_that_everything_was_taken_out_of_goes_on(fixture: Fixture) {
    append(
        &fixture.store,
        new_batch([(S, 1.0)].into_iter(), Keep::default()),
    )
    .await;
    let project = Project::default();
    let all = i64::MIN..i64::MAX;
    let cleared = fixture
        .store
        .streams()
        .remove_samples(&project, "rig-4", all)
        .await;
    let stream = cleared.expect("a removal").expect("a stream").stream;
    assert_eq!((stream.samples, stream.first, stream.last), (0, None, None));
    let read = fixture
        .store
        .streams()
        .find(&project, "rig-4")
        .await
        .expect("a read");
    assert_eq!(read, Some(stream));
    let next = new_batch([(2 * S, 2.0)].into_iter(), Keep::default());
    let told = append(&fixture.store, next).await;
    assert_eq!((told.merged.added, told.stream.samples), (1, 1));
}

async fn the_two_passes_of_an_hour_come_in_two_batches(fixture: Fixture) {
    let store = &fixture.store;
    let before = (0..60).map(|minute| (SET_BACK - 2 * HOUR + minute * 60 * S, 0.0));
    append(store, new_batch(before, Keep::default())).await;
    for (pass, value) in [("first", 1.0), ("second", 2.0)] {
        let told = append(store, in_double_hour(0..60, value)).await;
        assert_eq!((told.merged.added, told.merged.changed), (60, 0), "{pass}");
        let warning = &told.report.warnings[0];
        assert_eq!(warning.code, "double_hour");
        assert!(warning.detail.contains(pass), "{}", warning.detail);
    }
    // Both come again, as from a gateway that heard no answer.
    for value in [2.0, 1.0] {
        let told = append(store, in_double_hour(0..60, value)).await;
        assert_eq!((told.merged.repeated, told.merged.changed), (60, 0));
    }
    let stored = rows(store).await;
    let minutes: Vec<i64> = (-120..60).collect();
    let instants = minutes.iter().map(|minute| SET_BACK + minute * 60 * S);
    assert_eq!(stored.instants, instants.collect::<Vec<_>>());
    let value = |minute: &i64| match minute {
        ..-60 => 0.0,
        -60..0 => 1.0,
        _ => 2.0,
    };
    let values: Vec<f64> = minutes.iter().map(value).collect();
    assert_eq!(stored.columns[0].values, values);
}

async fn a_batch_of_an_hour_that_both_passes_have_is_refused(fixture: Fixture) {
    let store = &fixture.store;
    for value in [1.0, 2.0] {
        append(store, in_double_hour(0..60, value)).await;
    }
    let refused = store.streams().append(in_double_hour(0..60, 3.0)).await;
    assert_eq!(refused.expect("an answer"), BatchOutcome::HourCameTwice);
    assert!(!rows(store).await.columns[0].values.contains(&3.0));
}

async fn an_hour_that_comes_sample_by_sample_is_told_apart(fixture: Fixture) {
    let store = &fixture.store;
    let mut number = 0.0;
    let mut expected = Vec::new();
    for pass in [0, 1] {
        for minute in (0..60).step_by(5) {
            number += 1.0;
            // The second pass is sampled a little later than the first.
            let mut new = in_double_hour(minute..minute + 1, number);
            new.batch.rows.instants[0] += pass * 300_000_000;
            append(store, new).await;
            let minutes = (pass - 1) * 60 + minute;
            expected.push((SET_BACK + minutes * 60 * S + pass * 300_000_000, number));
        }
    }
    let stored = rows(store).await;
    let values = stored.columns[0].values.iter().copied();
    let samples: Vec<(i64, f64)> = stored.instants.iter().copied().zip(values).collect();
    assert_eq!(samples, expected);
}
