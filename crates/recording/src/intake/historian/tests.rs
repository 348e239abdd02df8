//! Documents that follow each other, and what InfluxDB 1 answers.

use crate::intake::{self, Format, MediaKind, Options, ReadError};
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

fn read_with(text: &str, given: &[(&str, &str)]) -> Result<Recording, ReadError> {
    let mut options = Options::default();
    for (option, text) in given {
        options.set(option, text).unwrap();
    }
    intake::read(text.as_bytes(), MediaKind::Text, &options)
}

/// An answer of Cognite with two datapoints of these fields, and these fields beside them.
fn datapoints(points: [&str; 2], before: &str, behind: &str) -> String {
    let [first, second] = points;
    format!(
        r#"{{"items": [{{"externalId": "PT"{before}, "datapoints": [{{"timestamp": 1772439300000, {first}}},
            {{"timestamp": 1772439301000, {second}}}]{behind}}}]}}"#
    )
}

#[test]
fn the_one_aggregate_of_cognite_is_the_value_and_several_are_asked_about() {
    let averages = datapoints(
        [r#""average": 3"#, r#""average": 4"#],
        r#", "unit": "bar""#,
        "",
    );
    assert_eq!(values(&read(&averages).unwrap(), "PT"), [3e5, 4e5]);
    let counts = datapoints([r#""count": 3"#, r#""count": 4"#], "", r#", "unit": "bar""#);
    let counted = read(&counts).unwrap();
    assert_eq!(values(&counted, "PT"), [3.0, 4.0]);
    assert_eq!(counted.signals[0].unit, "");
    let point = r#""average": 3, "max": 5, "count": 7"#;
    let several = datapoints([point, point], r#", "unit": "bar""#, "");
    let asked = read(&several).unwrap_err();
    let fault = &asked.faults()[0];
    assert_eq!(
        (&*fault.code, fault.parameter.as_deref()),
        ("layout_unclear", Some("value"))
    );
    let max = read_with(&several, &[("value", "max")]).unwrap();
    assert_eq!(values(&max, "PT"), [5e5, 5e5]);
    let both = read_with(&several, &[("value", "max,count")]).unwrap();
    assert_eq!(
        (values(&both, "PT.max")[0], values(&both, "PT.count")[0]),
        (5e5, 7.0)
    );
}

#[test]
fn a_unit_of_the_catalog_of_cognite_is_read_before_and_behind_the_datapoints() {
    let points = [r#""value": 1"#, r#""value": 2"#];
    for (id, unit, si) in [
        ("pressure:bar", "Pa", [1e5, 2e5]),
        ("temperature:deg_c", "K", [274.15, 275.15]),
        ("x:parsec", "", [1.0, 2.0]),
    ] {
        let id = format!(r#", "unitExternalId": "{id}""#);
        for text in [datapoints(points, &id, ""), datapoints(points, "", &id)] {
            let recording = read(&text).unwrap();
            assert_eq!(
                (values(&recording, "PT"), &*recording.signals[0].unit),
                (&si[..], unit),
                "{text}"
            );
        }
    }
}

#[test]
fn a_quality_beside_a_value_of_omf_rates_it() {
    let text = |quality: [&str; 3]| {
        let value = |k: usize| {
            format!(
                r#"{{"Timestamp": "2026-03-02T08:15:0{k}Z", "Value": {k}, "Quality": {}}}"#,
                quality[k]
            )
        };
        format!(
            r#"[{{"containerid": "PT", "values": [{}]}}]"#,
            [0, 1, 2].map(value).join(",")
        )
    };
    let good = read(&text(["192"; 3])).unwrap();
    assert_eq!(
        (good.signals.len(), values(&good, "PT")),
        (1, &[0.0, 1.0, 2.0][..])
    );
    let coded = text(["192", "0", "192"]);
    assert_eq!(
        &*read(&coded).unwrap_err().faults()[0].code,
        "quality_scheme_needed"
    );
    let rated = read_with(&coded, &[("quality_scheme", "opc_da")]).unwrap();
    assert!(values(&rated, "PT")[1].is_nan());
    let properties = r#"[{"containerid": "rig", "values": [{"Timestamp": "2026-03-02T08:15:00Z", "p": 1, "Quality": 7},
                          {"Timestamp": "2026-03-02T08:15:01Z", "p": 2, "Quality": 8}]}]"#;
    assert_eq!(
        values(&read(properties).unwrap(), "rig.Quality"),
        [7.0, 8.0]
    );
}

#[test]
fn a_long_document_of_this_service_is_told_from_its_times() {
    for head in [
        &b"{\"time\": {\"values\": [0, 1, 2"[..],
        b"{\"name\": \"a\", \"time\" : { \"unit\": \"ms\", \"values\": [0",
        b"{\"sample_time_s\": 0.1, ",
    ] {
        assert_eq!(super::recognised(head), Format::Json);
    }
    for head in [
        &b"{\"time\": [0, 1, 2"[..],
        b"{\"time\": {\"0\": 1",
        b"{\"PT\": {\"values\": [1",
    ] {
        assert_eq!(super::recognised(head), Format::JsonSeries);
    }
}
