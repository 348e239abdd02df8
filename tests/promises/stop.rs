//! P6 and P7: a stop takes effect soon and loses nothing.

use std::time::{Duration, Instant};

use reqwest::StatusCode;

use super::plant;
use super::server::{Options, Server, answer, text};

const OPTIONS: Options = Options::new(2, 3600.0);

/// More generations than any test waits for.
const ENDLESS: u32 = 1_000_000;

/// A server at work on an endless job that has an estimate already.
async fn at_work(folder: &std::path::Path) -> (Server, String) {
    let server = Server::start(folder, OPTIONS);
    let dataset = server.store(&plant::recording(3000)).await;
    let job = plant::job(&dataset, ENDLESS, 1);
    let job = server.submit(&job, "endless").await.expect("an answer");
    server.in_state(&job, "running").await;
    let asked = Instant::now();
    loop {
        let page = server
            .show(&format!("/v1/jobs/{job}/generations?limit=1"))
            .await;
        if page["items"]
            .as_array()
            .is_some_and(|rows| !rows.is_empty())
        {
            return (server, job);
        }
        assert!(
            asked.elapsed() < super::server::PATIENCE,
            "no generation came"
        );
        tokio::task::yield_now().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn p6_cancel_and_pause_take_effect_within_two_seconds_and_keep_the_estimate() {
    let folder = tempfile::tempdir().expect("a folder");
    let (server, job) = at_work(folder.path()).await;
    for (deed, state) in [
        ("pause", "paused"),
        ("resume", "running"),
        ("cancel", "cancelled"),
    ] {
        let asked = Instant::now();
        let request = server.post(&format!("/v1/jobs/{job}/{deed}"));
        let (status, body) = answer(request).await.expect("an answer");
        assert!(status.is_success(), "{body}");
        server.in_state(&job, state).await;
        assert!(asked.elapsed() < Duration::from_secs(2), "{deed}");
        if deed != "resume" {
            let result = server.show(&format!("/v1/jobs/{job}/result")).await;
            assert_eq!(result["stop_reason"], state);
            assert!(result["parameters"][0]["estimate"].is_number());
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn p7_sigterm_ends_the_process_within_five_seconds_and_loses_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let (server, job) = at_work(folder.path()).await;
    let stream = server.get(&format!("/v1/jobs/{job}/events")).send().await;
    let stream = stream.expect("a stream");
    assert_eq!(stream.status(), StatusCode::OK);
    let reading = tokio::spawn(stream.text());
    let (status, took) = server.terminate();
    assert!(status.success(), "{status}");
    assert!(took < Duration::from_secs(5), "{took:?}");
    let told = reading
        .await
        .expect("a reader")
        .expect("a stream that ends in order");
    assert!(!told.contains("event: end"), "the job goes on");

    let server = Server::start(folder.path(), OPTIONS);
    let shown = server.show(&format!("/v1/jobs/{job}")).await;
    assert_eq!(text(&shown["status"]), "running");
    assert!(shown["progress"]["generation"].as_u64() >= Some(1));
    let cancel = server.post(&format!("/v1/jobs/{job}/cancel"));
    answer(cancel).await.expect("an answer");
    server.in_state(&job, "cancelled").await;
}
