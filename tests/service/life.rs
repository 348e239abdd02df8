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

/// Submits a short job, and asks something of it when its stream has told so many events. Answers the job
/// and whether it was promised to be as it was asked.
async fn short_job_asked(app: &TestApp, dataset: &str, deed: &str, after: usize) -> (String, bool) {
    let id = app.submit(&drive_job(dataset)).await;
    let mut stream = crate::events::Stream::open(app, &id, None).await;
    for _ in 0..after {
        stream.next().await.expect("an event");
    }
    let answer = app.post(&format!("/v1/jobs/{id}/{deed}")).await;
    let is_promised = answer.status == 200;
    if !is_promised {
        answer.problem(409);
        assert_eq!(app.ended(&id).await["status"], "succeeded");
    }
    (id, is_promised)
}

/// Checks the events of a job that has ended in a state.
async fn ended_once(app: &TestApp, id: &str, status: &str) {
    let events = crate::events::Stream::open(app, id, None).await;
    let events = events.rest().await;
    let ids: Vec<u64> = events.iter().map(|event| event.id).collect();
    assert_eq!(ids, (1..=events.len() as u64).collect::<Vec<_>>());
    let ends = events.iter().filter(|event| event.name == "end");
    assert_eq!(ends.count(), 1);
    let results = events.iter().filter(|event| event.name == "result");
    assert!(results.count() <= 1);
    assert_eq!(events.last().expect("an end").data["status"], status);
}

/// How often a short job is asked at each moment of its life.
const ROUNDS: usize = 3;

#[tokio::test(flavor = "multi_thread")]
async fn what_a_short_job_was_answered_holds_at_every_moment_of_its_life() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    let events = crate::events::Stream::open(&app, &id, None).await;
    let moments = events.rest().await.len();
    let expected = app.get(&format!("/v1/jobs/{id}/result")).await.json();
    for after in (0..moments - 2).flat_map(|after| [after; ROUNDS]) {
        let (id, is_promised) = short_job_asked(&app, &dataset, "cancel", after).await;
        let result = format!("/v1/jobs/{id}/result");
        if is_promised {
            assert_eq!(app.ended(&id).await["status"], "cancelled");
            ended_once(&app, &id, "cancelled").await;
            let answer = app.get(&result).await;
            let reason = (answer.status == 200).then(|| answer.json()["stop_reason"].clone());
            assert!(reason.is_none_or(|reason| reason == "cancelled"));
        }
        let (id, is_promised) = short_job_asked(&app, &dataset, "pause", after).await;
        let path = format!("/v1/jobs/{id}");
        if is_promised {
            status_after(&app, &id, "paused").await;
            app.post(&format!("{path}/resume")).await.expect(200);
        }
        assert_eq!(app.ended(&id).await["status"], "succeeded");
        ended_once(&app, &id, "succeeded").await;
        let result = app.get(&format!("{path}/result")).await.expect(200).json();
        for member in ["parameters", "fit", "stop_reason"] {
            assert_eq!(result[member], expected[member], "{member}");
        }
    }
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

#[tokio::test(flavor = "multi_thread")]
async fn a_running_job_says_how_long_jobs_like_it_took() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let job = drive_job(&dataset);
    for _ in 0..2 {
        let id = app.submit(&job).await;
        assert_eq!(app.ended(&id).await["status"], "succeeded");
        let left = app.get(&format!("/v1/jobs/{id}/time-left")).await;
        assert!(left.expect(200).json()["half_s"].is_null());
    }
    let endless = running(&app).await;
    let left = app
        .get(&format!("/v1/jobs/{endless}/time-left"))
        .await
        .expect(200)
        .json();
    // Two jobs are like it; so few that took longer would tell nothing.
    assert_eq!(left["jobs"], 2);
    assert!(
        left["half_s"].is_null() && left["elapsed_s"].as_f64().unwrap() >= 0.0,
        "{left}"
    );
}
