//! Answers of services for devices and time series.

use super::{check, check_times, codes, fault, read, read_with, signals};

const PT: (&str, &[f64]) = ("PT", &[3.2, 3.3, 3.4]);
const TT: (&str, &[f64]) = ("TT", &[65.0, 65.5, 66.0]);

#[test]
fn a_range_of_prometheus_has_a_signal_for_each_metric() {
    let series = |metric: &str, values: [&str; 3]| {
        let [a, b, c] = values;
        format!(
            r#"{{"metric": {{{metric}}}, "values": [[1772439300, "{a}"], [1772439301, "{b}"], [1772439302.000, "{c}"]]}}"#
        )
    };
    let answer = |series: &[String]| {
        let series = series.join(",");
        format!(
            r#"{{"status": "success", "data": {{"resultType": "matrix", "result": [{series}]}}}}"#
        )
    };
    let pt = series(r#""__name__": "PT", "job": "hall3""#, ["3.2", "3.3", "3.4"]);
    let tt = series(r#""__name__": "TT", "job": "hall3""#, ["65", "65.5", "66"]);
    let recording = check(&answer(&[pt.clone(), tt]), &[PT, TT]);
    assert_eq!(recording.source.format, "json_series");
    assert_eq!(codes(&recording), ["time_unit_from_size"]);
    let neighbour = series(r#""__name__": "PT", "job": "hall4""#, ["1", "NaN", "2"]);
    let recording = read(&answer(&[pt, neighbour]));
    assert_eq!(
        signals(&recording)[0],
        ("PT,job=hall3", &[3.2, 3.3, 3.4][..])
    );
    assert_eq!(recording.signals[1].name, "PT,job=hall4");
    assert!(recording.signals[1].values[1].is_nan());
    let nameless = series(r#""instance": "a""#, ["1", "2", "3"]);
    let second = series(r#""instance": "b""#, ["4", "5", "6"]);
    let expected: [(&str, &[f64]); 2] = [
        ("value,instance=a", &[1.0, 2.0, 3.0]),
        ("value,instance=b", &[4.0, 5.0, 6.0]),
    ];
    check(&answer(&[nameless, second]), &expected);
}

#[test]
fn both_forms_of_thingsboard_are_read() {
    let text = r#"{"PT": [{"ts": 1772439302000, "value": "3.4"}, {"ts": 1772439301000, "value": "3.3"},
                          {"ts": 1772439300000, "value": "3.2"}],
                   "TT": [{"ts": 1772439300000, "value": 65}, {"ts": 1772439301000, "value": 65.5},
                          {"ts": 1772439302000, "value": 66}]}"#;
    let recording = check(text, &[PT, TT]);
    assert!(!codes(&recording).contains(&"out_of_order"));
    let rows = r#"[{"ts": 1772439300000, "values": {"PT": 3.2, "TT": 65}},
                   {"ts": 1772439301000, "values": {"PT": 3.3, "TT": 65.5}},
                   {"ts": 1772439302000, "values": {"PT": 3.4, "TT": 66}}]"#;
    check(rows, &[PT, TT]);
    check(&format!("{{\"Pump\": {rows}}}"), &[PT, TT]);
    let gateway = read(&format!("{{\"Pump\": {rows}, \"Fan\": {rows}}}"));
    let names: Vec<&str> = gateway.signals.iter().map(|signal| &*signal.name).collect();
    assert_eq!(names, ["Pump PT", "Pump TT", "Fan PT", "Fan TT"]);
}

/// Three entries of SiteWise, the second of the quality given.
fn entries(values: [f64; 3], quality: &str) -> String {
    let entry = |second: usize, quality: &str| {
        format!(
            r#"{{"value": {{"doubleValue": {}}}, "timestamp": {{"timeInSeconds": 177243930{second}, "offsetInNanos": 0}},
                "quality": "{quality}"}}"#,
            values[second]
        )
    };
    let entries = [entry(0, "GOOD"), entry(1, quality), entry(2, "GOOD")];
    format!("[{}]", entries.join(","))
}

#[test]
fn a_history_of_sitewise_is_read_with_its_quality() {
    let of_pt = entries([3.2, 3.3, 3.4], "GOOD");
    let of_tt = entries([65.0, 65.5, 66.0], "GOOD");
    let lone = format!(r#"{{"assetPropertyValueHistory": {of_pt}, "nextToken": "x"}}"#);
    let recording = check(&lone, &[("value", PT.1)]);
    assert!(codes(&recording).is_empty(), "{:?}", recording.notes);
    let bad = entries([3.2, 3.3, 3.4], "BAD");
    let recording = read(&format!(r#"{{"assetPropertyValueHistory": {bad}}}"#));
    assert!(recording.signals[0].values[1].is_nan());
    for (first, second) in [
        (
            r#""entryId": "PT", "assetPropertyValueHistory": "#,
            r#""entryId": "TT", "assetPropertyValueHistory": "#,
        ),
        (
            r#""entryId": "0", "propertyAlias": "PT", "propertyValues": "#,
            r#""entryId": "1", "propertyAlias": "TT", "propertyValues": "#,
        ),
    ] {
        let batch = format!(
            "{{\"successEntries\": [{{{first}{of_pt}}}, {{{second}{of_tt}}}], \"errorEntries\": []}}"
        );
        check(&batch, &[PT, TT]);
    }
    // Keys in the order of the alphabet have the name behind the samples.
    let sorted = format!(
        r#"{{"successEntries": [{{"assetPropertyValueHistory": {of_pt}, "entryId": "PT"}},
            {{"assetPropertyValueHistory": {of_tt}, "entryId": "TT"}}]}}"#
    );
    check(&sorted, &[PT, TT]);
}

#[test]
fn a_history_of_home_assistant_is_read_with_its_units() {
    let state = |second: u8, state: &str, rest: &str| {
        format!(
            r#"{{"state": "{state}", "last_changed": "2026-03-02T08:15:0{second}+00:00"{rest}}}"#
        )
    };
    let full = |name: &str, unit: &str| {
        format!(
            r#", "entity_id": "{name}", "attributes": {{"unit_of_measurement": "{unit}", "max": 9}}"#
        )
    };
    let [pt, tt] = [full("sensor.pt", "bar"), full("sensor.tt", "°C")];
    for (later_pt, later_tt) in [(pt.as_str(), tt.as_str()), ("", "")] {
        let text = format!(
            "[[{},{},{}],[{},{},{}]]",
            state(0, "3.5", &pt),
            state(1, "unavailable", later_pt),
            state(2, "4", later_pt),
            state(0, "20", &tt),
            state(1, "20.5", later_tt),
            state(2, "21", later_tt)
        );
        let recording = read(&text);
        check_times(&recording, &text);
        let [of_pt, of_tt] = &recording.signals[..] else {
            panic!("{:?}", signals(&recording));
        };
        assert_eq!((&*of_pt.name, &*of_pt.unit), ("sensor.pt", "Pa"));
        assert_eq!((of_pt.values[0], of_pt.values[2]), (3.5e5, 4e5));
        assert!(of_pt.values[1].is_nan());
        assert_eq!((&*of_tt.name, &*of_tt.unit), ("sensor.tt", "K"));
        assert_eq!(of_tt.values, [293.15, 293.65, 294.15]);
    }
}

#[test]
fn records_with_their_values_in_an_object_are_rows() {
    let rows = |row: &dyn Fn(usize) -> String| [0, 1, 2].map(row);
    let nested = rows(&|k| {
        let (p, t) = (PT.1[k], TT.1[k]);
        format!(
            r#"{{"time": "2026-03-02T08:15:0{k}Z", "data": {{"PT": {{"value": {p}, "unit": "bar"}}, "TT": {{"value": {t}}}}}}}"#
        )
    });
    for text in [
        nested.join("\n"),
        format!("[{}]", nested.join(",")),
        format!("{{\"data\": [{}]}}", nested.join(",")),
    ] {
        let recording = read(&text);
        check_times(&recording, &text);
        assert_eq!(recording.signals[0].unit, "Pa", "{text}");
        assert_eq!(signals(&recording)[1], TT);
    }
    let telegraf = rows(&|k| {
        format!(
            r#"{{"fields": {{"PT": {}, "TT": {}}}, "name": "opcua", "tags": {{"host": "edge"}}, "timestamp": 177243930{k}}}"#,
            PT.1[k], TT.1[k]
        )
    });
    check(&telegraf.join("\n"), &[PT, TT]);
    let central = rows(&|k| {
        format!(
            r#"{{"enqueuedTime": "2026-03-02T08:15:0{k}Z", "deviceId": "pump", "telemetry": {{"PT": {}, "TT": {}}}}}"#,
            PT.1[k], TT.1[k]
        )
    });
    check(&central.join("\n"), &[PT, TT]);
    let wrapped = rows(&|k| {
        format!(
            r#"{{"timestamp": "2026-03-02T08:15:0{k}Z", "PT": {}, "TT": {}}}"#,
            PT.1[k], TT.1[k]
        )
    });
    check(
        &format!("{{\"data\": [{}], \"count\": 3}}", wrapped.join(",")),
        &[PT, TT],
    );
}

#[test]
fn devices_of_one_list_are_told_apart_by_their_names() {
    let row = |k: usize, device: &str, value: f64| {
        format!(
            r#"{{"time": "2026-03-02T08:15:0{k}Z", "deviceId": "{device}", "telemetry": {{"PT": {value}}}}}"#
        )
    };
    let rows: Vec<String> = (0..3)
        .flat_map(|k| [row(k, "A", PT.1[k]), row(k, "B", 5.0)])
        .collect();
    check(&rows.join("\n"), &[("A PT", PT.1), ("B PT", &[5.0; 3])]);
    let lists = |device: &str, value: f64| {
        let rows = [0, 1, 2].map(|k| format!(r#"{{"ts": 177243930{k}, "PT": {value}}}"#));
        format!(r#"{{"device": "{device}", "data": [{}]}}"#, rows.join(","))
    };
    let expected: [(&str, &[f64]); 2] = [("A PT", &[1.0; 3]), ("B PT", &[5.0; 3])];
    check(
        &format!("[{},{}]", lists("A", 1.0), lists("B", 5.0)),
        &expected,
    );
    check(
        &format!("{}\n{}", lists("A", 1.0), lists("B", 5.0)),
        &expected,
    );
}

#[test]
fn messages_of_mqtt_are_samples_of_their_topics() {
    let message = |k: usize, topic: &str, payload: &str| {
        format!(
            r#"{{"topic": "plant/{topic}", "payload": {payload}, "timestamp": 177243930{k}000}}"#
        )
    };
    let both = |k: usize| [message(k, "A", "1.5"), message(k, "B", "65")];
    let messages: Vec<String> = (0..3).flat_map(both).collect();
    let expected: [(&str, &[f64]); 2] = [("plant/A", &[1.5; 3]), ("plant/B", &[65.0; 3])];
    check(&messages.join("\n"), &expected);
    let objects = (0..3).map(|k| message(k, "pump", r#"{"PT": 1.5, "TT": 65}"#));
    let objects: Vec<String> = objects.collect();
    check(
        &objects.join("\n"),
        &[("PT", &[1.5; 3]), ("TT", &[65.0; 3])],
    );
}

#[test]
fn messages_that_list_their_metrics_are_samples_of_these() {
    let message = |k: usize| {
        let metric = |name: &str, value: f64| {
            format!(
                r#"{{"name": "{name}", "timestamp": 177243930{k}000, "dataType": "Double", "value": {value}}}"#
            )
        };
        let metrics = [metric("PT", PT.1[k]), metric("TT", TT.1[k])].join(",");
        format!(r#"{{"timestamp": 177243930{k}000, "metrics": [{metrics}], "seq": {k}}}"#)
    };
    let recording = check(
        &format!("[{}]", [0, 1, 2].map(message).join(",")),
        &[PT, TT],
    );
    let told = |code| {
        recording
            .notes
            .iter()
            .find(|note| note.code == code)
            .map(|note| &*note.detail)
    };
    assert!(told("left_out_columns").unwrap().contains("`dataType`"));
    assert!(told("left_out_elements").unwrap().starts_with("3 objects"));
}

#[test]
fn samples_of_proficy_ask_for_the_meaning_of_their_codes() {
    let samples = (0..3).map(|k| {
        format!(
            r#"{{"TimeStamp": "2026-03-02T08:15:0{k}.000Z", "Value": "{}", "Quality": 3}}"#,
            PT.1[k]
        )
    });
    let samples: Vec<String> = samples.collect();
    let text = format!(
        r#"{{"Data": [{{"TagName": "PT", "ErrorCode": 0, "Samples": [{}]}}], "ErrorCode": 0}}"#,
        samples.join(",")
    );
    assert_eq!(fault(&text, &[]).0, "quality_scheme_needed");
    for answer in ["quality_scheme=proficy", "quality=none"] {
        assert_eq!(signals(&read_with(&text, &[answer]).unwrap()), [PT]);
    }
}

#[test]
fn a_list_of_senml_has_the_base_of_its_first_record() {
    let text = r#"[{"bn": "pump/", "bt": 1772439300, "bu": "Cel", "n": "TT", "v": 20},
                   {"n": "TT", "t": 1, "v": 21}, {"n": "TT", "t": 2, "v": 22},
                   {"n": "PT", "u": "bar", "v": 1}, {"n": "PT", "u": "bar", "t": 1, "v": 2},
                   {"n": "PT", "u": "bar", "t": 2, "v": 3}]"#;
    let recording = check(
        text,
        &[
            ("pump/TT", &[293.15, 294.15, 295.15]),
            ("pump/PT", &[1e5, 2e5, 3e5]),
        ],
    );
    assert!(codes(&recording).is_empty());
}
