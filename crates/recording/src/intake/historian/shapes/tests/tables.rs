//! Series and tables of lists.

use super::{check, codes, fault, read, read_with, signals};

const PT: (&str, &[f64]) = ("PT", &[3.2, 3.3, 3.4]);
const TT: (&str, &[f64]) = ("TT", &[65.0, 65.5, 66.0]);

#[test]
fn frames_of_pandas_are_read_in_all_their_forms() {
    let columns = r#"{"PT": {"1772439300000": 3.2, "1772439301000": 3.3, "1772439302000": 3.4},
                      "TT": {"1772439300000": 65, "1772439301000": 65.5, "1772439302000": 66}}"#;
    check(columns, &[PT, TT]);
    let index = r#"{"1772439300000": {"PT": 3.2, "TT": 65}, "1772439301000": {"PT": 3.3, "TT": 65.5},
                    "1772439302000": {"PT": 3.4, "TT": 66}}"#;
    check(index, &[PT, TT]);
    let numbered = r#"{"time": {"0": "2026-03-02T08:15:00Z", "1": "2026-03-02T08:15:01Z", "2": "2026-03-02T08:15:02Z"},
                       "PT": {"0": 3.2, "1": 3.3, "2": 3.4}, "TT": {"0": 65, "1": 65.5, "2": 66}}"#;
    check(numbered, &[PT, TT]);
    let rows = r#"{"0": {"time": "2026-03-02T08:15:00Z", "PT": 3.2}, "1": {"time": "2026-03-02T08:15:01Z", "PT": 3.3},
                   "2": {"time": "2026-03-02T08:15:02Z", "PT": 3.4}}"#;
    check(rows, &[PT]);
    let lists = r#"{"PT": [3.2, 3.3, 3.4], "TT": [65, 65.5, 66],
                    "time": ["2026-03-02T08:15:00Z", "2026-03-02T08:15:01Z", "2026-03-02T08:15:02Z"]}"#;
    check(lists, &[PT, TT]);
    let named = r#"{"value": {"1772439300": 1, "1772439301": 1, "1772439302": 1},
                    "data": {"1772439300": 2, "1772439301": 2, "1772439302": 2}}"#;
    check(
        named,
        &[("value value", &[1.0; 3]), ("data value", &[2.0; 3])],
    );
}

#[test]
fn lists_count_from_their_first_time_where_the_times_are_no_dates() {
    let recording = read(r#"{"time": [0, 0.5, 1], "p [bar]": [1, 2, 3], "q": [4, null, 6]}"#);
    assert_eq!(recording.time.sample_time(), 0.5);
    assert_eq!(signals(&recording)[0], ("p", &[1e5, 2e5, 3e5][..]));
    assert!(recording.signals[1].values[1].is_nan());
    assert_eq!(codes(&recording), ["time_unit_assumed"]);
    let recording = read(r#"{"time [ms]": [0, 500, 1000], "p": [1, 2, 3], "units": {"p": "bar"}}"#);
    assert_eq!(signals(&recording), [("p", &[1e5, 2e5, 3e5][..])]);
    assert_eq!(recording.time.sample_time(), 0.5);
    let unnamed = r#"{"x": [0, 0.5, 1], "y": [1, 2, 3], "name": "p"}"#;
    assert_eq!(fault(unnamed, &[]).0, "no_signals");
    let read = read_with(unnamed, &["time=x", "time_unit=s"]).unwrap();
    assert_eq!(signals(&read), [("p", &[1.0, 2.0, 3.0][..])]);
}

#[test]
fn lists_of_traces_are_called_as_these_are() {
    let trace = |name: &str, values: &str| {
        format!(
            r#"{{"x": ["2026-03-02T08:15:00Z", "2026-03-02T08:15:01Z", "2026-03-02T08:15:02Z"], "y": [{values}],
                "name": "{name}", "type": "scatter"}}"#
        )
    };
    let traces = format!(
        "[{},{}]",
        trace("PT", "3.2, 3.3, 3.4"),
        trace("TT", "65, 65.5, 66")
    );
    check(&traces, &[PT, TT]);
    let lines = r#"{"metric": {"__name__": "PT"}, "values": [3.2, 3.3, 3.4], "timestamps": [1772439300000, 1772439301000, 1772439302000]}
{"metric": {"__name__": "TT"}, "values": [65, 65.5, 66], "timestamps": [1772439300000, 1772439301000, 1772439302000]}"#;
    check(lines, &[PT, TT]);
}

#[test]
fn pairs_are_read_whichever_stands_first() {
    let target = |name: &str, [a, b, c]: [f64; 3]| {
        format!(
            r#"{{"target": "{name}", "datapoints": [[{a}, 1772439300000], [{b}, 1772439301000], [{c}, 1772439302000]]}}"#
        )
    };
    let answer = format!(
        "[{},{}]",
        target("PT", [3.2, 3.3, 3.4]),
        target("TT", [65.0, 65.5, 66.0])
    );
    check(&answer, &[PT, TT]);
    let sorted = r#"[{"datapoints": [[3.2, 1772439300], [3.3, 1772439301], [3.4, 1772439302]], "target": "PT"},
                     {"datapoints": [[65, 1772439300], [65.5, 1772439301], [66, 1772439302]], "target": "TT"}]"#;
    check(sorted, &[PT, TT]);
    let dps = r#"[{"metric": "PT", "tags": {}, "dps": {"1772439300": 3.2, "1772439301": 3.3, "1772439302": 3.4}},
                  {"dps": {"1772439300": 65, "1772439301": 65.5, "1772439302": 66}, "metric": "TT"}]"#;
    check(dps, &[PT, TT]);
    let bare = r#"[["2026-03-02T08:15:00Z", 3.2], ["2026-03-02T08:15:01Z", 3.3], ["2026-03-02T08:15:02Z", 3.4]]"#;
    check(bare, &[("value", PT.1)]);
    check(&format!(r#"{{"PT": {bare}}}"#), &[PT]);
    // A value that is a Unix time too stands behind the time in `values`, and in front of it in `datapoints`.
    let values = r#"{"metric": {"__name__": "start"}, "values": [[1772439300, "1700000000"], [1772439301, "1700000000"],
                     [1772439302, "1700000000"]]}"#;
    check(values, &[("start", &[1.7e9; 3])]);
}

#[test]
fn rows_stand_below_the_names_of_their_columns() {
    let kusto = r#"{"Tables": [{"TableName": "Table_0", "Columns": [{"ColumnName": "Timestamp", "DataType": "DateTime"},
        {"ColumnName": "PT", "DataType": "Double"}, {"ColumnName": "TT", "DataType": "Double"}], "RecordRows":
        [["2026-03-02T08:15:00Z", 3.2, 65], ["2026-03-02T08:15:01Z", 3.3, 65.5], ["2026-03-02T08:15:02Z", 3.4, 66]]}]}"#;
    check(kusto, &[PT, TT]);
    let long = r#"{"columns": ["time", "tag", "value", "unit"], "rows":
        [["2026-03-02T08:15:00Z", "PT", 1, "bar"], ["2026-03-02T08:15:01Z", "PT", 2, "bar"],
         ["2026-03-02T08:15:02Z", "PT", 3, "bar"]]}"#;
    check(long, &[("PT", &[1e5, 2e5, 3e5])]);
    let titled = r#"[["time", "PT", "TT"], ["2026-03-02T08:15:00Z", 3.2, 65], ["2026-03-02T08:15:01Z", 3.3, 65.5],
                     ["2026-03-02T08:15:02Z", 3.4, 66]]"#;
    check(titled, &[PT, TT]);
    let cells = |[time, p, t]: [&str; 3]| {
        format!(r#"{{"Data": [{{"ScalarValue": "{time}"}}, {{"ScalarValue": "{p}"}}, {t}]}}"#)
    };
    let rows = [
        cells([
            "2026-03-02 08:15:00.000000000",
            "3.2",
            r#"{"ScalarValue": "65"}"#,
        ]),
        cells([
            "2026-03-02 08:15:01.000000000",
            "3.3",
            r#"{"NullValue": true}"#,
        ]),
        cells([
            "2026-03-02 08:15:02.000000000",
            "3.4",
            r#"{"ScalarValue": "66"}"#,
        ]),
    ];
    let timestream = format!(
        r#"{{"RecordRows": [{}], "ColumnInfo": [{{"Name": "time", "Type": {{"ScalarType": "TIMESTAMP"}}}}, {{"Name": "PT"}}, {{"Name": "TT"}}]}}"#,
        rows.join(",")
    );
    let (code, detail) = fault(&timestream, &[]);
    assert_eq!(code, "no_offset", "{detail}");
    let recording = read_with(&timestream, &["tz=UTC"]).unwrap();
    assert_eq!(signals(&recording)[0], PT);
    assert!(recording.signals[1].values[1].is_nan());
}

#[test]
fn tokens_of_no_number_are_missing_and_told() {
    let rows = r#"[{"time": 0, "a": NaN, "b": 1}, {"time": 1, "a": 2, "b": -Infinity}, {"time": 2, "a": 3, "b": Infinity}]"#;
    let recording = read(rows);
    assert_eq!(recording.signals[0].missing(), 1);
    assert_eq!(recording.signals[1].missing(), 2);
    let note = recording
        .notes
        .iter()
        .find(|note| note.code == "words_for_missing")
        .unwrap();
    let told = "1 values are `NaN`, 1 values are `Infinity`, 1 values are `-Infinity`: missing";
    assert_eq!(note.detail, told);
    let signals = r#"{"sample_time_s": 1, "signals": {"NaN": {"values": [NaN, 2]}}}"#;
    let recording = read(signals);
    assert_eq!(
        (&*recording.signals[0].name, recording.signals[0].missing()),
        ("NaN", 1)
    );
    assert_eq!(codes(&recording), ["words_for_missing"]);
    assert_eq!(fault(r#"[{"time": 0, "a": NaNa}]"#, &[]).0, "not_json");
    assert_eq!(fault(r#"[{"time": NaN, "a": 1}]"#, &[]).0, "missing_time");
}
