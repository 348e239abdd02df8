//! Windows of a stream that fix the parameters of a finished job, and the estimation from them.

use reqwest::Method;
use serde_json::{Value, json};

use super::app::TestApp;

/// Seconds in a window.
const WINDOW: u32 = 120;

/// Twelve windows of a lag with a time constant of 5 s and a gain of 2: the input moves in windows 1, 4, 7 and 10,
/// each time more, and the sensor reads to a hundredth.
fn history() -> String {
    let mut text = String::from("time,u [-],y [-],room [degC]\n");
    let (mut x, share) = (2.0_f64, (-0.2_f64).exp());
    for k in 0..12 * WINDOW {
        let (window, second) = (k / WINDOW, k % WINDOW);
        let is_up = window % 3 == 1 && second / 30 % 2 == 1;
        let u = if is_up {
            1.5 + 0.1 * f64::from(window)
        } else {
            1.0
        };
        let read = ((x + 0.01 * (f64::from(k) * 7.3).sin()) * 100.0).round() / 100.0;
        text += &format!("2026-03-02T08:{:02}:{:02}Z,{u},{read},20\n", k / 60, k % 60);
        x = 2.0 * u + share * (x - 2.0 * u);
    }
    text
}

/// The estimation from the first three windows, once it has succeeded.
async fn finished(app: &TestApp) -> String {
    app.post_csv("/v1/streams/line", history())
        .await
        .expect(201);
    let part = json!({"from": "2026-03-02T08:00:00Z", "to": "2026-03-02T08:06:00Z"});
    let part = app
        .post_json("/v1/streams/line/recordings", &part)
        .await
        .expect(201)
        .json();
    let id = app
        .submit(&json!({
            "model": "first_order_dead_time",
            "experiments": [{"dataset": part["id"], "initial_state": {"lagged": {"value": 2}}}],
            "parameters": {"gain": {"estimate": {"lower": 1, "upper": 4}}, "time_constant": {"estimate": {}},
                           "dead_time": {"value": 0}, "offset": {"value": 0}},
            "method": {"name": "multistart_lm", "population": 8, "generations": 2, "further_searches": 0},
            "process_noise": "none", "validation": {"fraction": 0}, "labels": {"site": "hall 2"}, "seed": 1
        }))
        .await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    id
}

fn request(job: &str) -> Value {
    json!({
        "job": job, "stream": "line", "window_s": WINDOW, "wanted": ["time_constant"],
        "budget_samples": 2 * WINDOW,
        "initial_state": {"lagged": {"estimate": {"lower": 0, "upper": 6}}}
    })
}

/// A selection, once it has ended, and its result.
async fn selected(app: &TestApp, request: &Value) -> (String, Value) {
    let job = app.post_json("/v1/selections", request).await.expect(202);
    let location = job.header("location").to_owned();
    let job = job.json();
    assert_eq!(job["kind"], "selection");
    let id = job["id"].as_str().unwrap().to_owned();
    assert_eq!(location, format!("/v1/jobs/{id}"));
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    let result = app.get(&format!("/v1/jobs/{id}/result")).await;
    (id, result.expect(200).json())
}

#[tokio::test(flavor = "multi_thread")]
async fn the_windows_that_inform_are_selected_and_estimated_from() {
    let app = TestApp::start().await;
    let before = finished(&app).await;
    let (id, selection) = selected(&app, &request(&before)).await;
    assert_eq!(selection["finished"], true);
    assert_eq!(selection["windows"]["count"], 12);
    let chosen: Vec<&Value> = selection["chosen"].as_array().unwrap().iter().collect();
    let places: Vec<u64> = chosen
        .iter()
        .map(|own| own["window"].as_u64().unwrap())
        .collect();
    assert_eq!(places, [7, 10], "where the input moved most");
    assert_eq!(chosen[1]["from"], "2026-03-02T08:20:00Z");
    assert_eq!(chosen[1]["to"], "2026-03-02T08:22:00Z");
    assert_eq!(chosen[1]["moved"], json!(["u"]));
    assert_eq!(selection["windows"]["left_out"][0], "inputs_stood_still");
    assert_eq!(selection["left_out"][0]["windows"], 8);
    let error = |of: &str| selection[of][1]["total_standard_error"].as_f64().unwrap();
    assert_eq!(selection["with_all"][1]["name"], "time_constant");
    assert!(error("with_all") < error("with_chosen"));

    let csv = app.request(Method::GET, &format!("/v1/jobs/{id}/result"));
    let csv = app.send(csv.header("accept", "text/csv")).await.expect(200);
    assert!(
        csv.text
            .starts_with("window,from,to,samples,moved,adds_gain,adds_time_constant\n7,")
    );

    let path = format!("/v1/jobs/{id}/estimation");
    let asked = || {
        app.request(Method::POST, &path)
            .header("idempotency-key", "once")
    };
    let job = app.send(asked()).await.expect(202).json();
    let again = app.send(asked()).await.expect(202);
    assert_eq!(again.header("idempotent-replayed"), "true");
    assert_eq!(again.json()["id"], job["id"]);
    let estimation = job["id"].as_str().unwrap();
    assert_eq!(app.ended(estimation).await["status"], "succeeded");
    let shown = app.get(&format!("/v1/jobs/{estimation}")).await.json();
    assert_eq!(shown["labels"], json!({"selection": id, "site": "hall 2"}));
    let experiments = shown["spec"]["experiments"].as_array().unwrap();
    assert_eq!(experiments.len(), 2);
    let dataset = experiments[1]["dataset"].as_str().unwrap();
    let recording = app
        .get(&format!("/v1/datasets/{dataset}"))
        .await
        .expect(200)
        .json();
    assert_eq!(recording["start"], "2026-03-02T08:20:00Z");
    assert_eq!(recording["samples"], WINDOW);
    let result = app
        .get(&format!("/v1/jobs/{estimation}/result"))
        .await
        .json();
    let parameters = result["parameters"].as_array().unwrap();
    let time_constant = parameters
        .iter()
        .find(|own| own["name"] == "time_constant")
        .unwrap();
    assert!(
        (time_constant["estimate"].as_f64().unwrap() - 5.0).abs() < 0.1,
        "{time_constant}"
    );
    // What was foretold of noise is what the estimate says.
    let told = time_constant["standard_error"].as_f64().unwrap();
    let foretold = selection["with_chosen"][1]["standard_error"]
        .as_f64()
        .unwrap();
    assert!((0.5..2.0).contains(&(told / foretold)), "{told} {foretold}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_window_begins_where_the_plant_is_and_a_model_that_starts_elsewhere_is_told() {
    let app = TestApp::start().await;
    let before = finished(&app).await;
    let mut request = request(&before);
    // The middle of a step: the state is far from where the job's recording began.
    request["from"] = json!("2026-03-02T08:20:45Z");
    request["window_s"] = json!(60);
    let (_, selection) = selected(&app, &request).await;
    assert_eq!(selection["windows"]["left_out"][0], Value::Null);
    request.as_object_mut().unwrap().remove("initial_state");
    let (_, selection) = selected(&app, &request).await;
    assert_eq!(selection["windows"]["left_out"][0], "starts_elsewhere");
    let findings = selection["findings"].as_array().unwrap().iter();
    assert!(
        findings
            .clone()
            .any(|own| own["code"] == "starts_elsewhere")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn all_faults_of_a_selection_are_told_at_once_with_their_places() {
    let app = TestApp::start().await;
    let before = finished(&app).await;
    let wrong = json!({
        "job": before, "stream": "line", "window_s": 0, "wanted": ["offset"], "target": {"gian": "1 %", "gain": 0},
        "from": "2026-03-02T09:00:00Z", "to": "2026-03-02T08:00:00Z", "max_windows": 33,
        "exclude": [{"from": "yesterday"}], "initial_state": {"lag": 1}, "budget": 7
    });
    let problem = app.post_json("/v1/selections", &wrong).await.problem(422);
    let errors = problem["errors"].as_array().unwrap().iter();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let mut places: Vec<(String, String)> = errors
        .map(|error| (text(&error["pointer"]), text(&error["code"])))
        .collect();
    places.sort_unstable();
    let expected = [
        ("", "bounds_reversed"),
        ("/budget", "unknown_field"),
        ("/exclude/0", "missing_field"),
        ("/exclude/0/from", "not_a_time"),
        ("/initial_state/lag", "unknown_state"),
        ("/max_windows", "out_of_range"),
        ("/target/gain", "not_positive"),
        ("/target/gian", "not_estimated"),
        ("/wanted/0", "not_estimated"),
        ("/window_s", "not_positive"),
    ];
    let expected = expected.map(|(place, code)| (place.to_owned(), code.to_owned()));
    assert_eq!(places, expected);

    let fault = async |change: Value| {
        let mut request = request(&before);
        for (name, value) in change.as_object().unwrap() {
            request[name] = value.clone();
        }
        let problem = app.post_json("/v1/selections", &request).await.problem(422);
        let error = &problem["errors"][0];
        (text(&error["pointer"]), text(&error["code"]))
    };
    let pair = |pointer: &str, code: &str| (pointer.to_owned(), code.to_owned());
    assert_eq!(
        fault(json!({"stream": "other"})).await,
        pair("/stream", "unknown_stream")
    );
    assert_eq!(
        fault(json!({"window_s": 0.05})).await,
        pair("/window_s", "too_many_windows")
    );
    assert_eq!(
        fault(json!({"from": "2026-03-03T00:00:00Z"})).await,
        pair("/from", "bounds_reversed")
    );
    let unknown = json!({"job": "job_0192d3a4b5c67d8e9f00112233445566"});
    assert_eq!(fault(unknown).await, pair("/job", "unknown_job"));
    let without_y = "time,u [-],speed [m/s]\n2026-03-02T08:00:00Z,1,2\n2026-03-02T08:00:01Z,1,2\n";
    app.post_csv("/v1/streams/other", without_y)
        .await
        .expect(201);
    assert_eq!(
        fault(json!({"stream": "other"})).await,
        pair("/stream", "unknown_signal")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_selection_and_what_chose_nothing_is_not_estimated_from() {
    let app = TestApp::start().await;
    let before = finished(&app).await;
    app.post(&format!("/v1/jobs/{before}/estimation"))
        .await
        .problem(409);
    let nobody = "/v1/jobs/job_0192d3a4b5c67d8e9f00112233445566/estimation";
    app.post(nobody).await.problem(404);
    let mut request = request(&before);
    request["to"] = json!("2026-03-02T08:02:00Z");
    let (id, selection) = selected(&app, &request).await;
    assert_eq!(selection["chosen"], json!([]));
    assert_eq!(selection["never_fixed"], json!(["time_constant"]));
    app.post(&format!("/v1/jobs/{id}/estimation"))
        .await
        .problem(409);
    // A selection estimates nothing that another could begin from.
    request["job"] = json!(id);
    app.post_json("/v1/selections", &request).await.problem(409);
    app.delete("/v1/streams/line").await.expect(204);
    request["job"] = json!(before);
    app.post_json("/v1/selections", &request).await.problem(422);
}
