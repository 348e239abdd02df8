//! Documents that may be read in two ways are asked about, and those of no samples are told what to send.

use super::{check, codes, fault, read, read_with, signals};

#[test]
fn rows_of_several_things_are_not_mixed() {
    let row = |time: &str, rig: &str, p: f64| {
        format!(r#"{{"time": "{time}", "rig": "{rig}", "p": {p}, "q": 1}}"#)
    };
    let [t0, t1, t2] = [
        "2026-03-02T08:15:00Z",
        "2026-03-02T08:15:01Z",
        "2026-03-02T08:15:02Z",
    ];
    let shared = [
        row(t0, "A", 1.0),
        row(t0, "B", 5.0),
        row(t1, "A", 1.0),
        row(t1, "B", 5.0),
        row(t2, "A", 1.0),
        row(t2, "B", 5.0),
    ];
    let blocks = [
        row(t0, "A", 1.0),
        row(t1, "A", 1.0),
        row(t2, "A", 1.0),
        row(t0, "B", 5.0),
        row(t1, "B", 5.0),
        row(t2, "B", 5.0),
    ];
    let newest_first = [
        row(t2, "A", 1.0),
        row(t1, "A", 1.0),
        row(t0, "A", 1.0),
        row(t2, "B", 5.0),
        row(t1, "B", 5.0),
        row(t0, "B", 5.0),
    ];
    for rows in [shared, blocks, newest_first] {
        let text = format!("[{}]", rows.join(","));
        let (code, detail) = fault(&text, &[]);
        assert_eq!(code, "layout_unclear");
        assert!(detail.contains("tag=rig"), "{detail}");
        let expected: [(&str, &[f64]); 2] = [("A", &[1.0; 3]), ("B", &[5.0; 3])];
        assert_eq!(
            signals(&read_with(&text, &["tag=rig", "value=p"]).unwrap()),
            expected
        );
        let recording = read_with(&text, &["tag=rig"]).unwrap();
        let names: Vec<&str> = recording
            .signals
            .iter()
            .map(|signal| &*signal.name)
            .collect();
        assert_eq!(names, ["A.p", "A.q", "B.p", "B.q"]);
    }
    // Devices that send in turn share no time.
    let turns = (0..6).map(|k| {
        format!(
            r#"{{"ts": {}, "device_id": "{}", "temp": {k}}}"#,
            1_772_439_300 + k,
            ["A", "B"][k % 2]
        )
    });
    let turns: Vec<String> = turns.collect();
    assert_eq!(fault(&turns.join("\n"), &[]).0, "layout_unclear");
    assert_eq!(
        read_with(&turns.join("\n"), &["tag=device_id", "value=temp"])
            .unwrap()
            .signals
            .len(),
        2
    );
}

#[test]
fn states_beside_numbers_are_no_names_of_signals() {
    let row = |k: usize, mode: &str| {
        format!(r#"{{"time": "2026-03-02T08:15:0{k}Z", "p": {k}, "mode": "{mode}"}}"#)
    };
    let modes = [row(0, "run"), row(1, "stop"), row(2, "run")];
    let recording = check(&modes.join("\n"), &[("p", &[0.0, 1.0, 2.0])]);
    assert_eq!(codes(&recording), ["text_column"]);
    let steps = (0..6).map(|k| format!(r#"{{"time": {k}, "p": {k}, "name": "step {}"}}"#, k / 2));
    let steps: Vec<String> = steps.collect();
    assert_eq!(signals(&read(&steps.join("\n"))).len(), 1);
}

#[test]
fn series_of_one_name_are_not_mixed() {
    let series = |name: &str, first: f64| {
        format!(
            r#"{{{name}"datapoints": [[{first}, 1772439300], [{first}, 1772439301], [{first}, 1772439302]]}}"#
        )
    };
    for name in ["", r#""target": "PT", "#] {
        let text = format!("[{},{}]", series(name, 1.0), series(name, 5.0));
        let (code, detail) = fault(&text, &[]);
        assert_eq!(code, "layout_unclear", "{detail}");
        assert!(detail.contains("name"), "{detail}");
    }
    // Pages of one signal follow each other.
    let page = |k: usize| {
        format!(
            r#"{{"items": [{{"ts": 177243930{k}, "p": {k}}}, {{"ts": 177243930{}, "p": {}}}]}}"#,
            k + 1,
            k + 1
        )
    };
    let recording = read(&format!("[{},{}]", page(0), page(2)));
    assert_eq!(signals(&recording), [("p", &[0.0, 1.0, 2.0, 3.0][..])]);
    let late = |device: &str, p: f64| {
        format!(
            r#"{{"data": [{{"ts": 1772439300, "p": {p}}}, {{"ts": 1772439301, "p": {p}}}], "device": "{device}"}}"#
        )
    };
    let (code, detail) = fault(&format!("{}\n{}", late("A", 1.0), late("B", 5.0)), &[]);
    assert_eq!(code, "layout_unclear");
    assert!(detail.contains("before the samples"), "{detail}");
}

#[test]
fn samples_that_name_themselves_within_a_list_are_told_apart() {
    let message = |k: usize| {
        let value = |id: &str, value: usize| {
            format!(r#"{{"id": "{id}", "v": {value}, "q": true, "t": 177243930{k}000}}"#)
        };
        let values = [value("Ch.PT", k), value("Ch.TT", k + 5)].join(",");
        format!(r#"{{"timestamp": 177243930{k}000, "values": [{values}]}}"#)
    };
    let expected: [(&str, &[f64]); 2] = [("Ch.PT", &[0.0, 1.0, 2.0]), ("Ch.TT", &[5.0, 6.0, 7.0])];
    check(&[0, 1, 2].map(message).join("\n"), &expected);
    let sample =
        |k: usize, who: &str| format!(r#"{{"ts": 177243930{k}, "value": {k}, "who": "{who}"}}"#);
    let samples = ["a", "b"].map(|who| [0, 1, 2].map(|k| sample(k, who)).join(","));
    let (code, detail) = fault(&format!(r#"{{"data": [{}]}}"#, samples.join(",")), &[]);
    assert_eq!(code, "layout_unclear");
    assert!(detail.contains("tag=who"), "{detail}");
    let of_field = |k: usize, field: &str| {
        format!(
            r#"{{"_time": "2026-03-02T08:15:0{k}Z", "_measurement": "m", "_field": "{field}", "_value": {k}}}"#
        )
    };
    let fields = ["p", "q"].map(|field| [0, 1, 2].map(|k| of_field(k, field)).join(","));
    let text = format!("[{}]", fields.join(","));
    assert_eq!(fault(&text, &[]).0, "layout_unclear");
    let expected: [(&str, &[f64]); 2] = [("p", &[0.0, 1.0, 2.0]), ("q", &[0.0, 1.0, 2.0])];
    assert_eq!(
        signals(&read_with(&text, &["tag=_field"]).unwrap()),
        expected
    );
}

#[test]
fn names_that_come_behind_the_samples_of_a_line_are_asked_about() {
    for (before, behind) in [
        (
            r#"{"PT": [[1772439300, 1], [1772439301, 2]], "device": "#,
            "}",
        ),
        (
            r#"{"data": {"PT": [{"ts": 1772439300, "value": 1}]}, "device": "#,
            "}",
        ),
        (
            r#"{"metric": "PT", "points": [[1772439300, 1], [1772439301, 2]], "tags": {"host": "#,
            "}}",
        ),
    ] {
        let lines = ["\"A\"", "\"B\""].map(|device| format!("{before}{device}{behind}"));
        let (code, detail) = fault(&lines.join("\n"), &[]);
        assert_eq!(code, "layout_unclear");
        assert!(detail.contains("before the samples"), "{detail}");
    }
}

#[test]
fn numbers_by_the_keys_of_rows_are_no_names_and_those_of_signals_are() {
    let rows = |first: usize| {
        let row = |k: usize| {
            format!(
                r#""{}": {{"ts": {}, "value": {k}}}"#,
                first + k,
                1_772_439_300 + k
            )
        };
        format!("{{{}}}", [0, 1, 2].map(row).join(","))
    };
    check(&rows(0), &[("value", &[0.0, 1.0, 2.0])]);
    let recording = read_with(&rows(1001), &["grid=none"]).unwrap();
    let signals = recording.signals.iter();
    let names: Vec<&str> = signals.map(|signal| &*signal.name).collect();
    assert_eq!(names, ["1001", "1002", "1003"]);
}

#[test]
fn pairs_without_a_clear_time_are_asked_about_or_refused() {
    let both = r#"{"count": [[1772439300, 1772430000], [1772439301, 1772430001]]}"#;
    assert_eq!(fault(both, &[]).0, "layout_unclear");
    // Two columns of two rows look like pairs until the second.
    let frame = r#"{"data": {"values": [[1772439300000, 1772439301000], [3.2, 3.3]]}}"#;
    assert_eq!(fault(frame, &[]).0, "not_a_time");
    let ragged = r#"{"PT": [[1772439300, 1], [1772439301]]}"#;
    assert_eq!(fault(ragged, &[]).0, "ragged_row");
    let seconds = r#"{"metric": {"__name__": "p"}, "values": [[0, 1.5], [1, 1.6]]}"#;
    assert_eq!(fault(seconds, &[]).0, "time_unit_needed");
    let recording = read_with(seconds, &["time_unit=s"]).unwrap();
    assert_eq!(signals(&recording), [("p", &[1.5, 1.6][..])]);
}

#[test]
fn columns_of_another_length_or_of_large_numbers_are_no_times() {
    let short = r#"{"time": [0, 1, 2], "a": [1, 2]}"#;
    let (code, detail) = fault(short, &[]);
    assert_eq!(code, "wrong_length");
    assert!(
        detail.contains("`a` has 2 values where `time` has 3"),
        "{detail}"
    );
    let spectrum = r#"{"frequency": [1000000000, 1100000000], "power": [1, 2]}"#;
    assert_eq!(fault(spectrum, &[]).0, "no_signals");
    let described = r#"{"time": [0, 1, 2], "a": [1, 2, 3], "authors": ["x", "y"]}"#;
    assert_eq!(signals(&read(described)), [("a", &[1.0, 2.0, 3.0][..])]);
}

#[test]
fn what_is_left_out_of_a_list_is_told() {
    let text = r#"{"PT": [{"ts": 1772439300, "value": 1}, {"comment": "stop"}, {"ts": 1772439301, "value": 2}]}"#;
    let recording = read(text);
    assert_eq!(signals(&recording), [("PT", &[1.0, 2.0][..])]);
    let note = recording
        .notes
        .iter()
        .find(|note| note.code == "left_out_elements")
        .unwrap();
    assert!(
        note.detail.starts_with("1 objects") && note.detail.ends_with("`/PT`"),
        "{}",
        note.detail
    );
}

#[test]
fn a_document_without_samples_is_told_what_to_send() {
    for text in [
        r#"{"PT": 1}"#,
        "{}",
        "[]",
        r#"{"nmae": "typo", "start": "yesterday"}"#,
        "[[[1, 2], [3, 4]]]",
        "3",
        r#"{"a": {"b": {"c": [{}]}}}"#,
    ] {
        let (code, detail) = fault(text, &[]);
        assert_eq!(code, "no_signals", "{text}: {detail}");
        assert!(
            detail.contains("sample_time_s") && detail.contains("`time`"),
            "{detail}"
        );
    }
    assert_eq!(
        fault(r#"{"sample_time_s": 0, "signals": {}}"#, &[]).0,
        "out_of_range"
    );
}
