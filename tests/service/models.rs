//! Models that users write: stored, named by reference, used, refused, removed.

use reqwest::Method;
use serde_json::{Value, json};

use crate::app::{TestApp, drive_job};

/// The drive of the recordings in these tests, as its user would write it.
fn drive() -> Value {
    json!({
        "name": "my_drive",
        "inputs": {"force": {"unit": "N"}},
        "parameters": {
            "mass": {"symbol": "m", "unit": "kg", "default": 50, "lower": 10, "upper": 1000,
                     "scale": "log", "unknown": true},
            "friction": {"symbol": "d", "unit": "N*s/m", "default": 100, "lower": 1,
                         "upper": 2000, "scale": "log", "unknown": true}
        },
        "states": {
            "x": {"unit": "m", "derivative": "v", "initial": 0, "scale": 0.01},
            "v": {"unit": "m/s", "derivative": "(force - d*v)/m", "initial": 0, "scale": 0.01}
        },
        "outputs": {"position": {"unit": "m", "expression": "x"}}
    })
}

fn job(dataset: &str, model: Value) -> Value {
    json!({"model": model, "experiments": [{"dataset": dataset}],
           "method": {"population": 10, "generations": 5}, "seed": 1})
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stored_model_is_identified_by_its_reference_and_outlives_its_jobs() {
    let app = TestApp::start().await;
    let created = app.post_json("/v1/models", &drive()).await.expect(201);
    let stored = created.json();
    let reference = stored["name"].as_str().unwrap();
    let (name, digest) = reference.split_once('@').unwrap();
    assert_eq!((name, digest.len()), ("my_drive", 16));
    assert!(
        stored["digest"]
            .as_str()
            .unwrap()
            .starts_with(&format!("sha256:{digest}"))
    );
    let path = format!("/v1/models/{reference}");
    assert_eq!(created.header("location"), path);
    assert_eq!(stored["warnings"], json!([]));
    let again = app
        .post_json("/v1/models", &drive())
        .await
        .expect(200)
        .json();
    assert_eq!(again["name"], stored["name"]);
    let shown = app.get(&path).await.expect(200).json();
    assert_eq!(shown["document"], drive());
    assert_eq!(shown["parameters"][0]["symbol"], "m");
    let list = app.get("/v1/models").await.expect(200).json();
    let items = list["items"].as_array().unwrap();
    assert!(items.iter().any(|model| model["name"] == reference));

    let dataset = app.store_drive().await;
    let id = app.submit(&job(&dataset, json!(reference))).await;
    let ended = app.ended(&id).await;
    assert_eq!(ended["status"], "succeeded", "{ended}");
    let result = app
        .get(&format!("/v1/jobs/{id}/result"))
        .await
        .expect(200)
        .json();
    for (index, truth) in [100.0, 200.0].into_iter().enumerate() {
        let estimate = result["parameters"][index]["estimate"].as_f64().unwrap();
        assert!(
            (estimate / truth - 1.0).abs() < 1e-3,
            "{estimate} is not {truth}"
        );
    }
    app.get(&format!("/v1/jobs/{id}/trajectory"))
        .await
        .expect(200);
    let problem = app.delete(&path).await.problem(409);
    assert!(problem["detail"].as_str().unwrap().contains(&id));
    app.delete(&format!("/v1/jobs/{id}")).await.expect(204);
    app.delete(&path).await.expect(204);
    app.get(&path).await.problem(404);
    let gone = app
        .post_json("/v1/jobs", &job(&dataset, json!(reference)))
        .await;
    assert_eq!(gone.problem(422)["errors"][0]["code"], "unknown_model");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_inline_in_a_job_is_kept_with_it() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let request = job(&dataset, drive());
    let only = app
        .post_json("/v1/jobs?validate_only=true", &request)
        .await
        .expect(200)
        .json();
    let reference = only["spec"]["model"].as_str().unwrap().to_owned();
    app.get(&format!("/v1/models/{reference}"))
        .await
        .problem(404);
    let id = app.submit(&request).await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    app.get(&format!("/v1/models/{reference}"))
        .await
        .expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_inline_model_is_simulated_as_the_built_in_one_is() {
    let app = TestApp::start().await;
    let mut document = json!({
        "model": "positioning_drive",
        "inputs": {"sample_time_s": 0.01,
                   "signals": {"force": {"unit": "N", "values": vec![50.0; 101]}}},
        "parameters": {"mass": 100, "viscous_friction": 200, "coulomb_friction": 0, "offset": 0},
        "initial_state": {"position": 0, "velocity": 0}
    });
    let built_in = app
        .post_json("/v1/simulations", &document)
        .await
        .expect(200)
        .json();
    document["model"] = drive();
    document["parameters"] = json!({"mass": 100, "friction": 200});
    document["initial_state"] = json!({});
    let written = app
        .post_json("/v1/simulations", &document)
        .await
        .expect(200)
        .json();
    let reached = |simulation: &Value| {
        simulation["outputs"]["position"]["values"][100]
            .as_f64()
            .unwrap()
    };
    assert!((reached(&built_in) / reached(&written) - 1.0).abs() < 1e-9);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_document_is_told_everything_with_line_and_column() {
    let app = TestApp::start().await;
    let mut wrong = drive();
    wrong["states"]["v"]["derivative"] = json!("(force -\n d*x)/m");
    wrong["outputs"]["position"]["expression"] = json!("sine(x)");
    wrong["colour"] = json!("blue");
    let problem = app.post_json("/v1/models", &wrong).await.problem(422);
    let errors = problem["errors"].as_array().unwrap();
    let of = |pointer: &str| {
        errors
            .iter()
            .find(|error| error["pointer"] == pointer)
            .unwrap()
    };
    let units = of("/states/v/derivative");
    assert_eq!((&units["line"], &units["column"]), (&json!(2), &json!("2")));
    assert!(
        units["detail"].as_str().unwrap().contains("N (kg·m·s^-2)"),
        "{units}"
    );
    assert!(
        of("/outputs/position/expression")["detail"]
            .as_str()
            .unwrap()
            .contains("`sin`")
    );
    assert_eq!(of("/colour")["code"], "unknown_field");
    let dataset = app.store_drive().await;
    let problem = app
        .post_json("/v1/jobs", &job(&dataset, wrong))
        .await
        .problem(422);
    let pointers = problem["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|error| &error["pointer"]);
    assert!(
        pointers
            .into_iter()
            .any(|pointer| pointer == "/model/states/v/derivative")
    );
}

/// [`drive`] as its user would write it in YAML.
const DRIVE_YAML: &str = "\
# the drive on the test bench
name: my_drive
inputs:
  force: {unit: N}
parameters:
  mass: {symbol: m, unit: kg, default: 50, lower: 10, upper: 1000, scale: log, unknown: true}
  friction:
    {symbol: d, unit: N*s/m, default: 100, lower: 1, upper: 2000, scale: log, unknown: true}
states:
  x: {unit: m, derivative: v, initial: 0, scale: 0.01}
  v:
    unit: m/s
    derivative: (force - d*v)/m
    initial: 0
    scale: 0.01
outputs:
  position: {unit: m, expression: x}
";

#[tokio::test(flavor = "multi_thread")]
async fn a_model_in_yaml_is_the_same_model_in_json() {
    let app = TestApp::start().await;
    let created = app.post_yaml("/v1/models", DRIVE_YAML).await.expect(201);
    let there = app.post_json("/v1/models", &drive()).await.expect(200);
    assert_eq!(created.json()["name"], there.json()["name"]);
    let shown = app.get(created.header("location")).await.expect(200).json();
    assert_eq!(shown["document"], drive());
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_with_yaml_is_told_with_its_place() {
    let app = TestApp::start().await;
    let old = "    derivative: (force - d*v)/m\n";
    let new = "    derivative: |\n      (force\n      - d*x)/m\n";
    let wrong = DRIVE_YAML.replace(old, new);
    let problem = app.post_yaml("/v1/models", wrong).await.problem(422);
    let fault = &problem["errors"][0];
    assert_eq!(fault["pointer"], "/states/v/derivative");
    assert_eq!((&fault["line"], &fault["column"]), (&json!(2), &json!("3")));

    // What stands for gigabytes in a few lines is refused at its first line.
    let mut bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n".to_owned();
    for (name, before) in ('b'..='z').zip('a'..) {
        bomb += &format!(
            "{name}: &{name} [{}]\n",
            vec![format!("*{before}"); 9].join(", ")
        );
    }
    let twice = DRIVE_YAML.replace("outputs:", "states:");
    for (text, line) in [(bomb.as_str(), 1), ("name: [a, b\n", 2), (&twice, 16)] {
        let problem = app.post_yaml("/v1/models", text.to_owned()).await;
        let problem = problem.problem(400);
        let fault = &problem["errors"][0];
        assert_eq!(fault["code"], "not_yaml");
        assert_eq!(fault["line"], line, "{fault}");
        assert!(fault["column"].is_string(), "{fault}");
    }
    app.post_yaml("/v1/models", vec![0xff, b'a'])
        .await
        .problem(400);
    let problem = app.post_csv("/v1/models", DRIVE_YAML).await.problem(415);
    assert!(problem["detail"].as_str().unwrap().contains("yaml"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_that_explodes_costs_only_its_own_job() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut explosive = drive();
    explosive["states"]["v"]["derivative"] = json!("(force - d*v)/(m - m)");
    let exploding = app.submit(&job(&dataset, explosive)).await;
    let good = app.submit(&drive_job(&dataset)).await;
    assert_eq!(app.ended(&good).await["status"], "succeeded");
    let failed = app.ended(&exploding).await;
    assert_eq!(failed["status"], "failed", "{failed}");
    let reason = failed["error"]["detail"].as_str().unwrap();
    assert!(!reason.is_empty());
    let document = json!({"model": "positioning_drive"});
    let request = app
        .request(Method::DELETE, "/v1/models/positioning_drive")
        .json(&document);
    app.send(request).await.problem(409);
}
