//! A disk that is full for a while: what was acknowledged is kept, and all goes on once there is room.
//!
//! A limit of the size of files stands for the full disk: it is set on the running server and lifted
//! again, by anybody. Where the system has no `prlimit` the test says so and ends.

#![cfg(target_os = "linux")]

use std::time::{Duration, Instant};

use reqwest::StatusCode;

use super::plant;
use super::server::{Options, PATIENCE, Server, answer};

const OPTIONS: Options = Options::new(2, 0.05);

/// Asks until the server says that it is ready, or that it is not.
async fn until_ready_is(server: &Server, wanted: StatusCode) -> serde_json::Value {
    let asked = Instant::now();
    while asked.elapsed() < PATIENCE {
        let (status, body) = answer(server.get("/readyz")).await.expect("an answer");
        if status == wanted {
            return body;
        }
    }
    panic!("/readyz did not become {wanted}");
}

#[tokio::test(flavor = "multi_thread")]
async fn p3_a_disk_that_was_full_loses_nothing_and_is_written_again_within_five_seconds() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start_limitable(folder.path(), OPTIONS);
    if !server.limit_files("unlimited") {
        eprintln!("skipped: there is no prlimit here");
        return;
    }
    let dataset = server.store(&plant::recording(150)).await;
    let mut accepted = Vec::new();
    for round in 0..6 {
        let job = plant::job(&dataset, 5, round);
        let key = format!("before {round}");
        accepted.push(server.submit(&job, &key).await.expect("an answer"));
        assert!(server.limit_files("1"));
        let unready = until_ready_is(&server, StatusCode::SERVICE_UNAVAILABLE).await;
        let why = unready["detail"].as_str().expect("a reason");
        assert!(why.contains("disk") || why.contains("written"), "{why}");
        let refused = server.post("/v1/jobs").json(&job).send().await;
        let refused = refused.expect("an answer");
        let status = refused.status().as_u16();
        assert!(status == 503 || status == 507, "{status}");
        assert!(refused.headers().contains_key("retry-after"));
        let problem: serde_json::Value = refused.json().await.expect("a problem");
        let detail = problem["detail"].as_str().expect("a detail");
        assert!(!detail.contains("shutting down"), "{detail}");

        assert!(server.limit_files("unlimited"));
        let room = Instant::now();
        until_ready_is(&server, StatusCode::OK).await;
        let key = format!("after {round}");
        let job = plant::job(&dataset, 5, round);
        accepted.push(server.submit(&job, &key).await.expect("an answer"));
        assert!(room.elapsed() < Duration::from_secs(5), "the promise");
    }
    for job in accepted {
        let ended = server.ended(&job).await;
        assert_eq!(ended["status"], "succeeded", "{ended}");
    }
}
