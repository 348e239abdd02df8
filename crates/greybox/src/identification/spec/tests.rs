//! What a submitted document becomes, and what is said about a wrong one.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::*;
use greybox_recording::Summary;
use greybox_simulation::model::{
    InitialState, ParameterDescription, SignalDescription, StateDescription,
};

pub(super) const DATASET: &str = "ds_0192d3a4b5c67d8e9f00112233445566";

fn signal(name: &'static str, unit: &'static str) -> SignalDescription {
    SignalDescription::new(name, unit, "")
}

fn state(name: &'static str, unit: &'static str) -> StateDescription {
    StateDescription {
        name: name.into(),
        unit: unit.into(),
        meaning: "".into(),
        initial: InitialState::Model,
    }
}

fn parameter(name: &'static str, unknown_by_default: bool) -> ParameterDescription {
    ParameterDescription {
        name: name.into(),
        symbol: "".into(),
        unit: "kg".into(),
        meaning: "".into(),
        default: 58.0,
        lower: 20.0,
        upper: 120.0,
        scale: greybox_simulation::model::Scale::Log,
        unknown_by_default,
        minimum: Some(0.0),
        maximum: Some(1e4),
        tolerance: None,
        tolerance_source: None,
    }
}

/// A cart that is driven by a reference or by a command.
fn cart() -> ModelDescription {
    ModelDescription {
        name: "cart".into(),
        title: "".into(),
        summary: "".into(),
        input_sets: vec![vec!["reference".into()], vec!["command".into()]],
        inputs: vec![signal("reference", "m"), signal("command", "1")],
        states: vec![state("position", "m"), state("velocity", "m/s")],
        sampled: Vec::new(),
        outputs: vec![signal("position", "m"), signal("velocity", "m/s")],
        parameters: vec![parameter("mass", true), parameter("load", false)],
        equations: vec![],
        source: "".into(),
    }
}

/// Ten seconds of `position`, `reference`, a pressure and two more under other names.
fn recording() -> Summary {
    let names = [
        ("reference", "m"),
        ("position", "m"),
        ("p1", "Pa"),
        ("u", ""),
        ("x", "m"),
    ];
    let signals = names.map(|(name, unit)| {
        json!({"name": name, "unit": unit, "recorded_unit": unit, "missing": 0,
               "min": 0.0, "max": 0.0, "mean": 0.0})
    });
    let summary = json!({"samples": 1001, "duration_s": 10.0, "sample_time_s": 0.01,
                         "uniform": true, "signals": signals, "report": {"warnings": []}});
    serde_json::from_value(summary).unwrap()
}

pub(super) fn read(document: &Value) -> Result<JobSpec, Vec<Fault>> {
    let datasets = HashMap::from([(DATASET.parse().unwrap(), recording())]);
    let cart = cart();
    let context = Context {
        models: vec![&cart],
        datasets: &datasets,
        versions: None,
        max_duration_s: 7200.0,
    };
    JobSpec::read(document, &context)
}

/// The pointers and codes of what is wrong with the smallest job after `change`.
pub(super) fn faults(change: impl FnOnce(&mut Value)) -> Vec<(String, String)> {
    let mut document = json!({"model": "cart", "experiments": [{"dataset": DATASET}]});
    change(&mut document);
    let faults = read(&document).expect_err("the document is wrong");
    let pairs = faults.into_iter();
    pairs
        .map(|fault| (fault.pointer().to_owned(), fault.code.into_owned()))
        .collect()
}

pub(super) fn pair(pointer: &str, code: &str) -> (String, String) {
    (pointer.into(), code.into())
}

#[test]
fn model_and_recording_alone_estimate_what_the_model_calls_unknown() {
    let document = json!({"model": "cart", "experiments": [{"dataset": DATASET}]});
    let spec = read(&document).unwrap();
    let completed = json!(spec.parameters);
    let range = json!({"lower": 20.0, "upper": 120.0, "scale": "log"});
    assert_eq!(completed["mass"], json!({"estimate": range}));
    assert_eq!(completed["load"], json!({"value": 58.0}));
    let signals: Vec<_> = spec.experiments[0].signals.keys().collect();
    assert_eq!(signals, ["position", "reference"]);
    assert_eq!(spec.method, Settings::default());
    assert_eq!(spec.limits.max_duration_s, 3600.0);
}

#[test]
fn a_completed_specification_reads_back_to_itself() {
    let document = json!({
        "name": "rig", "labels": {"site": "hall 2"}, "model": "cart",
        "experiments": [{
            "dataset": DATASET,
            "signals": {"command": "u", "position": "x"},
            "window": {"from_s": 1, "to_s": 9.5},
            "initial_state": {"position": "first_sample",
                              "velocity": {"estimate": {"lower": -1, "upper": 1},
                                           "prior": {"range_95": [-0.1, 0.2]}}}
        }, {"dataset": DATASET, "initial_state": {"velocity": 0.5}}],
        "parameters": {"mass": {"estimate": {"lower": 1, "scale": "linear"},
                                "prior": {"mean": 58, "std": 2, "scale": "log"}},
                       "load": {"value": 3, "tolerance": "2 %"}},
        "outputs": {"position": {"noise_std": 1e-5}},
        "method": {"population": 12, "credit_form": "paper", "cost_target": 1e-3},
        "validation": {"fraction": 0}, "limits": {"max_duration_s": 5}, "seed": 7
    });
    let spec = read(&document).unwrap();
    let completed = serde_json::to_value(&spec).unwrap();
    assert_eq!(read(&completed).unwrap(), spec);
    assert_eq!(serde_json::from_value::<JobSpec>(completed).unwrap(), spec);
    assert_eq!(spec.method.population, 12);
    assert_eq!(spec.seed, 7);
}

#[test]
fn a_seed_that_is_not_given_is_drawn_and_every_client_can_keep_it() {
    let document = json!({"model": "cart", "experiments": [{"dataset": DATASET}]});
    let seeds: Vec<u64> = (0..20).map(|_| read(&document).unwrap().seed).collect();
    assert!(seeds.iter().all(|seed| *seed <= MAX_SEED));
    let distinct: std::collections::HashSet<_> = seeds.iter().collect();
    assert_eq!(distinct.len(), seeds.len());
}

#[test]
fn all_faults_are_told_at_once() {
    let found = faults(|document| {
        document["parameters"] = json!({
            "mass": {"estimate": {"lower": 120, "upper": 20}},
            "laod": {"value": 1},
            "load": {"value": -1, "tolerance": "much"}
        });
        document["validation"] = json!({"fraction": 0.95});
        document["seed"] = json!(-1);
        document["sede"] = json!(1);
    });
    let expected = [
        pair("/parameters/mass/estimate/lower", "bounds_reversed"),
        pair("/parameters/laod", "unknown_parameter"),
        pair("/parameters/load/value", "impossible_value"),
        pair("/parameters/load/tolerance", "tolerance_not_understood"),
        pair("/validation/fraction", "out_of_range"),
        pair("/seed", "out_of_range"),
        pair("/sede", "unknown_field"),
    ];
    assert_eq!(found, expected);
}

#[test]
fn a_misspelt_name_is_answered_with_the_right_one() {
    let document = json!({"model": "cart", "experiments": [{"dataset": DATASET}],
                          "parameters": {"laod": {"value": 1}}});
    let faults = read(&document).unwrap_err();
    assert!(faults[0].detail.ends_with("did you mean `load`?"));
}

#[test]
fn a_document_of_the_wrong_kind_has_one_fault() {
    assert!(matches!(read(&json!([])), Err(faults) if faults.len() == 1));
    assert_eq!(
        read(&json!({})).unwrap_err(),
        [
            Fault::new("", "missing_field", "`model` is missing"),
            Fault::new("", "missing_field", "`experiments` is missing")
        ]
    );
}

#[test]
fn an_unknown_model_hides_no_fault_that_does_not_depend_on_it() {
    let found = faults(|document| {
        document["model"] = json!("carts");
        document["limits"] = json!({"max_duration_s": 1e9});
    });
    let expected = [
        pair("/model", "unknown_model"),
        pair("/limits/max_duration_s", "out_of_range"),
    ];
    assert_eq!(found, expected);
}

#[test]
fn what_is_an_experiments_own_must_be_estimable_and_mean_one_thing() {
    let free = json!({"estimate": {"lower": 1, "upper": 2}});
    let own = |role: &str, parameters: Value| json!({"dataset": DATASET, "role": role, "parameters": parameters});
    let with = |experiments: Value, search: Value| {
        faults(|document| {
            document["experiments"] = experiments;
            document["parameters"] = json!({"mass": {"estimate": {}}});
            if !search.is_null() {
                document["model_search"] = search;
            }
        })
    };
    let unknown = json!([own("estimation", json!({"carts": {"value": 1}}))]);
    let place = "/experiments/0/parameters/carts";
    assert_eq!(
        with(unknown, Value::Null),
        [pair(place, "unknown_parameter")]
    );
    let validates = json!([
        {"dataset": DATASET},
        own("validation", json!({"load": free}))
    ]);
    let expected = [pair("/experiments/1", "contradiction")];
    assert_eq!(with(validates, Value::Null), expected);
    let unshared = json!([
        own("estimation", json!({"mass": {"value": 2}, "load": free})),
        {"dataset": DATASET, "role": "validation"}
    ]);
    assert_eq!(with(unshared, Value::Null), [pair("", "contradiction")]);
    let effect = json!([own("estimation", json!({"load": free}))]);
    let search = json!({"effects": ["load"]});
    assert_eq!(with(effect, search), [pair("", "contradiction")]);
}

#[test]
fn hubers_loss_needs_a_noise_level_and_no_likelihood() {
    let with = |more: Value| {
        faults(|document| {
            document["method"] = json!({"huber_threshold": 1.5});
            for (name, value) in more.as_object().unwrap() {
                document[name] = value.clone();
            }
        })
    };
    assert_eq!(with(json!({})), [pair("", "missing_field")]);
    let noise = json!({"position": {"noise_std": 1e-5}});
    let profile = json!({"outputs": noise, "uncertainty": {"intervals": "profile"}});
    assert_eq!(with(profile), [pair("", "contradiction")]);
    let search = json!({"outputs": noise, "model_search": {"effects": ["load"]}});
    assert_eq!(with(search), [pair("", "contradiction")]);
    let tight = with(json!({"method": {"huber_threshold": 0.1}}));
    assert_eq!(tight, [pair("/method/huber_threshold", "out_of_range")]);
}

#[test]
fn a_job_does_not_read_more_than_memory_holds() {
    let mut summary = recording();
    summary.samples = 1_000_000;
    let datasets = HashMap::from([(DATASET.parse().unwrap(), summary)]);
    let cart = cart();
    let context = Context {
        models: vec![&cart],
        datasets: &datasets,
        versions: None,
        max_duration_s: 7200.0,
    };
    let read = |n_experiments: usize| {
        let experiments = vec![json!({"dataset": DATASET}); n_experiments];
        JobSpec::read(
            &json!({"model": "cart", "experiments": experiments}),
            &context,
        )
    };
    assert!(read(10).is_ok());
    let faults = read(11).unwrap_err();
    assert_eq!(faults[0].code, "too_many_values");
    assert!(faults[0].detail.contains("22000000"));
}

#[test]
fn an_experiment_needs_a_recording_inputs_and_an_output() {
    let one = |experiment: Value| faults(|document| document["experiments"] = json!([experiment]));
    let with_signals = |signals: Value| one(json!({"dataset": DATASET, "signals": signals}));
    let signals = "/experiments/0/signals";
    for (found, expected) in [
        (
            faults(|document| document["experiments"] = json!([])),
            pair("/experiments", "out_of_range"),
        ),
        (
            one(json!({"dataset": "ds_00000000000000000000000000000000"})),
            pair("/experiments/0/dataset", "unknown_dataset"),
        ),
        (
            one(json!({"dataset": "rig"})),
            pair("/experiments/0/dataset", "unknown_dataset"),
        ),
        (
            with_signals(json!({"reference": "reference"})),
            pair(signals, "no_measured_output"),
        ),
        (
            with_signals(json!({"position": "x"})),
            pair(signals, "inputs_missing"),
        ),
        (
            with_signals(json!({"reference": "x", "command": "u", "position": "x"})),
            pair(signals, "inputs_conflict"),
        ),
        (
            with_signals(json!({"reference": "y", "position": "x"})),
            pair(&format!("{signals}/reference"), "unknown_dataset_signal"),
        ),
        (
            with_signals(json!({"reference": "p1", "position": "x"})),
            pair(&format!("{signals}/reference"), "unit_mismatch"),
        ),
        (
            with_signals(json!({"referense": "x", "position": "x"})),
            pair(&format!("{signals}/referense"), "unknown_model_signal"),
        ),
    ] {
        assert_eq!(found, [expected]);
    }
}

#[test]
fn a_window_lies_inside_the_recording() {
    let window = |window: Value| {
        faults(|document| document["experiments"][0]["window"] = window)
            .pop()
            .expect("a fault")
    };
    let place = "/experiments/0/window";
    assert_eq!(
        window(json!({"from_s": 5, "to_s": 5})),
        pair(place, "bounds_reversed")
    );
    assert_eq!(
        window(json!({"to_s": 10.5})),
        pair(&format!("{place}/to_s"), "outside_recording")
    );
    assert_eq!(
        window(json!({"from_s": -0.1})),
        pair(&format!("{place}/from_s"), "outside_recording")
    );
    assert_eq!(
        window(json!({"to": 1})),
        pair(&format!("{place}/to"), "wrong_type")
    );
}

#[test]
fn an_initial_state_is_a_number_the_first_sample_or_a_range() {
    let state = |name: &str, state: Value| {
        let initial_state = json!({name: state});
        faults(|document| document["experiments"][0]["initial_state"] = initial_state)
            .pop()
            .expect("a fault")
    };
    let place = "/experiments/0/initial_state";
    assert_eq!(
        state("speed", json!(1)),
        pair(&format!("{place}/speed"), "unknown_state")
    );
    assert_eq!(
        state("velocity", json!("first_sample")),
        pair(&format!("{place}/velocity"), "state_not_measured")
    );
    assert_eq!(
        state("velocity", json!("first")),
        pair(&format!("{place}/velocity"), "unknown_choice")
    );
    assert_eq!(
        state("velocity", json!({"estimate": {"lower": 1, "upper": 1}})),
        pair(&format!("{place}/velocity/estimate"), "bounds_reversed")
    );
    assert_eq!(
        state("velocity", json!({"estimate": {"lower": 1}})),
        pair(&format!("{place}/velocity/estimate"), "missing_field")
    );
}

#[test]
fn a_range_fits_its_scale_and_what_is_possible() {
    let mass = |spec: Value| {
        faults(|document| document["parameters"] = json!({"mass": spec}))
            .pop()
            .expect("a fault")
    };
    let place = "/parameters/mass";
    assert_eq!(
        mass(json!({"estimate": {"lower": 0}})),
        pair(&format!("{place}/estimate/lower"), "log_scale_not_positive")
    );
    assert_eq!(
        mass(json!({"estimate": {"upper": 1e5}})),
        pair(&format!("{place}/estimate/upper"), "impossible_value")
    );
    assert_eq!(
        mass(json!({"estimate": {"upper": 5}})),
        pair(&format!("{place}/estimate"), "bounds_reversed")
    );
    assert_eq!(
        mass(json!({"value": 1, "estimate": {}})),
        pair(place, "value_and_estimate")
    );
    assert_eq!(mass(json!({})), pair(place, "missing_field"));
    assert_eq!(mass(json!(5)), pair(place, "wrong_type"));
}

#[test]
fn a_job_with_nothing_free_is_refused() {
    let found = faults(|document| document["parameters"] = json!({"mass": {"value": 58}}));
    assert_eq!(found, [pair("", "nothing_to_estimate")]);
}

#[test]
fn a_free_initial_state_alone_is_something_to_estimate() {
    let document = json!({
        "model": "cart",
        "experiments": [{"dataset": DATASET, "initial_state":
            {"velocity": {"estimate": {"lower": -1, "upper": 1}}}}],
        "parameters": {"mass": {"value": 58}}
    });
    assert!(read(&document).is_ok());
}

#[test]
fn an_output_that_is_described_is_measured() {
    let output = |outputs: Value| faults(|document| document["outputs"] = outputs);
    assert_eq!(
        output(json!({"velocity": {"noise_std": 1}})),
        [pair("/outputs/velocity", "output_not_measured")]
    );
    assert_eq!(
        output(json!({"positon": {}})),
        [pair("/outputs/positon", "unknown_output")]
    );
    assert_eq!(
        output(json!({"position": {"noise_std": 0}})),
        [pair("/outputs/position/noise_std", "not_positive")]
    );
}

#[test]
fn settings_of_the_method_are_within_their_ranges() {
    let found = faults(|document| {
        document["method"] = json!({
            "name": "magic", "population": 1, "crossover_probability": 1.5, "elitism": "yes",
            "credit_gian": 15
        });
    });
    let expected = [
        pair("/method/name", "unknown_choice"),
        pair("/method/population", "out_of_range"),
        pair("/method/crossover_probability", "out_of_range"),
        pair("/method/elitism", "wrong_type"),
        pair("/method/credit_gian", "unknown_field"),
    ];
    assert_eq!(found, expected);
}

#[test]
fn names_and_labels_are_short_and_few() {
    let found = faults(|document| {
        document["name"] = json!("n".repeat(201));
        let labels = (0..17).map(|i| (format!("label{i}"), json!("x")));
        document["labels"] = Value::Object(labels.collect());
    });
    assert_eq!(
        found,
        [pair("/name", "too_long"), pair("/labels", "too_many")]
    );
    assert_eq!(
        faults(|document| document["labels"] = json!({"site": 3})),
        [pair("/labels/site", "wrong_type")]
    );
}
