//! What a project may have and a caller may ask, and whose turn it is.

use greybox_service::access::Scope;
use reqwest::Method;
use serde_json::{Value, json};

use crate::app::{TestApp, drive_csv, drive_job, endless_job};
use crate::monitors::{Events, Plant, append, monitor};
use crate::webhooks::to_this_machine;

#[tokio::test(flavor = "multi_thread")]
async fn a_project_has_as_many_recordings_and_bytes_as_it_may() {
    let app = TestApp::with(|settings| settings.max_datasets = 1).await;
    let first = app.store_drive().await;
    app.post_csv("/v1/datasets", drive_csv()).await.expect(200);
    let other = format!("{}4.00,50,0.1\n", drive_csv());
    let problem = app
        .post_csv("/v1/datasets", other.clone())
        .await
        .problem(429);
    assert_eq!(problem["type"], "/problems/quota");
    app.delete(&format!("/v1/datasets/{first}"))
        .await
        .expect(204);
    app.post_csv("/v1/datasets", other).await.expect(201);
    app.shutdown().await;

    let batch = "time,force [N]\n2026-03-02T08:15:00Z,50\n2026-03-02T08:15:01Z,50\n";
    let app = TestApp::start().await;
    let stored = app.post_csv("/v1/streams/rig-4", batch).await.expect(201);
    let takes = stored.json()["stream"]["bytes"].as_u64().unwrap();
    app.shutdown().await;

    let app = TestApp::with(|settings| settings.max_stored_mib = 0).await;
    let problem = app.post_csv("/v1/datasets", drive_csv()).await.problem(429);
    let detail = problem["detail"].as_str().unwrap();
    // 400 samples of two signals on a uniform axis.
    assert!(detail.contains("this adds 6400"), "{detail}");
    // What streams keep counts too.
    let problem = app.post_csv("/v1/streams/rig-4", batch).await.problem(429);
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains(&format!("this adds {takes}")), "{detail}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_project_has_as_many_unfinished_jobs_as_it_may() {
    let app = TestApp::with(|settings| settings.max_unfinished_jobs = 2).await;
    let dataset = app.store_drive().await;
    let first = app.submit(&endless_job(&dataset)).await;
    let key = || {
        let request = app
            .request(Method::POST, "/v1/jobs")
            .json(&endless_job(&dataset));
        request.header("idempotency-key", "second")
    };
    app.send(key()).await.expect(202);
    let refused = app.post_json("/v1/jobs", &drive_job(&dataset)).await;
    assert_eq!(refused.header("retry-after"), "61");
    assert_eq!(refused.problem(429)["type"], "/problems/quota");
    // What was accepted is told again.
    let again = app.send(key()).await.expect(202);
    assert_eq!(again.header("idempotent-replayed"), "true");
    let two = json!({"job": drive_job(&dataset), "methods": ["icra_genetic"], "seeds": 2});
    app.post(&format!("/v1/jobs/{first}/cancel"))
        .await
        .expect(200);
    app.ended(&first).await;
    app.post_json("/v1/comparisons", &two).await.problem(429);
    app.post_json("/v1/jobs", &drive_job(&dataset))
        .await
        .expect(202);
}

/// A window that has no job for want of room fails with the reason, and the monitor goes on to the next.
#[tokio::test(flavor = "multi_thread")]
async fn the_jobs_of_monitors_count_as_all_others_do() {
    let app = TestApp::with(|settings| settings.max_unfinished_jobs = 1).await;
    let dataset = app.store_drive().await;
    app.submit(&endless_job(&dataset)).await;
    let mut plant = Plant::new();
    append(&app, &plant.window(0, 2.0, 1.0)).await.expect(201);
    let made = app.post_json("/v1/monitors", &monitor()).await.expect(201);
    let id = made.json()["id"].as_str().unwrap().to_owned();
    let mut events = Events::of(&app, &id).await;
    for number in 1..=2 {
        append(&app, &plant.window(number, 2.0, 1.0))
            .await
            .expect(200);
        let told = events.until_window(number as u64 - 1).await;
        let window = &told.last().unwrap().2;
        assert_eq!(window["status"], "failed", "{window}");
        let reason = window["reason"].as_str().unwrap();
        assert!(
            reason.contains("as many unfinished jobs as it may, 1"),
            "{reason}"
        );
    }
    let jobs = app.get("/v1/jobs").await.expect(200).json();
    assert_eq!(jobs["items"].as_array().unwrap().len(), 1);
    // The recordings of those windows were not kept either.
    let datasets = app.get("/v1/datasets").await.expect(200).json();
    assert_eq!(datasets["items"].as_array().unwrap().len(), 1);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn webhooks_made_at_once_are_as_many_as_a_project_may_have() {
    let app = TestApp::with(to_this_machine).await;
    let webhook = json!({"url": "http://127.0.0.1:9/"});
    let requests = (0..80).map(|_| app.post_json("/v1/webhooks", &webhook));
    let answers = futures_util::future::join_all(requests).await;
    let count = |status: u16| answers.iter().filter(|one| one.status == status).count();
    assert_eq!((count(201), count(409)), (50, 30));
    let list = app.get("/v1/webhooks").await.expect(200).json();
    assert_eq!(list["items"].as_array().unwrap().len(), 50);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_project_that_has_had_its_time_today_is_told_until_when() {
    let app = TestApp::with(|settings| settings.work_hours_per_day = Some(0.0)).await;
    let dataset = app.store_drive().await;
    let refused = app.post_json("/v1/jobs", &drive_job(&dataset)).await;
    let wait_s: u32 = refused.header("retry-after").parse().unwrap();
    assert!((1..=86_401).contains(&wait_s));
    let problem = refused.problem(429);
    assert!(problem["detail"].as_str().unwrap().contains("T00:00:00Z"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_caller_that_asks_too_fast_is_told_to_wait_and_others_are_not() {
    let tokens = [("a", Scope::Read, "default"), ("b", Scope::Read, "default")];
    let slow =
        |settings: &mut greybox_service::config::Settings| settings.requests_per_second = 0.001;
    let (app, [a, b]) = TestApp::with_tokens(tokens, slow).await;
    let get = |secret: &str| app.request(Method::GET, "/v1/jobs").bearer_auth(secret);
    app.send(get(&a)).await.expect(200);
    let refused = app.send(get(&a)).await;
    assert!(refused.header("retry-after").parse::<u32>().unwrap() > 900);
    assert_eq!(refused.problem(429)["type"], "/problems/too-many-requests");
    app.send(get(&b)).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_search_that_would_take_too_much_is_told_what_would_fit() {
    let app = TestApp::with(|settings| settings.max_job_derivatives = 1e6).await;
    let dataset = app.store_drive().await;
    for path in ["/v1/jobs", "/v1/jobs?validate_only=true"] {
        let problem = app
            .post_json(path, &endless_job(&dataset))
            .await
            .problem(422);
        assert_eq!(problem["errors"][0]["code"], "too_costly");
    }
    let problem = app
        .post_json("/v1/jobs", &endless_job(&dataset))
        .await
        .problem(422);
    let detail = problem["errors"][0]["detail"].as_str().unwrap();
    let (_, fits) = detail.rsplit_once("; ").unwrap();
    let generations: u32 = fits.split(' ').next().unwrap().parse().unwrap();
    let mut job = endless_job(&dataset);
    job["method"]["generations"] = json!(generations);
    app.post_json("/v1/jobs", &job).await.expect(202);
    job["method"]["generations"] = json!(generations + 1);
    app.post_json("/v1/jobs", &job).await.problem(422);
}

/// One project queues much more than the server works; another's first job is worked all the same.
#[tokio::test(flavor = "multi_thread")]
async fn a_newcomers_job_does_not_wait_for_those_of_another_project() {
    const QUEUED: usize = 100;
    let tokens = [
        ("a", Scope::Submit, "hall-a"),
        ("b", Scope::Submit, "hall-b"),
    ];
    let alone = |settings: &mut greybox_service::config::Settings| {
        settings.jobs_at_once = std::num::NonZeroUsize::new(1);
        settings.slice_s = 0.5;
        settings.requests_per_second = 1e6;
    };
    let (app, [a, b]) = TestApp::with_tokens(tokens, alone).await;
    let post = |secret: &str, path: &str| app.request(Method::POST, path).bearer_auth(secret);
    let mut datasets = Vec::new();
    for secret in [&a, &b] {
        let request = post(secret, "/v1/datasets").header("content-type", "text/csv");
        let stored = app.send(request.body(drive_csv())).await.expect(201).json();
        datasets.push(stored["id"].as_str().unwrap().to_owned());
    }
    let id_of = |job: Value| job["id"].as_str().unwrap().to_owned();
    for _ in 0..QUEUED {
        let request = post(&a, "/v1/jobs").json(&endless_job(&datasets[0]));
        app.send(request).await.expect(202);
    }
    let job = post(&b, "/v1/jobs").json(&drive_job(&datasets[1]));
    let job = id_of(app.send(job).await.expect(202).json());
    loop {
        let path = format!("/v1/jobs/{job}?wait=30");
        let shown = app.request(Method::GET, &path).bearer_auth(&b);
        let shown = app.send(shown).await.expect(200).json();
        if shown["status"] == "succeeded" {
            break;
        }
    }
    // Those of the other project were at work one after another, and most have not begun.
    let queued = app.request(Method::GET, "/v1/jobs?status=queued&limit=500");
    let queued = app.send(queued.bearer_auth(&a)).await.expect(200).json();
    let waiting = queued["items"].as_array().unwrap().len();
    assert!(waiting > QUEUED / 2, "{waiting} of {QUEUED} have not begun");
}
