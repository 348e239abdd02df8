//! What senders of OMF write, and what becomes of it under a mapping.

use super::*;
use crate::intake::spread::{
    LastValue, MappedSignal, Mapping, MappingRule, RefusedPoints, WrittenSamples,
};
use crate::{Class, Interpolation};
use flate2::{Compression, write::GzEncoder};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::Write as _;

/// The headers of a message.
fn header(version: &str, message_type: &str, action: &str) -> Result<OmfHeader, String> {
    OmfHeader::read(|name| match name {
        "omfversion" => Some(version),
        "messagetype" => Some(message_type),
        "action" if !action.is_empty() => Some(action),
        _ => None,
    })
}

fn message(version: &str, message_type: &str, body: &Value) -> OmfMessage {
    let header = header(version, message_type, "").unwrap();
    read(body.to_string().as_bytes(), header).unwrap()
}

fn definitions(message: OmfMessage) -> OmfDefinitions {
    match message {
        OmfMessage::Definitions(definitions) => definitions,
        OmfMessage::Data(data) => panic!("definitions: {data:?}"),
    }
}

fn data(message: OmfMessage) -> OmfData {
    match message {
        OmfMessage::Data(data) => data,
        OmfMessage::Definitions(definitions) => panic!("data: {definitions:?}"),
    }
}

/// A tank's pressure and its valve, an enumeration and a property of quality.
fn types() -> Value {
    json!([
        {"id": "ValveState", "enum": {"type": "integer", "format": "int16", "values": [
            {"name": "Closed", "value": 0}, {"name": "Open", "value": 1}]}},
        {"id": "Tank", "type": "object", "classification": "dynamic", "properties": {
            "Batch": {"type": "string", "isindex": true},
            "Timestamp": {"type": "string", "format": "date-time", "isindex": true},
            "Pressure": {"type": "number", "uom": "bar", "interpolation": "continuous"},
            "Valve": {"reftypeid": "ValveState", "interpolation": "stepwisecontinuousleading"},
            "Quality": {"type": "integer", "isquality": true}}}
    ])
}

fn containers() -> Value {
    json!([
        {"id": "Tank-1", "typeid": "Tank"},
        {"id": "Tank-2", "typeid": "Tank", "propertyoverrides": {"Pressure": {"uom": "kPa"}}}
    ])
}

/// The containers that types and containers come to.
fn defined(bodies: [OmfMessage; 2]) -> BTreeMap<String, DefinedContainer> {
    let (mut types, mut containers) = (BTreeMap::new(), BTreeMap::new());
    for change in bodies
        .into_iter()
        .flat_map(|body| definitions(body).changes)
    {
        match change {
            DefinitionChange::Stored(key, OmfDefinition::Type(definition)) => {
                types.insert(key.id, definition);
            }
            DefinitionChange::Stored(key, OmfDefinition::Container(definition)) => {
                containers.insert(key.id, definition);
            }
            DefinitionChange::Removed(key) => panic!("{key:?} is removed"),
        }
    }
    let containers = containers.into_iter();
    let containers = containers
        .filter_map(|(id, container)| Some((id, DefinedContainer::of(&container, &types)?)));
    containers.collect()
}

fn tanks() -> BTreeMap<String, DefinedContainer> {
    let types = message("1.2", "type", &types());
    defined([types, message("1.2", "container", &containers())])
}

fn rule(container: &str, codes: Option<&str>) -> MappingRule {
    let signal = |name: &str| MappedSignal {
        signal: name.to_owned(),
        unit: String::new(),
        interpolation: None,
    };
    let mut rule: MappingRule = serde_json::from_value(json!({
        "measurement": container, "stream": "tanks", "signals": {}
    }))
    .unwrap();
    rule.signals = [("Pressure", "p"), ("Valve", "valve")]
        .map(|(field, name)| (field.to_owned(), signal(&format!("{name}-{container}"))))
        .into();
    if let Some(codes) = codes {
        rule.quality = Some(serde_json::from_value(json!({"codes": codes})).unwrap());
    }
    rule
}

fn mapping(codes: Option<&str>) -> Mapping {
    Mapping {
        rules: vec![rule("Tank-1", codes), rule("Tank-2", codes)],
    }
}

fn spread_values(body: &Value, codes: Option<&str>) -> WrittenSamples {
    let data = data(message("1.2", "data", body));
    spread(data, mapping(codes), &tanks(), i64::MAX).unwrap()
}

/// The values of a signal, missing ones as nothing.
fn values(written: &WrittenSamples, signal: &str) -> Vec<Option<f64>> {
    let batch = &written.batches[0].batch;
    let place = batch.signals.iter().position(|s| s.name == signal).unwrap();
    let values = batch.rows.columns[place].values.iter();
    values
        .map(|value| (!value.is_nan()).then_some(*value))
        .collect()
}

#[test]
fn a_value_lands_in_the_units_and_courses_that_its_container_declares() {
    let written = spread_values(
        &json!([
            {"containerid": "Tank-1", "values": [
                {"Timestamp": "2026-03-02T08:15:00.1234567Z", "Batch": "b", "Pressure": 1.5, "Valve": "Open"},
                {"Timestamp": "2026-03-02T09:15:01+01:00", "Batch": "b", "Pressure": null, "Valve": 0}]},
            {"containerid": "Tank-2", "values": [
                {"Timestamp": "2026-03-02T08:15:01Z", "Pressure": 150, "Valve": "Closed"}]}
        ]),
        None,
    );
    assert_eq!(
        (written.taken, &written.refused),
        (3, &RefusedPoints::default())
    );
    let batch = &written.batches[0].batch;
    assert_eq!(written.batches[0].stream, "tanks");
    assert_eq!(
        batch.rows.instants,
        [1_772_439_300_123_456_700, 1_772_439_301_000_000_000]
    );
    assert_eq!(values(&written, "p-Tank-1"), [Some(1.5e5), None]);
    assert_eq!(values(&written, "p-Tank-2"), [None, Some(1.5e5)]);
    assert_eq!(values(&written, "valve-Tank-1"), [Some(1.0), Some(0.0)]);
    for signal in &batch.signals {
        let (unit, recorded, course) = match signal.name.as_str() {
            "p-Tank-1" => ("Pa", "bar", Interpolation::Linear),
            "p-Tank-2" => ("Pa", "kPa", Interpolation::Linear),
            _ => ("", "", Interpolation::Hold),
        };
        let declared = (
            signal.unit.as_str(),
            signal.recorded_unit.as_str(),
            signal.interpolation,
        );
        assert_eq!(declared, (unit, recorded, Some(course)), "{}", signal.name);
    }
    let unmapped: Vec<&str> = written
        .unmapped
        .iter()
        .map(|series| series.field.as_str())
        .collect();
    assert_eq!(
        unmapped,
        ["Batch"],
        "the rest of a compound index is a series as any other"
    );
    assert_eq!(
        written.unmapped[0].last_value,
        LastValue::Text("b".to_owned())
    );
}

#[test]
fn quality_is_read_by_the_codes_of_the_rule_and_never_guessed() {
    let body = json!([{"containerid": "Tank-1", "values": [
        {"Timestamp": "2026-03-02T08:15:00Z", "Pressure": 1, "Quality": 192},
        {"Timestamp": "2026-03-02T08:15:01Z", "Pressure": 2, "Quality": 0},
        {"Timestamp": "2026-03-02T08:15:02Z", "Pressure": 3, "Quality": "Uncertain"}
    ]}]);
    let written = spread_values(&body, Some("opc_da"));
    assert_eq!(values(&written, "p-Tank-1"), [Some(1e5), None, Some(3e5)]);
    let classes = &written.batches[0].batch.rows.columns[0].classes;
    assert_eq!(classes, &[Class::Good, Class::Bad, Class::Uncertain]);
    let written = spread_values(&body, Some("opc_ua"));
    assert_eq!(
        values(&written, "p-Tank-1"),
        [Some(1e5), Some(2e5), Some(3e5)]
    );
    let written = spread_values(&body, None);
    assert_eq!((written.taken, written.refused.points), (1, 2));
    let told = &written.refused.told[0];
    assert!(
        told.contains("quality `192` in field \"Quality\""),
        "{told}"
    );
}

#[test]
fn what_cannot_be_taken_is_told_and_keeps_nothing_else_out() {
    let written = spread_values(
        &json!([
            {"containerid": "Tank-3", "values": [{"Timestamp": "2026-03-02T08:15:00Z", "Pressure": 1}, {}]},
            {"containerid": "Tank-1", "values": [
                {"Pressure": 1},
                {"Timestamp": "2026-03-02T08:15:00", "Pressure": 1},
                {"Timestamp": "2026-03-02T08:15:00Z", "Pressure": "high"},
                {"Timestamp": "2026-03-02T08:15:00Z", "Valve": "Ajar"},
                7,
                {"Timestamp": "2026-03-02T08:15:00Z", "Pressure": "NaN", "Valve": true}]},
            {"containerid": "Tank-2"},
            {"values": []},
            {"typeid": "__Link", "values": [{"source": {"typeid": "Tank"}, "target": {}}]}
        ]),
        None,
    );
    assert_eq!((written.taken, written.refused.points), (1, 9));
    let told = written.refused.told.join("\n");
    for sentence in [
        "container \"Tank-3\": it is not defined here",
        "container \"Tank-1\": a value has no `Timestamp`, which is its instant",
        "\"2026-03-02T08:15:00\", which is no instant with its offset",
        "input field \"Pressure\" on measurement \"Tank-1\" is type string",
        "input field \"Valve\" on measurement \"Tank-1\" is type string",
        "container \"Tank-1\": a value is no object",
        "container \"Tank-2\": `values` is no array",
        "`containerid` is missing",
    ] {
        assert!(told.contains(sentence), "{sentence} in {told}");
    }
    assert_eq!(values(&written, "valve-Tank-1"), [Some(1.0)]);
}

#[test]
fn a_unit_that_is_not_known_or_another_than_the_signal_has_is_told() {
    let bodies = [
        message(
            "1.2",
            "type",
            &json!([
                {"id": "T", "properties": {
                    "Time": {"type": "string", "format": "date-time", "isindex": true},
                    "Pressure": {"type": "number", "uom": "furlong squared"}}},
                {"id": "U", "properties": {
                    "Time": {"type": "string", "format": "date-time", "isindex": true},
                    "Pressure": {"type": "number", "uom": "mm"}}}
            ]),
        ),
        message(
            "1.2",
            "container",
            &json!([
                {"id": "Tank-1", "typeid": "T"}, {"id": "Tank-2", "typeid": "U"}, {"id": "Tank-4", "typeid": "V"}
            ]),
        ),
    ];
    let containers = defined(bodies);
    assert!(!containers.contains_key("Tank-4"), "its type is not there");
    let mut mapping = mapping(None);
    let third = MappingRule {
        measurement: "Tank-2".to_owned(),
        ..mapping.rules[0].clone()
    };
    mapping.rules = vec![mapping.rules[0].clone(), third];
    mapping.rules[1]
        .signals
        .values_mut()
        .for_each(|signal| signal.signal = "shared".to_owned());
    let values = json!([{"Time": "2026-03-02T08:15:00Z", "Pressure": 1}]);
    let body = json!([{"containerid": "Tank-1", "values": values}, {"containerid": "Tank-2", "values": values}]);
    let written = spread(
        data(message("1.0", "data", &body)),
        mapping.clone(),
        &containers,
        i64::MAX,
    )
    .unwrap();
    assert_eq!(written.refused.points, 2);
    assert!(
        written.refused.told[0].contains("`furlong squared`, which is no unit"),
        "{:?}",
        written.refused
    );
    assert!(
        written.refused.told[1].contains("signal \"shared\" of stream \"tanks\" in"),
        "{:?}",
        written.refused
    );
    // The word of the mapping counts before that of the container.
    mapping.rules.pop();
    for signal in mapping.rules[0].signals.values_mut() {
        signal.unit = "bar".to_owned();
    }
    let written = spread(
        data(message("1.0", "data", &body)),
        mapping,
        &containers,
        i64::MAX,
    )
    .unwrap();
    assert_eq!(self::values(&written, "p-Tank-1"), [Some(1e5)]);
}

#[test]
fn the_second_version_says_the_same_in_named_arrays() {
    let schema = message(
        "2.0",
        "schema",
        &json!({"Containers": containers(), "types": types(), "relationships": []}),
    );
    let nothing = message("2.0", "schema", &json!([{"types": []}]));
    assert_eq!(defined([schema, nothing]), tanks());
    let values = json!([{"containerid": "Tank-1", "values": [
        {"Timestamp": "2026-03-02T08:15:00Z", "Pressure": 2}]}]);
    let instance = message(
        "2.0",
        "instance",
        &json!({"streamingData": values, "entities": [{"typeid": "Plant"}]}),
    );
    let written = spread(data(instance), mapping(None), &tanks(), i64::MAX).unwrap();
    assert_eq!(self::values(&written, "p-Tank-1"), [Some(2e5)]);
}

#[test]
fn headers_that_are_not_understood_are_told() {
    for (version, message_type, action, word) in [
        ("2.0", "data", "", "2.0 schema or instance"),
        ("1.2", "schema", "", "type, container or data"),
        ("3.0", "type", "", "`omfversion`"),
        ("1.1", "Type", "patch", "create, update or delete"),
    ] {
        let told = header(version, message_type, action).unwrap_err();
        assert!(told.contains(word), "{told}");
    }
    assert!(
        OmfHeader::read(|_| None)
            .unwrap_err()
            .contains("messagetype")
    );
    let removed = header("1.2", "Container", "DELETE").unwrap();
    let removed = read(&br#"[{"id": "Tank-1", "typeid": "Tank"}, {}]"#[..], removed).unwrap();
    let removed = definitions(removed);
    let key = DefinitionKey {
        kind: DefinitionKind::Container,
        id: "Tank-1".to_owned(),
    };
    assert_eq!(removed.changes, [DefinitionChange::Removed(key)]);
    assert_eq!(removed.refused.told, ["container 1: `id` is missing"]);
    let delete = header("1.2", "data", "delete").unwrap();
    let told = read(&b"[]"[..], delete).unwrap_err().to_string();
    assert!(told.contains("DELETE /v1/streams"), "{told}");
}

#[test]
fn a_packed_body_is_read_and_one_that_is_too_large_is_refused() {
    let packed = |text: &[u8]| {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(text).unwrap();
        encoder.finish().unwrap()
    };
    let body = types().to_string();
    let types = header("1.2", "type", "").unwrap();
    let read_packed = definitions(read(&packed(body.as_bytes())[..], types).unwrap());
    assert_eq!(read_packed.changes.len(), 2);
    let cut = read(&packed(body.as_bytes())[..40], types).unwrap_err();
    assert!(matches!(cut, OmfError::Source(_)), "{cut}");
    let large = vec![b' '; usize::try_from(MOST_OMF_BYTES).unwrap() + 1];
    assert!(matches!(read(&large[..], types), Err(OmfError::TooLarge)));
    let no_json = read(&b"[{]"[..], types).unwrap_err().to_string();
    assert!(no_json.starts_with("no JSON: "), "{no_json}");
    let object = read(&b"{}"[..], types).unwrap_err().to_string();
    assert!(object.contains("an array"), "{object}");
}

#[test]
fn a_definition_is_kept_as_it_came() {
    let changes = definitions(message("1.2", "type", &types())).changes;
    let containers = definitions(message("1.2", "container", &containers())).changes;
    for change in changes.into_iter().chain(containers) {
        let DefinitionChange::Stored(_, definition) = change else {
            panic!("it is stored: {change:?}");
        };
        let text = serde_json::to_string(&definition).unwrap();
        assert_eq!(
            serde_json::from_str::<OmfDefinition>(&text).unwrap(),
            definition,
            "{text}"
        );
    }
}

#[test]
fn a_rule_of_a_container_without_values_leaves_a_signal_its_declared_unit() {
    let mut mapping = mapping(None);
    let earlier = MappingRule {
        measurement: "Tank-9".to_owned(),
        ..mapping.rules[0].clone()
    };
    mapping.rules.insert(0, earlier);
    let body = json!([{"containerid": "Tank-1", "values": [
        {"Timestamp": "2026-03-02T08:15:00Z", "Pressure": 1.5}]}]);
    let data = data(message("1.2", "data", &body));
    let written = spread(data, mapping, &tanks(), i64::MAX).unwrap();
    let signal = &written.batches[0].batch.signals[0];
    let names = (signal.name.as_str(), signal.unit.as_str());
    assert_eq!(names, ("p-Tank-1", "Pa"));
    assert_eq!(values(&written, "p-Tank-1"), [Some(1.5e5)]);
}
