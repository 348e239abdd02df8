//! Whole documents, right and wrong.

use super::*;
use crate::TimeAxis;
use greybox_numerics::parsing::Fault;
use proptest::prelude::*;

fn parse(text: &str) -> Result<Recording, ReadError> {
    read(text.as_bytes(), ReadingPurpose::Recording)
}

/// Pointer and code of every fault.
fn faults(text: &str) -> Vec<(String, String)> {
    let error = parse(text).unwrap_err();
    assert!(matches!(error, ReadError::Invalid(_)), "{error}");
    let place = |fault: &Fault| (fault.pointer().to_owned(), fault.code.to_string());
    error.faults().iter().map(place).collect()
}

fn at(pointer: &str, code: &str) -> (String, String) {
    (pointer.to_owned(), code.to_owned())
}

fn one(text: &str) -> (String, String) {
    let mut faults = faults(text);
    assert_eq!(faults.len(), 1, "{faults:?}");
    faults.remove(0)
}

#[test]
fn the_documented_example_is_read() {
    let recording = parse(
        r#"{"name": "rig 4, run 3", "sample_time_s": 0.01, "start": "2026-03-02T08:15:00Z",
            "signals": {"reference": {"unit": "m", "values": [0.03, 0.03]},
                        "position": {"unit": "mm", "values": [0.0, 1.5]}}}"#,
    )
    .unwrap();
    assert_eq!(recording.name.as_deref(), Some("rig 4, run 3"));
    assert_eq!(
        recording.start,
        Some("2026-03-02T08:15:00Z".parse().unwrap())
    );
    assert_eq!(
        recording.time,
        TimeAxis::Uniform {
            sample_time: 0.01,
            samples: 2
        }
    );
    assert_eq!(recording.signals[0].name, "reference");
    assert_eq!(recording.signal("position").unwrap().values, [0.0, 0.0015]);
}

#[test]
fn the_unit_may_follow_the_values() {
    let text = r#"{"sample_time_s": 1, "signals": {"p": {"values": [1, 2], "unit": "bar"}}}"#;
    assert_eq!(parse(text).unwrap().signals[0].values, [1e5, 2e5]);
}

#[test]
fn listed_times_are_uniform_where_they_are_and_count_from_the_first() {
    let text = r#"{"time": {"unit": "ms", "values": [50, 60, 70]},
                   "signals": {"a": {"values": [1, null, 3]}}}"#;
    let recording = parse(text).unwrap();
    assert_eq!(
        recording.time,
        TimeAxis::Uniform {
            sample_time: 0.01,
            samples: 3
        }
    );
    assert_eq!(recording.signals[0].missing(), 1);
    let text = r#"{"time": {"values": [5, 6, 8]}, "signals": {"a": {"values": [1, 2, 3]}}}"#;
    assert_eq!(
        parse(text).unwrap().time,
        TimeAxis::Instants(vec![0.0, 1.0, 3.0])
    );
}

#[test]
fn of_two_samples_at_the_same_time_the_later_is_dropped() {
    let text = r#"{"time": {"values": [0, 1, 1, 2]}, "signals": {"a": {"values": [1, 2, 9, 3]}}}"#;
    let recording = parse(text).unwrap();
    assert_eq!(recording.signals[0].values, [1.0, 2.0, 3.0]);
    assert_eq!(recording.notes[0].code, "duplicate_time");
}

#[test]
fn all_faults_are_reported_at_their_pointers() {
    let text = r#"{"sample_time_s": 0, "nmae": "typo", "start": "yesterday", "name": 7,
        "signals": {"a/b": {"unit": "parsec", "values": [1, "x", true]},
                    "c": {"values": [1, 2]}, "d": {}, "e": [1], "f": {"values": 1, "gain": {}},
                    "": {"values": []}}}"#;
    let expected = [
        ("/sample_time_s", "out_of_range"),
        ("/nmae", "unknown_field"),
        ("/start", "not_a_time"),
        ("/name", "wrong_type"),
        ("/signals/a~1b/values/1", "not_a_number"),
        ("/signals/a~1b/values/2", "not_a_number"),
        ("/signals/e", "wrong_type"),
        ("/signals/f/values", "wrong_type"),
        ("/signals/f/gain", "unknown_field"),
        ("/signals/", "empty_name"),
        ("/signals/a~1b/unit", "unknown_unit"),
        ("/signals/c/values", "wrong_length"),
        ("/signals/d/values", "missing"),
        ("/signals/e/values", "missing"),
        ("/signals/f/values", "wrong_length"),
    ];
    let expected: Vec<_> = expected
        .into_iter()
        .map(|(pointer, code)| at(pointer, code))
        .collect();
    assert_eq!(faults(text), expected);
}

#[test]
fn exactly_one_of_sample_time_and_time_is_needed() {
    let neither = r#"{"signals": {"a": {"values": [1, 2]}}}"#;
    assert_eq!(one(neither), at("", "sample_time_or_time"));
    let both = r#"{"sample_time_s": 1, "time": {"values": [0, 1]},
                   "signals": {"a": {"values": [1, 2]}}}"#;
    assert_eq!(one(both), at("", "sample_time_or_time"));
}

#[test]
fn times_must_be_there_and_run_forwards() {
    let with = |times: &str| {
        let text = format!(
            r#"{{"time": {{"values": {times}}}, "signals": {{"a": {{"values": [1, 2, 3]}}}}}}"#
        );
        one(&text)
    };
    assert_eq!(with("[0, null, 2]"), at("/time/values/1", "missing_time"));
    assert_eq!(with("[0, 2, 1]"), at("/time/values/2", "time_backwards"));
}

#[test]
fn documents_without_data_are_refused() {
    assert_eq!(one(r#"{"sample_time_s": 1}"#).1, "no_signals");
    assert_eq!(
        one(r#"{"sample_time_s": 1, "signals": {}}"#).1,
        "no_signals"
    );
    let single = r#"{"sample_time_s": 1, "signals": {"a": {"values": [1]}}}"#;
    assert_eq!(one(single).1, "too_few_samples");
    let codes: Vec<_> = faults("[1, 2]").into_iter().map(|(_, code)| code).collect();
    assert_eq!(codes, ["wrong_type", "sample_time_or_time"]);
}

#[test]
fn a_name_that_stands_twice_is_refused() {
    let text = r#"{"sample_time_s": 1, "sample_time_s": 2,
                   "signals": {"a": {"values": [1, 2]}, "a": {"values": [3, 4]}}}"#;
    let expected = [
        ("/sample_time_s", "duplicate_field"),
        ("/signals/a", "duplicate_name"),
    ];
    assert_eq!(
        faults(text),
        expected.map(|(pointer, code)| at(pointer, code))
    );
}

#[test]
fn text_that_is_not_json_is_malformed_at_a_line_and_column() {
    let error = parse("{\n  \"signals\": nope }").unwrap_err();
    let ReadError::Malformed(faults) = error else {
        panic!("{error}")
    };
    assert_eq!(
        (faults[0].line, faults[0].column.as_deref()),
        (Some(2), Some("15"))
    );
    for text in ["", "{", "{\"sample_time_s\": 1e999}", "{} {}"] {
        assert!(
            matches!(parse(text), Err(ReadError::Malformed(_))),
            "{text:?}"
        );
    }
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in r#"[\[\]{}:,"a-z0-9. -]{0,200}"#) {
        let _ = parse(&text);
    }

    #[test]
    fn no_values_make_the_reader_panic(
        times in prop::collection::vec(-1e300..1e300, 0..5),
        values in prop::collection::vec(prop::option::of(-1e300..1e300), 0..5),
    ) {
        let document = serde_json::json!({
            "time": {"unit": "d", "values": times},
            "signals": {"a": {"unit": "bar", "values": values}},
        });
        let _ = parse(&document.to_string());
    }
}
