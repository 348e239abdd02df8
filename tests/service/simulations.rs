//! A parameter set is simulated while the client waits.

use reqwest::Method;
use serde_json::{Value, json};

use crate::app::TestApp;

/// 50 N on a drive of 100 kg with 200 N·s/m, for 2 s from rest.
fn push() -> Value {
    json!({
        "model": "positioning_drive",
        "inputs": {"sample_time_s": 0.01,
                   "signals": {"force": {"unit": "N", "values": vec![50.0; 201]}}},
        "parameters": {"mass": 100, "viscous_friction": {"value": 200},
                       "coulomb_friction": 0, "offset": 0},
        "initial_state": {"position": 0, "velocity": 0}
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn inline_inputs_drive_a_model_as_its_equation_says() {
    let app = TestApp::start().await;
    let simulation = app
        .post_json("/v1/simulations", &push())
        .await
        .expect(200)
        .json();
    assert_eq!(simulation["time_s"].as_array().unwrap().len(), 201);
    let position = &simulation["outputs"]["position"];
    assert_eq!(position["unit"], "m");
    // x(t) = F/d·(t − m/d·(1 − e^(−d·t/m))) for m·x'' + d·x' = F from rest; here t = 2 s.
    let expected = 0.25 * (2.0 - 0.5 * (1.0 - (-4.0_f64).exp()));
    let reached = position["values"][200].as_f64().unwrap();
    assert!(
        (reached - expected).abs() < 1e-9,
        "{reached} is not {expected}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stored_recording_drives_a_model_in_a_window() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut document = push();
    document.as_object_mut().unwrap().remove("inputs");
    document["dataset"] = json!(dataset);
    document["window"] = json!({"from_s": 1, "to_s": 2});
    document["initial_state"] = json!({"position": "first_sample"});
    let request = app.request(Method::POST, "/v1/simulations").json(&document);
    let csv = app
        .send(request.header("accept", "text/csv"))
        .await
        .expect(200);
    let mut lines = csv.text.lines();
    assert_eq!(lines.next(), Some("time [s],position [m],velocity [m/s]"));
    assert!(lines.next().unwrap().starts_with('1'));
    assert_eq!(lines.count(), 100);
}

#[tokio::test(flavor = "multi_thread")]
async fn all_faults_of_a_simulation_are_told_at_once() {
    let app = TestApp::start().await;
    let mut document = push();
    document["parameters"]["mas"] = json!(1);
    document["parameters"]["mass"] = json!(-1);
    document["initial_state"]["velocity"] = json!({"estimate": {"lower": 0, "upper": 1}});
    document["windo"] = json!({});
    let problem = app
        .post_json("/v1/simulations", &document)
        .await
        .problem(422);
    let errors = problem["errors"].as_array().unwrap();
    let mut codes: Vec<_> = errors.iter().map(|e| e["code"].as_str().unwrap()).collect();
    codes.sort_unstable();
    assert_eq!(
        codes,
        [
            "estimate_in_simulation",
            "impossible_value",
            "unknown_field",
            "unknown_parameter"
        ]
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_simulation_needs_one_source_of_inputs_without_holes() {
    let app = TestApp::start().await;
    let code = async |change: fn(&mut Value)| {
        let mut document = push();
        change(&mut document);
        let problem = app
            .post_json("/v1/simulations", &document)
            .await
            .problem(422);
        problem["errors"][0]["code"].as_str().unwrap().to_owned()
    };
    let unknown = "ds_00000000000000000000000000000000";
    assert_eq!(
        code(|d| d["dataset"] = json!("ds_x")).await,
        "dataset_and_inputs"
    );
    assert_eq!(code(|d| d["inputs"] = Value::Null).await, "missing_field");
    assert_eq!(
        code(|d| d["inputs"]["signals"] = json!({"f": {"values": [1, 2]}})).await,
        "inputs_missing"
    );
    assert_eq!(
        code(|d| d["inputs"]["signals"]["force"]["values"][3] = Value::Null).await,
        "input_missing"
    );
    let document = json!({"model": "positioning_drive", "dataset": unknown});
    let problem = app
        .post_json("/v1/simulations", &document)
        .await
        .problem(422);
    assert_eq!(problem["errors"][0]["code"], "unknown_dataset");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_answer_that_leaves_samples_out_says_so() {
    let app = TestApp::start().await;
    let mut document = push();
    document["inputs"]["signals"]["force"]["values"] = json!(vec![50.0; 300]);
    let all = app.post_json("/v1/simulations", &document).await;
    let all = all.expect(200).json();
    assert_eq!(
        (&all["samples"], &all["decimated"]),
        (&json!(300), &json!(false))
    );
    let some = app
        .post_json("/v1/simulations?max_points=50", &document)
        .await;
    let some = some.expect(200).json();
    assert_eq!(
        (&some["samples"], &some["decimated"]),
        (&json!(300), &json!(true))
    );
    assert!(some["time_s"].as_array().unwrap().len() <= 50);
}

/// A mass on a spring and a damper, under a force that is recorded and a load that is not.
pub fn rig() -> Value {
    json!({
        "name": "rig",
        "title": "mass on a spring",
        "inputs": {"force": {"unit": "N"}},
        "parameters": {
            "mass": {"unit": "kg", "default": 10, "lower": 1, "upper": 100},
            "damping": {"unit": "N*s/m", "default": 20, "lower": 1, "upper": 100},
            "stiffness": {"unit": "N/m", "default": 1000, "lower": 1, "upper": 10000},
            "load": {"unit": "N", "default": 0, "lower": -10, "upper": 10}
        },
        "states": {
            "x": {"unit": "m", "derivative": "v", "initial": 0},
            "v": {"unit": "m/s", "initial": 0,
                  "derivative": "(force + load - damping*v - stiffness*x)/mass"}
        },
        "outputs": {"position": {"unit": "m", "expression": "x"}}
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn a_disturbed_record_is_answered_with_its_likelihood_and_what_was_expected() {
    const RECORD: &str =
        include_str!("../../crates/simulation/tests/process_noise/rig_force_with_memory.csv");
    const REFERENCE: &str =
        include_str!("../../crates/simulation/tests/process_noise/reference.json");
    let reference: Value = serde_json::from_str(REFERENCE).unwrap();
    let reference = &reference["rig_force_with_memory"];
    let value = |name: &str| reference["values"][name].as_f64().unwrap();
    let app = TestApp::start().await;
    let stored = app.post_csv("/v1/datasets", RECORD).await;
    let dataset = stored.json()["id"].clone();
    let time_constant = value("time_constant");
    let mut document = json!({
        "model": rig(),
        "dataset": dataset,
        "parameters": {"mass": value("mass"), "damping": value("damping"),
                       "stiffness": value("stiffness")},
        "process_noise": [{
            "acts_on": {"parameter": "load"}, "kind": "memory",
            "std": value("strength") / (2.0 * time_constant).sqrt(),
            "time_constant_s": time_constant
        }],
        "outputs": {"position": {"noise_std": value("noise_std")}}
    });
    let answer = app
        .post_json("/v1/simulations", &document)
        .await
        .expect(200);
    let answer = answer.json();
    let expected = reference["dense"].as_f64().unwrap();
    let likelihood = answer["log_likelihood"].as_f64().unwrap();
    assert!(
        (likelihood - expected).abs() < 1e-3,
        "{likelihood} beside {expected}"
    );
    let deviations = answer["outputs"]["position_std"]["values"]
        .as_array()
        .unwrap();
    // The start is known: of the first sample the sensor's noise alone is uncertain.
    assert_eq!(deviations[0].as_f64().unwrap(), value("noise_std"));
    assert!(deviations[100].as_f64().unwrap() > value("noise_std"));

    // A disturbance of no strength changes nothing.
    let nothing = json!({"acts_on": {"state": "v"}, "kind": "white", "strength": 0});
    let disturbances = document["process_noise"].as_array_mut().unwrap();
    disturbances.push(nothing);
    let answer = app
        .post_json("/v1/simulations", &document)
        .await
        .expect(200);
    let as_before = answer.json()["log_likelihood"].as_f64().unwrap();
    assert!(
        (as_before - likelihood).abs() < 1e-3,
        "{as_before} beside {likelihood}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn faults_of_a_disturbance_are_named() {
    let app = TestApp::start().await;
    let record = "time,force,position\n0,1,0\n0.1,1,0.01\n0.2,1,0.02\n0.3,1,0.03\n";
    let stored = app.post_csv("/v1/datasets", record).await;
    let mut document = json!({
        "model": rig(),
        "dataset": stored.json()["id"],
        "parameters": {"mass": 1.0, "damping": 0.5, "stiffness": 10.0},
        "process_noise": [{
            "acts_on": {"parameter": "lod"}, "kind": "memory",
            "std": 1, "strength": 1, "time_constant_s": 1
        }]
    });
    let problem = app
        .post_json("/v1/simulations", &document)
        .await
        .problem(422);
    let errors = problem["errors"].as_array().unwrap();
    let codes: Vec<_> = errors.iter().map(|e| e["code"].as_str().unwrap()).collect();
    assert_eq!(codes, ["unknown_name", "unknown_field", "noise_needed"]);
    document["model"] = json!("positioning_drive");
    document["parameters"] = json!({});
    document["process_noise"] = json!([
        {"acts_on": {"state": "velocity"}, "kind": "white", "strength": 0.1}
    ]);
    document["outputs"] = json!({"position": {"noise_std": 1e-4}});
    let problem = app.post_json("/v1/simulations", &document).await;
    let problem = problem.problem(422);
    assert_eq!(problem["errors"][0]["code"], "filter_not_possible");
}
