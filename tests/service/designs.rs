//! The next experiment is designed while the client waits, or as a job.

use reqwest::Method;
use serde_json::{Value, json};

use crate::app::{Answer, TestApp, endless_job};

/// A push on a drive of which mass and viscous friction are to be known better.
pub fn document() -> Value {
    json!({
        "model": "positioning_drive",
        "parameters": {
            "mass": {"estimate": {}, "prior": {"mean": 95, "std": 10}},
            "viscous_friction": {"estimate": {}, "prior": {"mean": 200, "std": 50}},
            "coulomb_friction": {"value": 20, "tolerance": "10 %"},
            "offset": {"value": 0}
        },
        "initial_state": {"position": 0, "velocity": 0},
        "outputs": {"position": {"noise_std": 1e-4}},
        "sensors": {"velocity": {"noise_std": 1e-3}},
        "inputs": {"force": {"lower": -100, "upper": 100, "rate_per_s": 2000}},
        "families": ["steps", "sine"],
        "proposals": [{"name": "one push", "kind": "steps", "hold_s": 1, "levels": [1, 0]}],
        "sample_time_s": 0.02, "duration_s": 2, "points": 2
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn an_excitation_is_answered_with_its_samples_and_what_it_brings() {
    let app = TestApp::start().await;
    let design = app.post_json("/v1/designs", &document()).await;
    let design = design.expect(200).json();
    assert_eq!(design["wanted"], json!(["mass", "viscous_friction"]));
    let proposals = design["proposals"].as_array().unwrap();
    assert_eq!(proposals.len(), 3, "two families and what was proposed");
    assert_eq!(proposals[0]["relative_error"], 1.0);
    assert!(proposals.iter().any(|own| own["name"] == "one push"));
    let error = |known: &Value| known["total_standard_error"].as_f64().unwrap();
    for place in 0..2 {
        let (before, after) = (&design["before"][place], &proposals[0]["after"][place]);
        assert_eq!(before["name"], after["name"]);
        assert!(error(after) < error(before), "{before} {after}");
    }
    assert!(
        (error(&design["before"][0]) - 10.0).abs() < 1e-3,
        "the prior"
    );
    assert!(design["sensors"][0]["relative_error"].as_f64().unwrap() < 1.0);

    // What is answered can be played.
    let force = &design["inputs"]["signals"]["force"]["values"];
    assert_eq!(force.as_array().unwrap().len(), 100);
    let simulation = json!({"model": "positioning_drive", "inputs": design["inputs"],
                            "initial_state": {"position": 0, "velocity": 0}});
    app.post_json("/v1/simulations", &simulation)
        .await
        .expect(200);
    let again = app.post_json("/v1/designs", &document()).await.json();
    assert_eq!(design, again, "the same seed, the same design");
}

#[tokio::test(flavor = "multi_thread")]
async fn all_faults_of_a_design_are_told_at_once_with_their_places() {
    let app = TestApp::start().await;
    let mut document = document();
    document["parameters"]["mas"] = json!({"value": 1});
    document["outputs"]["position"] = json!({});
    document["inputs"]["force"]["lower"] = json!(200);
    document["wanted"] = json!(["offset"]);
    document["initial_state"]["velocity"] = json!("first_sample");
    document["familys"] = json!([]);
    document["points"] = json!(0);
    let problem = app.post_json("/v1/designs", &document).await.problem(422);
    let errors = problem["errors"].as_array().unwrap().iter();
    let mut places: Vec<_> = errors
        .map(|error| {
            (
                error["pointer"].as_str().unwrap(),
                error["code"].as_str().unwrap(),
            )
        })
        .collect();
    places.sort_unstable();
    assert_eq!(
        places,
        [
            ("/familys", "unknown_field"),
            ("/initial_state", "no_recording"),
            ("/inputs/force", "bounds_reversed"),
            ("/outputs/position", "missing_field"),
            ("/parameters/mas", "unknown_parameter"),
            ("/points", "out_of_range"),
            ("/wanted/0", "not_estimated"),
        ]
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_proposal_must_keep_the_limits_and_the_grid() {
    let app = TestApp::start().await;
    let place = async |proposal: Value| {
        let mut document = document();
        document["proposals"] = json!([proposal]);
        let problem = app.post_json("/v1/designs", &document).await.problem(422);
        let error = &problem["errors"][0];
        let text = |name: &str| error[name].as_str().unwrap().to_owned();
        (text("pointer"), text("code"))
    };
    let samples = |values: Vec<f64>| json!({"kind": "samples", "samples": {"force": values}});
    let pair = |pointer: &str, code: &str| (pointer.to_owned(), code.to_owned());
    let force = "/proposals/0/samples/force";
    assert_eq!(
        place(samples(vec![0.0; 99])).await,
        pair(force, "wrong_length")
    );
    assert_eq!(
        place(samples(vec![101.0; 100])).await,
        pair(force, "out_of_range")
    );
    let jump = (0..100).map(|k| if k < 50 { 0.0 } else { 100.0 }).collect();
    assert_eq!(place(samples(jump)).await, pair(force, "too_fast"));
    let fast = json!({"kind": "sine", "frequency_hz": 26});
    assert_eq!(
        place(fast).await,
        pair("/proposals/0/frequency_hz", "out_of_range")
    );
    assert_eq!(
        place(json!({"kind": "chirp"})).await,
        pair("/proposals/0/kind", "unknown_choice")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_design_that_takes_too_long_is_refused_before_it_begins() {
    let app = TestApp::start().await;
    // All that is taken as known of this model has a tolerance.
    let document = json!({
        "model": "single_rod_servo", "outputs": {"position": {"noise_std": 1e-5}},
        "inputs": {"reference": {"lower": 0.03, "upper": 0.11}},
        "sample_time_s": 1e-3, "duration_s": 100, "points": 16
    });
    let problem = app.post_json("/v1/designs", &document).await.problem(422);
    assert_eq!(problem["errors"][0]["pointer"], "/duration_s");
    assert_eq!(problem["errors"][0]["code"], "too_costly");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_design_goes_on_from_a_finished_job() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let job = json!({
        "model": "positioning_drive", "experiments": [{"dataset": dataset}],
        "parameters": {"coulomb_friction": {"value": 0}, "offset": {"value": 0}},
        "method": {"name": "multistart_lm", "population": 8, "generations": 2,
                   "further_searches": 0},
        "validation": {"fraction": 0}, "seed": 1
    });
    let id = app.submit(&job).await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.json();

    let mut document = document();
    for name in ["model", "parameters", "outputs", "sensors", "families"] {
        document.as_object_mut().unwrap().remove(name);
    }
    document["job"] = json!(id);
    let design = app.post_json("/v1/designs", &document).await;
    let design = design.expect(200).json();
    let number = |value: &Value| value.as_f64().unwrap();
    for (known, told) in design["before"]
        .as_array()
        .unwrap()
        .iter()
        .zip(result["parameters"].as_array().unwrap())
    {
        assert_eq!(known["name"], told["name"]);
        let (value, estimate) = (number(&known["value"]), number(&told["estimate"]));
        assert!((value / estimate - 1.0).abs() < 1e-9);
        // The data count no more than the job says.
        let (before, told) = (
            number(&known["standard_error"]),
            number(&told["standard_error"]),
        );
        assert!(before >= told * (1.0 - 1e-6), "{before} {told}");
    }
    let after = &design["proposals"][0]["after"][0]["standard_error"];
    assert!(number(after) < number(&design["before"][0]["standard_error"]));

    let job = submit(&app, &document, "next").await.expect(202).json();
    let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    app.ended(job["id"].as_str().unwrap()).await;
    let result = app.get(&format!("{path}/result")).await.expect(200).json();
    assert_eq!(
        result, design,
        "the job designs what is answered while one waits"
    );

    document["model"] = json!("positioning_drive");
    let problem = app.post_json("/v1/designs", &document).await.problem(422);
    assert_eq!(problem["errors"][0]["pointer"], "/model");
    document.as_object_mut().unwrap().remove("model");
    document["job"] = json!("job_00000000000000000000000000000000");
    let problem = app.post_json("/v1/designs", &document).await.problem(422);
    assert_eq!(problem["errors"][0]["code"], "unknown_job");
}

/// Asks for a design as a job.
async fn submit(app: &TestApp, document: &Value, key: &str) -> Answer {
    let request = app.request(Method::POST, "/v1/designs").json(document);
    let request = request.header("Prefer", "respond-async");
    app.send(request.header("Idempotency-Key", key)).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_design_is_a_job_where_the_client_prefers_that() {
    let app = TestApp::start().await;
    let waited = app.post_json("/v1/designs", &document()).await;
    let waited = waited.expect(200).json();
    let answer = submit(&app, &document(), "push").await.expect(202);
    let job = answer.json();
    assert_eq!(
        (&job["kind"], &job["status"]),
        (&json!("design"), &json!("queued"))
    );
    assert_eq!(job["name"], "design for mass, viscous friction");
    let id = job["id"].as_str().unwrap();
    let path = format!("/v1/jobs/{id}");
    assert_eq!(answer.header("location"), path);
    let again = submit(&app, &document(), "push").await.expect(202);
    assert_eq!(again.header("idempotent-replayed"), "true");
    assert_eq!(again.json()["id"], job["id"]);

    let ended = app.ended(id).await;
    assert_eq!(ended["status"], "succeeded");
    assert_eq!(
        ended["progress"]["evaluations"],
        waited["assessed"].as_u64().unwrap() + 1,
        "and the sensor"
    );
    let result = app.get(&format!("{path}/result")).await.expect(200);
    assert_eq!(result.json(), waited, "the same document, the same design");

    let events = app.get(&format!("{path}/events")).await.text;
    let names: Vec<&str> = events
        .lines()
        .filter_map(|line| line.strip_prefix("event: "))
        .collect();
    let designs = names.iter().filter(|name| **name == "design").count();
    assert!(designs > 0, "{names:?}");
    assert_eq!(names[names.len() - 3..], ["result", "state", "end"]);

    let csv = app.request(Method::GET, &format!("{path}/result"));
    let csv = app.send(csv.header("Accept", "text/csv")).await.text;
    let first = &waited["inputs"]["signals"]["force"]["values"][0];
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines[0], "time_s,force");
    assert_eq!(lines[1], format!("0,{first}").replace(".0", ""));
    assert_eq!(lines.len(), 101);

    // It has no estimate to show, and is no experiment to go on from.
    for shown in ["trajectory", "report"] {
        let problem = app.get(&format!("{path}/{shown}")).await.problem(409);
        assert!(
            problem["detail"]
                .as_str()
                .unwrap()
                .contains("designs an experiment")
        );
    }
    let problem = app.post_json("/v1/designs", &json!({"job": id})).await;
    problem.problem(409);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_design_that_is_cancelled_keeps_the_best_so_far() {
    let app = TestApp::start().await;
    let mut document = document();
    document["sample_time_s"] = json!(0.001);
    document["points"] = json!(16);
    document["families"] = json!(["prbs", "multisine", "steps", "sine"]);
    let job = submit(&app, &document, "long").await.expect(202).json();
    let id = job["id"].as_str().unwrap();
    let path = format!("/v1/jobs/{id}");
    let mut looked_at = 0;
    while looked_at < 8 {
        let request = app.request(Method::GET, &path).header("Prefer", "wait=1");
        looked_at = app.send(request).await.json()["progress"]["evaluations"]
            .as_u64()
            .unwrap();
    }
    app.post(&format!("{path}/cancel")).await.expect(200);
    assert_eq!(app.ended(id).await["status"], "cancelled");
    let result = app.get(&format!("{path}/result")).await.expect(200).json();
    assert_eq!(result["finished"], false);
    assert_eq!(result["findings"][0]["code"], "not_finished");
    assert!(result["assessed"].as_u64().unwrap() >= 8);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_design_as_a_job_is_refused_like_one_that_is_waited_for() {
    let app = TestApp::start().await;
    let mut document = document();
    document["wanted"] = json!(["offset"]);
    let problem = submit(&app, &document, "wrong").await.problem(422);
    assert_eq!(problem["errors"][0]["pointer"], "/wanted/0");
    let waited_for = app
        .request(Method::POST, "/v1/designs")
        .json(&self::document());
    let waited_for = waited_for.header("Idempotency-Key", "");
    let problem = app.send(waited_for).await.problem(422);
    assert_eq!(problem["errors"][0]["header"], "Idempotency-Key");
    let dataset = app.store_drive().await;
    let id = app.submit(&endless_job(&dataset)).await;
    app.post(&format!("/v1/jobs/{id}/pause")).await;
    let mut document = self::document();
    for name in ["model", "parameters", "outputs", "sensors"] {
        document.as_object_mut().unwrap().remove(name);
    }
    document["job"] = json!(id);
    submit(&app, &document, "paused").await.problem(409);
    assert_eq!(
        app.get("/v1/jobs").await.json()["items"]
            .as_array()
            .unwrap()
            .len(),
        1
    );
}
