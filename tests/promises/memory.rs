//! No body takes more memory than a multiple of its size and a constant, whatever it holds: the process
//! is asked how much it had at the most.
//!
//! Each body comes to a server of its own, which has done nothing else: what an allocator keeps of an
//! earlier body does not count for a later one.

#![cfg(target_os = "linux")]

use std::sync::Arc;

use greybox::intake::{MEMORY_ALWAYS, MEMORY_PER_BYTE};
use reqwest::StatusCode;
use tokio::task::JoinSet;

use super::hostile::{Body, Outcome, damaged_bodies, whole_bodies};
use super::plant;
use super::server::{Options, Server, answer};

/// Damaged bodies beside the whole ones, where `GREYBOX_TESTS_BODIES` does not say how many.
const DAMAGED_BODIES: usize = 8;

/// What became of a body.
struct Told {
    /// The memory that it took beyond what the server had before `[bytes]`.
    memory: u64,
    status: StatusCode,
    answer: serde_json::Value,
}

async fn sent(body: Body) -> Told {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), Options::new(1, 1.0));
    // What the first request makes is not the body's.
    let first = server
        .post("/v1/datasets")
        .header("content-type", "text/csv");
    let first = answer(first.body("time [s],a\n0,1\n1,2\n")).await;
    assert!(first.expect("an answer").0.is_success());
    server.forget_memory();
    let before = server.most_memory();
    let path = format!("/v1/datasets{}", body.query);
    let mut request = server.post(&path).header("content-type", body.media_type);
    if body.is_gzip {
        request = request.header("content-encoding", "gzip");
    }
    let answered = answer(request.body(body.bytes)).await;
    let (status, answer) = answered.unwrap_or_else(|error| panic!("{}: {error}", body.name));
    let memory = server.most_memory() - before;
    let alive = server.get("/livez").send().await;
    assert!(alive.is_ok_and(|alive| alive.status().is_success()));
    Told {
        memory,
        status,
        answer,
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn no_body_takes_more_than_four_times_its_size_and_64_mib_of_memory() {
    let mut broken = Vec::new();
    let wanted = std::env::var("GREYBOX_TESTS_BODIES").ok();
    let damaged = wanted.map_or(DAMAGED_BODIES, |wanted| wanted.parse().expect("a number"));
    for body in whole_bodies()
        .into_iter()
        .chain(damaged_bodies().take(damaged))
    {
        let (name, size, outcome) = (body.name, body.size, body.outcome);
        let told = sent(body).await;
        let most = MEMORY_PER_BYTE * size + MEMORY_ALWAYS;
        let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
        let row = format!(
            "{name}: {:.1} MiB took {:.0} of {:.0} MiB, {}: {}",
            mib(size),
            mib(told.memory),
            mib(most),
            told.status,
            told.answer["detail"].as_str().unwrap_or_default()
        );
        println!("{row}");
        let is_expected = match outcome {
            Outcome::Stored => told.status.is_success(),
            Outcome::Refused(code) => {
                let errors = told.answer["errors"].as_array().into_iter().flatten();
                let mut codes = errors.map(|error| &error["code"]);
                told.status.is_client_error() && codes.any(|met| met == code)
            }
            Outcome::Answered => told.status.is_success() || told.status.is_client_error(),
        };
        if told.memory > most || !is_expected {
            broken.push(row);
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// The address space of a server with little memory `[bytes]`.
const LITTLE_MEMORY: u64 = 700 << 20;

#[tokio::test(flavor = "multi_thread")]
async fn a_server_with_little_memory_answers_recordings_that_come_together() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options::new(2, 1.0);
    let Some(server) = Server::start_with_memory(folder.path(), options, LITTLE_MEMORY) else {
        eprintln!("skipped: there is no prlimit here");
        return;
    };
    let row = |row: u32| format!("{row},{},{}\n", row % 7, row % 11);
    let rows: Arc<str> = (0..2_000_000).map(row).collect::<String>().into();
    let mut uploads = JoinSet::new();
    for number in 0..8 {
        let request = server
            .post("/v1/datasets")
            .header("content-type", "text/csv")
            .body(format!("time [s],force [N],x{number} [m]\n{rows}"));
        uploads.spawn(async { answer(request).await.expect("an answer").0 });
    }
    let statuses = uploads.join_all().await;
    // Who waits too long for a turn is told to come again.
    let expected = [StatusCode::CREATED, StatusCode::SERVICE_UNAVAILABLE];
    assert!(
        statuses.iter().all(|status| expected.contains(status)),
        "{statuses:?}"
    );
    assert!(statuses.contains(&StatusCode::CREATED), "{statuses:?}");
    let dataset = server.store(&plant::recording(150)).await;
    let job = server.submit(&plant::job(&dataset, 5, 1), "a job").await;
    let ended = server.ended(&job.expect("an answer")).await;
    assert_eq!(ended["status"], "succeeded", "{ended}");
}
