//! Streams of many blocks: what a plot of a long part shows, and what a stream says of itself.

use super::streams::{S, append, new_batch, rows};
use super::*;
use greybox::recording::Rows;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Samples of a stream that are far more than a plot has points.
const LONG: i64 = 400_000;

on_both!(
    a_spike_of_one_sample_shows_in_a_plot_of_whatever_length,
    a_part_of_few_samples_is_shown_as_it_is,
    what_a_stream_says_of_itself_is_what_it_has,
    the_oldest_samples_make_room_for_the_newest,
    a_block_of_an_earlier_version_is_shown_and_grows,
);

async fn long(store: &Store, spike: i64) -> StreamRow {
    let value = |k: i64| {
        if k == spike {
            1e3
        } else {
            (k as f64 * 1e-3).sin()
        }
    };
    let samples = (0..LONG).map(|k| (k * S, value(k)));
    append(store, new_batch(samples, Keep::default()))
        .await
        .stream
}

async fn overview(store: &Store, stream: &StreamRow, span: std::ops::Range<i64>) -> Rows {
    let shown = store.streams().overview(stream, span, 100).await;
    shown.expect("a read")
}

async fn a_spike_of_one_sample_shows_in_a_plot_of_whatever_length(fixture: Fixture) {
    let spike = 123_457;
    let stream = long(&fixture.store, spike).await;
    // All of it, a part whose ends lie within blocks, a part of two blocks, and the block of the spike.
    for (from, to) in [
        (i64::MIN, i64::MAX),
        (50_001 * S, 350_001 * S),
        (100_000 * S, 160_000 * S),
        (spike * S - 500 * S, spike * S + 500 * S),
        (spike * S, spike * S + 1),
    ] {
        let shown = overview(&fixture.store, &stream, from..to).await;
        let values = &shown.columns[0].values;
        let place = values.iter().position(|value| *value == 1e3);
        let place = place.unwrap_or_else(|| panic!("{from} to {to}"));
        assert_eq!(shown.instants[place], spike * S);
        assert!(shown.rows() <= 1000, "{}", shown.rows());
        assert!(shown.instants.is_sorted());
        assert!(shown.instants.iter().all(|ns| (from..to).contains(ns)));
    }
}

async fn a_part_of_few_samples_is_shown_as_it_is(fixture: Fixture) {
    let stream = long(&fixture.store, 0).await;
    let span = 200_000 * S..200_700 * S;
    let shown = overview(&fixture.store, &stream, span.clone()).await;
    let all = fixture.store.streams().rows(&stream, span, 1000).await;
    assert_eq!(Some(shown), all.expect("a read"));
    let none = overview(&fixture.store, &stream, LONG * S..i64::MAX).await;
    assert_eq!(none.rows(), 0);
}

async fn what_a_stream_says_of_itself_is_what_it_has(fixture: Fixture) {
    let store = &fixture.store;
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let project = Project::default();
    let mut expected = std::collections::BTreeMap::new();
    for round in 0..30 {
        let from = random.random_range(-50_000..50_000_i64);
        let step = random.random_range(1..4_i64);
        if round % 5 == 4 {
            let span = from * S..(from + 20_000) * S;
            let cleared = store
                .streams()
                .remove_samples(&project, "rig-4", span.clone());
            let cleared = cleared.await.expect("a removal").expect("a stream");
            let before = expected.len();
            expected.retain(|instant, _| !span.contains(instant));
            assert_eq!(cleared.removed as usize, before - expected.len(), "{round}");
        } else {
            let n = random.random_range(1..20_000_i64);
            let samples = (0..n).map(|k| ((from + k * step) * S, f64::from(round)));
            let samples: Vec<_> = samples.collect();
            expected.extend(samples.iter().copied());
            append(store, new_batch(samples.into_iter(), Keep::default())).await;
        }
        let stream = store.streams().find(&project, "rig-4").await;
        let stream = stream.expect("a read").expect("a stream");
        let stored = rows(store).await;
        assert_eq!(
            stored.instants,
            expected.keys().copied().collect::<Vec<_>>()
        );
        assert_eq!(
            stored.columns[0].values,
            expected.values().copied().collect::<Vec<_>>()
        );
        assert_eq!(stream.samples, expected.len() as u64, "{round}");
        let ends = [stream.first, stream.last].map(|end| end.map(|end| end.as_nanosecond() as i64));
        let ends_expected = [
            expected.keys().next().copied(),
            expected.keys().last().copied(),
        ];
        assert_eq!(ends, ends_expected);
        let bytes: i64 = database::query_scalar(
            "select cast((select sum(length(samples)) from stream_blocks) \
             + coalesce((select sum(length(samples)) from stream_extremes), 0) as bigint)",
        )
        .fetch_one(store.readers())
        .await
        .expect("a sum");
        assert_eq!(stream.bytes, bytes.unsigned_abs(), "{round}");
    }
}

async fn the_oldest_samples_make_room_for_the_newest(fixture: Fixture) {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let keep = Keep {
        seconds: None,
        mib: Some(1),
    };
    // Values of 52 random bits do not become smaller.
    let samples = (0..LONG).map(|k| (k * S, random.random::<f64>()));
    let told = append(&fixture.store, new_batch(samples, keep)).await;
    assert_eq!(told.removed + told.stream.samples, LONG as u64);
    assert!(told.stream.bytes <= 1 << 20, "{}", told.stream.bytes);
    assert!(told.stream.bytes > 1 << 19, "{}", told.stream.bytes);
    let stored = rows(&fixture.store).await;
    assert_eq!(stored.rows() as u64, told.stream.samples);
    assert_eq!(stored.instants.last(), Some(&((LONG - 1) * S)));
}

async fn a_block_of_an_earlier_version_is_shown_and_grows(fixture: Fixture) {
    let store = &fixture.store;
    let first = new_batch([(5 * S, 1.0)].into_iter(), Keep::default());
    append(store, first).await;
    // The instants 5 and 7 s, the values 1.5 and 2.5, and two classes, without a seal.
    let earlier = store.readers().kind().either(
        "update stream_blocks set last_ns = 7000000000, rows = 2, seal = null, \
         samples = x'00f2052a0100000000863ba101000000000000000000f83f00000000000004400000'",
        "update stream_blocks set last_ns = 7000000000, rows = 2, seal = null, samples = \
         decode('00f2052a0100000000863ba101000000000000000000f83f00000000000004400000', 'hex')",
    );
    full::execute(&fixture, earlier).await.expect("a change");
    let stored = rows(store).await;
    assert_eq!(stored.instants, [5 * S, 7 * S]);
    assert_eq!(stored.columns[0].values, [1.5, 2.5]);
    let later = new_batch([(6 * S, 2.0)].into_iter(), Keep::default());
    append(store, later).await;
    assert_eq!(rows(store).await.columns[0].values, [1.5, 2.0, 2.5]);
}
