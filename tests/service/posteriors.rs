//! Draws from the posterior distribution: while the chains move, in the result, and as a table.

use reqwest::Method;
use serde_json::{Value, json};

use crate::app::{TestApp, drive_job};
use crate::events::Stream;

/// A job that draws from the posterior.
fn drawing_job(dataset: &str) -> Value {
    let mut job = drive_job(dataset);
    job["uncertainty"] = json!({"intervals": "posterior", "posterior_generations": 500});
    job
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_tells_how_far_its_chains_came_and_answers_their_draws() {
    let app = TestApp::start().await;
    let id = app.submit(&drawing_job(&app.store_drive().await)).await;
    let events = Stream::open(&app, &id, None).await.rest().await;
    let looks = events.iter().filter(|event| event.name == "posterior");
    let looks: Vec<&Value> = looks.map(|event| &event.data).collect();
    let generations: Vec<&Value> = looks.iter().map(|look| &look["generation"]).collect();
    assert_eq!(generations, [250, 500]);
    assert!(looks.iter().all(|look| look["generations"] == 500));
    assert!(looks[1]["r_hat"].as_f64() > Some(1.0), "{:?}", looks[1]);
    assert!(looks[1]["ess_tail"].as_f64() > Some(50.0), "{:?}", looks[1]);

    let job = app.get(&format!("/v1/jobs/{id}")).await.json();
    let path = format!("/v1/jobs/{id}/posterior");
    assert_eq!(job["links"]["posterior"], path.as_str());
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.json();
    let mass = &result["parameters"][0];
    assert_eq!(mass["confidence_interval"]["method"], "posterior");
    assert_eq!(mass["posterior"]["chains"], 32);
    assert_eq!(mass["posterior"]["draws"], 800);
    let quantiles = &mass["posterior"]["quantiles"];
    assert_eq!(quantiles[0]["probability"], 0.025);
    assert_eq!(quantiles[0]["value"], mass["confidence_interval"]["lower"]);

    let draws = app.get(&path).await.expect(200).json();
    assert_eq!(draws["names"], json!(["mass", "viscous_friction"]));
    assert_eq!(draws["units"], json!(["kg", "N*s/m"]));
    let rows = draws["rows"].as_array().unwrap();
    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let csv = app.send(request).await.expect(200).text;
    let mut lines = csv.lines();
    assert_eq!(lines.next(), Some("mass [kg],viscous_friction [N*s/m]"));
    let first: Vec<f64> = lines
        .next()
        .unwrap()
        .split(',')
        .map(|field| field.parse().unwrap())
        .collect();
    assert_eq!(json!(first), rows[0]);
    assert_eq!(lines.count() + 1, rows.len());

    let report = app.get(&format!("/v1/jobs/{id}/report")).await.expect(200);
    assert!(report.text.contains("<h2>Draws from the posterior</h2>"));
    let path = format!("/v1/jobs/{id}/report?format=markdown");
    let markdown = app.get(&path).await.expect(200).text;
    assert!(
        markdown.contains("## Draws from the posterior"),
        "{markdown}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_result_without_draws_says_how_to_ask_for_them() {
    let app = TestApp::start().await;
    let id = app.submit(&drive_job(&app.store_drive().await)).await;
    app.ended(&id).await;
    let problem = app.get(&format!("/v1/jobs/{id}/posterior")).await;
    let problem = problem.problem(409);
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("\"intervals\": \"posterior\""), "{detail}");
}

#[tokio::test(flavor = "multi_thread")]
async fn draws_and_hubers_loss_exclude_each_other() {
    let app = TestApp::start().await;
    let mut job = drawing_job(&app.store_drive().await);
    job["method"]["huber_threshold"] = json!(1.5);
    job["outputs"] = json!({"position": {"noise_std": 1e-3}});
    let problem = app.post_json("/v1/jobs", &job).await.problem(422);
    let detail = problem["errors"][0]["detail"].as_str().unwrap();
    assert!(detail.contains("draws from the posterior"), "{detail}");
}
