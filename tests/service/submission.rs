//! A job that is accepted is stored whole, shown whole, and comes to its end.

use reqwest::Method;
use serde_json::json;

use crate::app::{TestApp, drive_job, endless_job};

#[tokio::test(flavor = "multi_thread")]
async fn an_accepted_job_says_where_it_is_and_when_to_come_back() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let accepted = app
        .post_json("/v1/jobs", &drive_job(&dataset))
        .await
        .expect(202);
    let job = accepted.json();
    let path = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    assert_eq!(accepted.header("location"), path);
    assert!(accepted.header("retry-after").parse::<u32>().is_ok());
    assert_eq!(job["status"], "queued");
    assert_eq!(job["links"]["self"], path);
    assert_eq!(job["progress"]["phase"], "search");
    assert_eq!(job["progress"]["generations"], 5);
    assert!(job["error"].is_null());
    assert!(job["created_at"].as_str().unwrap().ends_with('Z'));
}

#[tokio::test(flavor = "multi_thread")]
async fn model_and_recording_alone_are_a_job_with_every_default_shown() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let job = json!({"model": "positioning_drive", "experiments": [{"dataset": dataset}]});
    let validated = app
        .post_json("/v1/jobs?validate_only=true", &job)
        .await
        .expect(200)
        .json();
    let spec = &validated["spec"];
    assert_eq!(
        spec["experiments"][0]["signals"],
        json!({"force": "force", "position": "position"})
    );
    assert!(spec["parameters"]["mass"]["estimate"]["lower"].is_number());
    assert_eq!(spec["method"]["population"], 30);
    assert_eq!(validated["predicted_cost"]["residuals"], 300);
    assert!(validated["findings"].is_array());
    let ahead = &validated["identifiability"];
    assert_eq!(ahead["points"], 5);
    assert_eq!(ahead["predictions"][0]["name"], "mass");
    assert!(ahead["predictions"][0]["standard_error"].as_f64() > Some(0.0));
    assert!(spec["seed"].is_u64());
    let jobs = app.get("/v1/jobs").await.expect(200).json();
    assert_eq!(jobs["items"], json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_completed_specification_submitted_again_completes_to_itself() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let validate = async |job: &serde_json::Value| {
        let answer = app.post_json("/v1/jobs?validate_only=true", job).await;
        answer.expect(200).json()["spec"].clone()
    };
    let completed = validate(&drive_job(&dataset)).await;
    assert_eq!(validate(&completed).await, completed);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_comes_to_its_end_with_a_result() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    let job = app.ended(&id).await;
    assert_eq!(job["status"], "succeeded", "{job}");
    assert!(job["finished_at"].is_string());
    let result = app
        .get(&format!("/v1/jobs/{id}/result"))
        .await
        .expect(200)
        .json();
    assert_eq!(result["job"], id);
    let mass = &result["parameters"][0];
    assert_eq!(mass["name"], "mass");
    let estimate = mass["estimate"].as_f64().unwrap();
    assert!(
        (estimate - 100.0).abs() < 1.0,
        "the rig has 100 kg, not {estimate}"
    );
    assert_eq!(result["engine"]["seed"], 1);
    let generations = app
        .get(&format!("/v1/jobs/{id}/generations?after=2&limit=2"))
        .await;
    let rows = generations.expect(200).json();
    assert_eq!(rows["items"][0]["generation"], 3);
    assert_eq!(rows["items"].as_array().unwrap().len(), 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_prefers_to_wait_gets_the_ended_job() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let request = app
        .request(Method::POST, "/v1/jobs")
        .json(&drive_job(&dataset));
    let answer = app
        .send(request.header("prefer", "wait=60"))
        .await
        .expect(202);
    assert_eq!(answer.header("preference-applied"), "wait=60");
    assert_eq!(answer.json()["status"], "succeeded");
    assert_eq!(answer.header("retry-after"), "");
}

#[tokio::test(flavor = "multi_thread")]
async fn waiting_ends_with_a_change_of_state() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&endless_job(&dataset)).await;
    let path = format!("/v1/jobs/{id}");
    let mut job = app.get(&path).await.expect(200).json();
    while job["status"] == "queued" {
        let begun = app.get(&format!("{path}?wait=60&while=queued")).await;
        job = begun.expect(200).json();
    }
    assert_eq!(job["status"], "running");
    // What the job was before is left behind, and is not waited for.
    let answer = app.get(&format!("{path}?wait=60&while=queued")).await;
    assert_eq!(answer.expect(200).json()["status"], "running");
    let wait = format!("{path}?wait=60");
    let cancel = format!("{path}/cancel");
    let (waited, _) = tokio::join!(app.get(&wait), app.post(&cancel));
    assert_eq!(waited.expect(200).json()["status"], "cancelled");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wait_longer_than_a_minute_is_refused_in_a_query_and_shortened_as_a_preference() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    app.get(&format!("/v1/jobs/{id}?wait=61"))
        .await
        .problem(422);
    let request = app
        .request(Method::POST, "/v1/jobs")
        .json(&drive_job(&dataset));
    let answer = app
        .send(request.header("prefer", "wait=3600"))
        .await
        .expect(202);
    assert_eq!(answer.header("preference-applied"), "wait=60");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_trajectory_of_a_result_shows_what_was_measured_and_simulated() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    app.ended(&id).await;
    let path = format!("/v1/jobs/{id}/trajectory");
    let trajectory = app
        .get(&format!("{path}?max_points=60"))
        .await
        .expect(200)
        .json();
    let experiment = &trajectory["experiments"][0];
    assert_eq!(experiment["dataset"], dataset);
    let n_points = experiment["time_s"].as_array().unwrap().len();
    assert!(n_points <= 60);
    let position = &experiment["outputs"]["position"];
    for series in ["measured", "simulated", "residual"] {
        assert_eq!(position[series].as_array().unwrap().len(), n_points);
    }
    for k in 0..n_points {
        let at = |series: &str| position[series][k].as_f64().unwrap();
        assert_eq!(at("residual"), at("measured") - at("simulated"));
    }
    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let csv = app.send(request).await.expect(200);
    assert_eq!(
        csv.text.lines().next(),
        Some(
            "experiment,time [s],position_measured [m],position_simulated [m],position_residual [m]"
        )
    );
    assert_eq!(csv.text.lines().count(), 401);
}

/// A line through noisy samples: the variance of where it is at time t is that of its offset, of its
/// slope times t², and twice their covariance times t.
#[tokio::test(flavor = "multi_thread")]
async fn how_far_a_simulated_output_may_be_off_follows_from_the_errors_of_the_estimates() {
    let app = TestApp::start().await;
    let values = (0..101).map(|k| {
        let noise = f64::from((k * 7919) % 101) / 50.5 - 1.0;
        2.0 + 0.05 * f64::from(k) + 0.1 * noise
    });
    let recording = json!({
        "sample_time_s": 0.1,
        "signals": {"y": {"unit": "m", "values": values.collect::<Vec<f64>>()}},
    });
    let stored = app.post_json("/v1/datasets", &recording).await.expect(201);
    let free = json!({"estimate": {"lower": -10, "upper": 10, "scale": "linear"}});
    let id = app
        .submit(&json!({
            "model": {
                "name": "line",
                "parameters": {
                    "offset": {"symbol": "a", "unit": "m", "default": 1, "lower": -10, "upper": 10},
                    "slope": {"symbol": "b", "unit": "m/s", "default": 1, "lower": -10, "upper": 10}
                },
                "states": {"risen": {"unit": "m", "derivative": "slope", "initial": 0}},
                "outputs": {"y": {"unit": "m", "expression": "offset + risen"}}
            },
            "experiments": [{"dataset": stored.json()["id"]}],
            "parameters": {"offset": free, "slope": free},
            "outputs": {"y": {"noise_std": 0.06}},
            "validation": {"fraction": 0.2},
            "method": {"population": 8, "generations": 4}, "seed": 1
        }))
        .await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.json();
    let error = |k: usize| result["parameters"][k]["standard_error"].as_f64().unwrap();
    let [offset, slope] = [error(0), error(1)];
    let between = result["correlation"]["matrix"][0][1].as_f64().unwrap();
    assert!(between < -0.5, "{between}");
    let shown = app.get(&format!("/v1/jobs/{id}/trajectory")).await.json();
    let experiment = &shown["experiments"][0];
    let deviation = experiment["outputs"]["y"]["deviation"].as_array().unwrap();
    assert_eq!(deviation.len(), 101, "the part that was held back too");
    for (time, deviation) in experiment["time_s"]
        .as_array()
        .unwrap()
        .iter()
        .zip(deviation)
    {
        let (time, found) = (time.as_f64().unwrap(), deviation.as_f64().unwrap());
        let covariance = between * offset * slope;
        let square = offset.powi(2) + 2.0 * time * covariance + (time * slope).powi(2);
        assert!(
            (found / square.sqrt() - 1.0).abs() < 1e-6,
            "{time} s: {found}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_report_of_a_result_is_one_page_that_fetches_and_runs_nothing() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut job = drive_job(&dataset);
    job["name"] = json!("<script>alert(1)</script> & line 4");
    let id = app.submit(&job).await;
    let path = format!("/v1/jobs/{id}/report");
    app.ended(&id).await;
    let answer = app.get(&path).await.expect(200);
    assert_eq!(answer.header("content-type"), "text/html; charset=utf-8");
    let policy = answer.header("content-security-policy");
    assert!(policy.starts_with("default-src 'none'"), "{policy}");
    let page = &answer.text;
    assert!(page.contains("&lt;script&gt;alert(1)&lt;/script&gt; &amp; line 4"));
    for foreign in ["<script", "http://", "https://", "<link", "<img"] {
        assert!(!page.contains(foreign), "{foreign}");
    }
    let result = app
        .get(&format!("/v1/jobs/{id}/result"))
        .await
        .expect(200)
        .json();
    let name = result["parameters"][0]["name"].as_str().unwrap();
    assert!(page.contains(&format!("<td>{name} (")), "{name}");
    // Outputs, residuals, their memory, spread and spectrum, and the search.
    assert_eq!(page.matches("<svg").count(), 6);
    assert!(!page.contains("NaN"));
}

/// The same result as text and as a document, each with all that the page has beside the plots.
#[tokio::test(flavor = "multi_thread")]
async fn the_report_comes_as_markdown_and_as_json_too() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut job = drive_job(&dataset);
    job["name"] = json!("line 4 | <b>rig</b>");
    let id = app.submit(&job).await;
    app.ended(&id).await;
    let path = format!("/v1/jobs/{id}/report");
    let text = app
        .get(&format!("{path}?format=markdown"))
        .await
        .expect(200);
    assert_eq!(text.header("content-type"), "text/markdown; charset=utf-8");
    assert!(
        text.text.starts_with("# line 4 | &lt;b>rig&lt;/b>\n"),
        "{}",
        text.text
    );
    let document = app.get(&format!("{path}?format=json")).await.expect(200);
    let document = document.json();
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.json();
    assert_eq!(document["result"], result);
    let digest = document["recordings"][0]["digest"].as_str().unwrap();
    assert!(text.text.contains(digest));
    let residuals = &document["residuals"][0];
    let counts = residuals["histogram"]["counts"].as_array().unwrap();
    let counted: u64 = counts.iter().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(residuals["samples"], counted);
    assert!(residuals["spectrum"].as_array().unwrap().len() > 10);
    let page = app.get(&path).await.expect(200).text;
    for part in ["Sign-off", "Taken as fixed", "not said", digest] {
        assert!(page.contains(part), "{part}");
    }
    app.get(&format!("{path}?format=pdf")).await.problem(422);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_part_of_a_trajectory_has_every_sample_of_it() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    app.ended(&id).await;
    let path = format!("/v1/jobs/{id}/trajectory");
    let read = async |query: &str| {
        let answer = app.get(&format!("{path}?{query}")).await.expect(200);
        answer.json()["experiments"].clone()
    };
    let whole = read("max_points=100000").await;
    let times = whole[0]["time_s"].as_array().unwrap();
    let time = |k: usize| times[k].as_f64().unwrap();
    let (from, to) = (time(100), time(150));
    let part = read(&format!("experiment=0&from={from}&to={to}&max_points=60")).await;
    assert_eq!(part[0]["time_s"].as_array().unwrap()[..], times[100..=150]);
    let span = json!([times[0], times[times.len() - 1]]);
    assert_eq!(part[0]["span_s"], span);
    let simulated = &whole[0]["outputs"]["position"]["simulated"];
    let shown = &part[0]["outputs"]["position"]["simulated"];
    assert_eq!(shown[7], simulated[107]);
    assert_eq!(read("experiment=1").await, json!([]));
    let request = app.request(Method::GET, &format!("{path}?from={from}&to={to}"));
    let csv = app
        .send(request.header("accept", "text/csv"))
        .await
        .expect(200);
    assert_eq!(csv.text.lines().count(), 1 + 51);
    app.get(&format!("{path}?from=2&to=1")).await.problem(422);
}

#[tokio::test(flavor = "multi_thread")]
async fn estimates_and_history_are_told_as_tables_too() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    app.ended(&id).await;
    let path = format!("/v1/jobs/{id}/result");
    let result = app.get(&path).await.expect(200).json();
    let table = async |path: &str| {
        let request = app.request(Method::GET, path).header("accept", "text/csv");
        let text = app.send(request).await.expect(200).text;
        text.lines()
            .map(|line| line.split(',').map(str::to_owned).collect())
            .collect()
    };
    let rows: Vec<Vec<String>> = table(&path).await;
    let mass = &result["parameters"][0];
    assert_eq!(rows[1][0], "mass");
    assert_eq!(rows[1][3].parse::<f64>().ok(), mass["estimate"].as_f64());
    let lower = mass["confidence_interval"]["lower"].as_f64();
    assert_eq!(rows[1][5].parse::<f64>().ok(), lower);
    let generations = format!("/v1/jobs/{id}/generations");
    let rows: Vec<Vec<String>> = table(&generations).await;
    let told = app.get(&generations).await.expect(200).json();
    let last = told["items"].as_array().unwrap().last().unwrap();
    assert_eq!(rows[0][8], "mass");
    let row = rows.last().unwrap();
    assert_eq!(row[0], last["generation"].to_string());
    assert_eq!(row[8].parse::<f64>().ok(), last["best"]["mass"].as_f64());
}
