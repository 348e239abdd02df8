//! The limits in the description of the API are those that the readers keep.

use std::collections::HashMap;

use greybox::identification::spec::Context;
use greybox::identification::spec::design::DesignRequest;
use greybox::identification::{DatasetId, JobSpec};
use greybox::model::Catalogue;
use greybox::parsing::Fault;
use greybox::recording::Recording;
use greybox_service::monitor::MonitorSpec;
use serde_json::{Value, json};

/// The relative step from a limit to the next number, of numbers that are not whole.
const STEP: f64 = 1e-9;

/// A number of a document that the description limits.
struct Limited {
    pointer: String,
    schema: Value,
}

/// The description of the API, walked beside a document.
struct Walk<'a> {
    components: &'a Value,
    document: &'a Value,
    limited: Vec<Limited>,
}

impl Walk<'_> {
    fn visit(&mut self, schema: &Value, pointer: &str) {
        if let Some(reference) = schema["$ref"].as_str() {
            let name = reference.rsplit('/').next().expect("a name");
            let schema = self.components[name].clone();
            return self.visit(&schema, pointer);
        }
        let limits = ["minimum", "maximum", "exclusiveMinimum"];
        if limits.iter().any(|limit| schema.get(limit).is_some()) {
            self.limited.push(Limited {
                pointer: pointer.to_owned(),
                schema: schema.clone(),
            });
        }
        for (name, property) in schema["properties"].as_object().into_iter().flatten() {
            self.visit(property, &format!("{pointer}/{name}"));
        }
        let here = self.document.pointer(pointer);
        let entries = here.and_then(Value::as_object).into_iter().flatten();
        for (name, _) in entries.filter(|_| schema["additionalProperties"].is_object()) {
            self.visit(
                &schema["additionalProperties"],
                &format!("{pointer}/{name}"),
            );
        }
        let n_items = here.and_then(Value::as_array).map_or(0, Vec::len);
        for place in (0..n_items).filter(|_| schema["items"].is_object()) {
            self.visit(&schema["items"], &format!("{pointer}/{place}"));
        }
        for variants in ["allOf", "oneOf", "anyOf"] {
            for variant in schema[variants].as_array().into_iter().flatten() {
                self.visit_variant(variant, pointer);
            }
        }
    }

    /// Of one shape among several only what the document has.
    fn visit_variant(&mut self, variant: &Value, pointer: &str) {
        let before = self.limited.len();
        self.visit(variant, pointer);
        let new = self.limited.split_off(before);
        let document = self.document;
        let is_there = |limited: &Limited| document.pointer(&limited.pointer).is_some();
        self.limited.extend(new.into_iter().filter(is_there));
    }
}

/// The document with a number in a place, whatever was there.
fn with(document: &Value, pointer: &str, number: Value) -> Value {
    let mut document = document.clone();
    let mut place = &mut document;
    for token in pointer.split('/').skip(1) {
        place = match place {
            Value::Array(items) => &mut items[token.parse::<usize>().expect("an index")],
            object => &mut object[token],
        };
    }
    *place = number;
    document
}

fn numbers(schema: &Value, limit: f64) -> [Value; 3] {
    let is_whole = schema["type"] == "integer" || schema["type"][0] == "integer";
    let step = match is_whole {
        true => 1.0,
        false => limit.abs().max(1e-3) * STEP,
    };
    [limit - step, limit, limit + step].map(|number| match is_whole {
        true => json!(number as i64),
        false => json!(number),
    })
}

/// Compares the limits of a schema with what a reader says of numbers at them and beyond them, and
/// counts the limits.
fn compare(
    (components, schema): (&Value, &str),
    document: &Value,
    read: impl Fn(&Value) -> Vec<Fault>,
) -> usize {
    let mut walk = Walk {
        components,
        document,
        limited: Vec::new(),
    };
    walk.visit(&components[schema], "");
    let accepts = |pointer: &str, number: &Value| {
        let faults = read(&with(document, pointer, number.clone()));
        let is_limit = |fault: &Fault| {
            let codes = ["out_of_range", "not_positive", "outside_recording"];
            codes.contains(&&*fault.code)
        };
        !faults
            .iter()
            .any(|fault| fault.pointer() == pointer && is_limit(fault))
    };
    let mut compared = 0;
    for Limited { pointer, schema } in &walk.limited {
        let mut check = |number: &Value, is_allowed: bool| {
            assert_eq!(accepts(pointer, number), is_allowed, "{pointer}: {number}");
            compared += 1;
        };
        if let Some(limit) = schema["minimum"].as_f64() {
            let [below, at, _] = numbers(schema, limit);
            check(&below, false);
            check(&at, true);
        }
        if let Some(limit) = schema["maximum"].as_f64() {
            let [_, at, above] = numbers(schema, limit);
            check(&at, true);
            check(&above, false);
        }
        if let Some(limit) = schema["exclusiveMinimum"].as_f64() {
            check(&json!(limit), false);
            check(&json!(limit + 1.0), true);
        }
    }
    compared
}

#[test]
fn numbers_at_the_described_limits_are_taken_and_numbers_beyond_them_refused() {
    let description = include_str!("../../openapi/openapi.json");
    let description: Value = serde_json::from_str(description).expect("a description");
    let components = &description["components"]["schemas"];
    let dataset = DatasetId::new();
    let samples = (0..100).map(f64::from).collect::<Vec<f64>>();
    let signals = [("force", "N", samples.clone()), ("position", "m", samples)];
    let datasets = HashMap::from([(dataset, Recording::from_samples(0.1, signals).summary())]);
    let catalogue = Catalogue::built_in();
    let context = Context {
        models: catalogue.iter().map(|model| model.description()).collect(),
        datasets: &datasets,
        versions: None,
        max_duration_s: f64::INFINITY,
    };
    let job = json!({
        "model": "positioning_drive",
        "experiments": [
            {"dataset": dataset},
            {"dataset": dataset, "role": "validation", "window": {"from_s": 0, "to_s": 5}}
        ],
        "parameters": {
            "mass": {"estimate": {}, "prior": {"mean": 2, "std": 1}},
            "offset": {"value": 0}
        },
        "outputs": {"position": {"noise_std": 1e-3}},
        "seed": 1
    });
    let read_job = |document: &Value| JobSpec::read(document, &context).err().unwrap_or_default();
    assert_eq!(read_job(&job), []);
    assert!(compare((components, "JobSpec"), &job, read_job) > 70);

    let monitor = json!({
        "stream": "rig-4", "window": {"length_s": 60}, "job": {},
        "only_when": {"signal": "force", "moves_more_than": 0.1},
        "drift": {"mass": {"std": 1, "per_s": 1}}
    });
    let read_monitor = |document: &Value| MonitorSpec::read(document).err().unwrap_or_default();
    assert_eq!(read_monitor(&monitor), []);
    assert!(compare((components, "MonitorSpec"), &monitor, read_monitor) > 15);

    let design = components["DesignDocument"]["example"].clone();
    let read_design = |document: &Value| {
        let read = DesignRequest::new(document.clone()).read(&context.models, None);
        read.err().unwrap_or_default()
    };
    assert_eq!(read_design(&design), []);
    assert!(compare((components, "DesignDocument"), &design, read_design) > 10);
}
