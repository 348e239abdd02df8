//! What a receiver is told through kills and failures: each event at least once, and signed.

use std::collections::HashSet;
use std::sync::{Arc, Mutex, OnceLock};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde_json::{Value, json};
use standardwebhooks::Webhook;
use tokio::net::TcpListener;
use tokio::sync::Notify;

use crate::plant;
use crate::server::{Options, Server, text};

/// Times that the server is killed.
const KILLS: usize = 5;
/// Jobs that are submitted to each life of it.
const JOBS: usize = 4;

/// A receiver that fails at the first attempt of each event.
#[derive(Clone, Default)]
struct Receiver {
    /// Checks signatures, once the secret is known. An attempt is checked when it comes: its time is signed too, and one
    /// of more than five minutes ago would be refused as a repetition.
    verifier: Arc<OnceLock<Webhook>>,
    /// Identifiers of the events whose first attempt came.
    came: Arc<Mutex<HashSet<String>>>,
    /// What was wrong with an attempt.
    refused: Arc<Mutex<Vec<String>>>,
    /// Jobs whose end it has taken.
    taken: Arc<Mutex<HashSet<String>>>,
    news: Arc<Notify>,
}

async fn take(State(receiver): State<Receiver>, headers: HeaderMap, body: Bytes) -> StatusCode {
    let verifier = receiver
        .verifier
        .get()
        .expect("a secret before the first job");
    if let Err(error) = verifier.verify(&body, &headers) {
        receiver
            .refused
            .lock()
            .expect("unpoisoned")
            .push(error.to_string());
    }
    let id = headers["webhook-id"].to_str().expect("text").to_owned();
    if receiver.came.lock().expect("unpoisoned").insert(id) {
        return StatusCode::INTERNAL_SERVER_ERROR;
    }
    let event: Value = serde_json::from_slice(&body).expect("a document");
    let mut taken = receiver.taken.lock().expect("unpoisoned");
    taken.insert(text(&event["data"]["job"]));
    receiver.news.notify_one();
    StatusCode::OK
}

impl Receiver {
    async fn start(&self) -> String {
        let routes = Router::new().fallback(take).with_state(self.clone());
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        tokio::spawn(async move { axum::serve(listener, routes).await });
        format!("http://{address}/")
    }

    /// Returns when it has taken the end of so many jobs.
    async fn has_taken(&self, jobs: usize) {
        while self.taken.lock().expect("unpoisoned").len() < jobs {
            self.news.notified().await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn every_end_of_a_job_is_delivered_through_kills_and_a_receiver_that_fails() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options::new(2, 0.05);
    let receiver = Receiver::default();
    let url = receiver.start().await;
    let mut jobs = HashSet::new();
    for life in 0..=KILLS {
        let server = Server::start_delivering(folder.path(), options);
        if life == 0 {
            let request = server.post("/v1/webhooks").json(&json!({"url": url}));
            let (_, made) = crate::server::answer(request).await.expect("an answer");
            let verifier = Webhook::new(&text(&made["secret"])).expect("a secret");
            assert!(receiver.verifier.set(verifier).is_ok(), "one secret");
        }
        let dataset = server.store(&plant::recording(200)).await;
        for number in 0..JOBS {
            let key = format!("{life}-{number}");
            let job = plant::job(&dataset, 3, number as u64);
            jobs.insert(server.submit(&job, &key).await.expect("a live server"));
        }
        if life < KILLS {
            receiver.has_taken(life * JOBS + 1).await;
            server.kill();
        } else {
            receiver.has_taken(jobs.len()).await;
        }
    }
    assert_eq!(*receiver.taken.lock().expect("unpoisoned"), jobs);
    let refused = receiver.refused.lock().expect("unpoisoned");
    assert!(refused.is_empty(), "{refused:?}");
}
