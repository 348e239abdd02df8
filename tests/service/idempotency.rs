//! P8: the same key never makes two jobs.

use reqwest::Method;
use serde_json::{Value, json};

use crate::app::{Answer, TestApp, drive_job};

async fn submit(app: &TestApp, key: &str, job: &Value) -> Answer {
    let request = app.request(Method::POST, "/v1/jobs").json(job);
    app.send(request.header("idempotency-key", key)).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_key_and_body_give_the_same_answer_again() {
    let app = TestApp::start().await;
    let job = drive_job(&app.store_drive().await);
    let first = submit(&app, "order-7", &job).await.expect(202);
    let again = submit(&app, "order-7", &job).await.expect(202);
    assert_eq!(again.json(), first.json());
    assert_eq!(again.header("location"), first.header("location"));
    assert_eq!(first.header("idempotent-replayed"), "");
    assert_eq!(again.header("idempotent-replayed"), "true");
    let jobs = app.get("/v1/jobs").await.expect(200).json();
    assert_eq!(jobs["items"].as_array().unwrap().len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_key_at_the_same_time_makes_one_job() {
    let app = TestApp::start().await;
    let job = drive_job(&app.store_drive().await);
    let submissions = (0..8).map(|_| submit(&app, "order-7", &job));
    let answers = futures_util::future::join_all(submissions).await;
    let ids: std::collections::HashSet<String> = answers
        .into_iter()
        .map(|answer| answer.expect(202).json()["id"].to_string())
        .collect();
    assert_eq!(ids.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_key_with_another_body_is_refused() {
    let app = TestApp::start().await;
    let mut job = drive_job(&app.store_drive().await);
    submit(&app, "order-7", &job).await.expect(202);
    job["seed"] = json!(2);
    let problem = submit(&app, "order-7", &job).await.problem(422);
    assert_eq!(problem["type"], "/problems/idempotency-key-reused");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_key_that_is_empty_or_too_long_is_refused() {
    let app = TestApp::start().await;
    let job = drive_job(&app.store_drive().await);
    for key in ["", &"k".repeat(256)] {
        let problem = submit(&app, key, &job).await.problem(422);
        assert_eq!(problem["errors"][0]["header"], "Idempotency-Key");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_repeated_submission_gets_its_answer_even_when_its_recording_is_gone() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let job = drive_job(&dataset);
    let first = submit(&app, "order-7", &job).await.expect(202).json();
    app.ended(first["id"].as_str().unwrap()).await;
    app.delete(&format!("/v1/datasets/{dataset}"))
        .await
        .expect(204);
    let again = submit(&app, "order-7", &job).await.expect(202);
    assert_eq!(again.json(), first);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_key_of_a_deleted_job_makes_no_other() {
    let app = TestApp::start().await;
    let job = drive_job(&app.store_drive().await);
    let first = submit(&app, "order-7", &job).await.expect(202).json();
    let id = first["id"].as_str().unwrap();
    app.ended(id).await;
    app.delete(&format!("/v1/jobs/{id}")).await.expect(204);
    submit(&app, "order-7", &job).await.problem(409);
}
