//! Cancel, pause, resume and delete, each from every state that a client can meet.

use serde_json::Value;

use crate::app::{TestApp, drive_job, endless_job};

/// Starts an endless job and waits until it has done some generations.
async fn running(app: &TestApp) -> String {
    let dataset = app.store_drive().await;
    let id = app.submit(&endless_job(&dataset)).await;
    let events = crate::events::Stream::open(app, &id, None).await;
    events.until(|event| event.name == "generation").await;
    id
}

/// The job after it came to rest, which is in this state.
pub async fn status_after(app: &TestApp, id: &str, wished: &str) -> Value {
    let path = format!("/v1/jobs/{id}");
    loop {
        let job = app.get(&format!("{path}?wait=10")).await.expect(200).json();
        if job["status"] != "running" && job["status"] != "queued" {
            assert_eq!(job["status"], wished);
            return job;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_job_keeps_the_best_estimate_so_far() {
    let app = TestApp::start().await;
    let id = running(&app).await;
    let path = format!("/v1/jobs/{id}");
    let problem = app.get(&format!("{path}/result")).await.problem(409);
    assert!(problem["detail"].as_str().unwrap().contains("running"));
    app.post(&format!("{path}/cancel")).await.expect(200);
    status_after(&app, &id, "cancelled").await;
    let result = app.get(&format!("{path}/result")).await.expect(200).json();
    assert_eq!(result["stop_reason"], "cancelled");
    assert!(result["parameters"][0]["estimate"].is_number());
    app.post(&format!("{path}/cancel")).await.expect(200);
    app.post(&format!("{path}/pause")).await.problem(409);
    app.post(&format!("{path}/resume")).await.problem(409);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_paused_job_goes_on_where_it_stopped() {
    let app = TestApp::start().await;
    let id = running(&app).await;
    let path = format!("/v1/jobs/{id}");
    app.post(&format!("{path}/pause")).await.expect(200);
    let paused = status_after(&app, &id, "paused").await;
    let result = app.get(&format!("{path}/result")).await.expect(200).json();
    assert_eq!(result["stop_reason"], "paused");
    app.post(&format!("{path}/pause")).await.expect(200);

    let stream = crate::events::Stream::open(&app, &id, None).await;
    app.post(&format!("{path}/resume")).await.expect(200);
    let before = paused["progress"]["generation"].as_u64().unwrap();
    let later = |event: &crate::events::StreamEvent| {
        event.name == "generation" && event.data["generation"].as_u64() > Some(before)
    };
    stream.until(later).await;
    app.post(&format!("{path}/cancel")).await.expect(200);
    status_after(&app, &id, "cancelled").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn only_a_job_that_has_ended_is_forgotten() {
    let app = TestApp::start().await;
    let id = running(&app).await;
    let path = format!("/v1/jobs/{id}");
    app.delete(&path).await.problem(409);
    app.post(&format!("{path}/cancel")).await.expect(200);
    app.ended(&id).await;
    app.delete(&path).await.expect(204);
    app.delete(&path).await.problem(404);
    app.get(&format!("{path}/events")).await.problem(404);
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_and_results_have_strong_tags() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    app.ended(&id).await;
    for path in [format!("/v1/jobs/{id}"), format!("/v1/jobs/{id}/result")] {
        let first = app.get(&path).await.expect(200);
        let tag = first.header("etag").to_owned();
        assert!(tag.starts_with('"'), "{tag}");
        let again = app
            .request(reqwest::Method::GET, &path)
            .header("if-none-match", &tag);
        let again = app.send(again).await.expect(304);
        assert_eq!(again.text, "");
        assert_eq!(again.header("etag"), tag);
        let other = app
            .request(reqwest::Method::GET, &path)
            .header("if-none-match", "\"x\"");
        app.send(other).await.expect(200);
    }
}
