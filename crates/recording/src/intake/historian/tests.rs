//! Documents that follow each other, and what InfluxDB 1 answers.

use crate::intake::{self, MediaKind, Options, ReadError};
use crate::{Recording, TimeAxis};

fn read(text: &str) -> Result<Recording, ReadError> {
    intake::read(text.as_bytes(), MediaKind::Text, &Options::default())
}

fn values<'r>(recording: &'r Recording, name: &str) -> &'r [f64] {
    &recording
        .signal(name)
        .unwrap_or_else(|| panic!("there is no {name}"))
        .values
}

const UNIFORM: TimeAxis = TimeAxis::Uniform {
    sample_time: 0.5,
    samples: 3,
};

#[test]
fn an_object_on_each_line_is_a_row() {
    let text = "{\"time\": 0, \"PT [bar]\": 1, \"TT [K]\": 290}\n{\"time\": 0.5, \"PT [bar]\": 2, \"TT [K]\": 291}\n\n\
                {\"time\": 1, \"PT [bar]\": 3, \"TT [K]\": null}\n";
    let recording = read(text).unwrap();
    assert_eq!(recording.source.format, "pandas_records");
    assert_eq!(recording.time, UNIFORM);
    assert_eq!(values(&recording, "PT"), [1e5, 2e5, 3e5]);
    assert!(values(&recording, "TT")[2].is_nan());
    let broken = read(&format!("{text}{{\"time\": ")).unwrap_err();
    assert_eq!(
        (&*broken.faults()[0].code, broken.faults()[0].line),
        ("not_json", Some(5))
    );
    let wrong = read(&text.replace("2,", "\"x\",")).unwrap_err();
    assert_eq!(wrong.faults()[0].pointer.as_deref(), Some("/1"), "{wrong}");
}

#[test]
fn an_object_for_each_sample_names_its_tag() {
    let sample = |time: f64, tag: &str, value: f64, unit: &str| {
        format!(
            "{{\"timestamp\": {time}, \"tag\": \"{tag}\", \"value\": {value}, \"unit\": \"{unit}\"}}"
        )
    };
    let of_time = |k: u8| {
        let time = 1.7e9 + 0.5 * f64::from(k);
        [
            sample(time, "PT", f64::from(k), "bar"),
            sample(time, "TT", 290.0, "K"),
        ]
    };
    let samples: Vec<String> = (0..3).flat_map(of_time).collect();
    for text in [samples.join("\n"), format!("[{}]", samples.join(","))] {
        let recording = read(&text).unwrap();
        assert_eq!(recording.time, UNIFORM, "{text}");
        assert_eq!(values(&recording, "PT"), [0.0, 1e5, 2e5]);
        assert_eq!(recording.signal("TT").unwrap().unit, "K");
    }
}

#[test]
fn what_influxdb_1_answers_is_read_by_series() {
    let series = |rig: &str, first: f64| {
        format!(
            r#"{{"name": "oil", "tags": {{"rig": "{rig}"}}, "columns": ["time", "p", "state"], "values":
            [["2026-03-02T08:15:00Z", {first}, "RUN"], ["2026-03-02T08:15:00.5Z", 2, "RUN"],
             ["2026-03-02T08:15:01Z", null, "RUN"]]}}"#
        )
    };
    let text =
        |series: &str| format!(r#"{{"results": [{{"statement_id": 0, "series": [{series}]}}]}}"#);
    let single = read(&text(&series("A", 1.0))).unwrap();
    assert_eq!(single.source.format, "influx_json");
    assert_eq!(single.time, UNIFORM);
    assert_eq!(values(&single, "p")[..2], [1.0, 2.0]);
    assert_eq!(single.start.unwrap().to_string(), "2026-03-02T08:15:00Z");
    let two = read(&text(&format!("{},{}", series("A", 1.0), series("B", 5.0)))).unwrap();
    assert_eq!(values(&two, "oil,rig=B p")[0], 5.0);
    assert_eq!(values(&two, "oil,rig=A p")[0], 1.0);
}
