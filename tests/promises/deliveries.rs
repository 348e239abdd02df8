//! What a receiver is told through kills and failures: each event at least once, and signed.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::Notify;

use crate::plant;
use crate::server::{Options, Server, text};

/// Times that the server is killed.
const KILLS: usize = 5;
/// Jobs that are submitted to each life of it.
const JOBS: usize = 4;

/// A receiver that fails at every other attempt, whatever it is sent.
#[derive(Clone, Default)]
struct Receiver {
    came: Arc<Mutex<Vec<(HeaderMap, Bytes)>>>,
    /// Jobs whose end it has taken.
    taken: Arc<Mutex<HashMap<String, String>>>,
    news: Arc<Notify>,
}

async fn take(State(receiver): State<Receiver>, headers: HeaderMap, body: Bytes) -> StatusCode {
    let mut came = receiver.came.lock().expect("unpoisoned");
    came.push((headers.clone(), body.clone()));
    if came.len() % 2 == 1 {
        return StatusCode::INTERNAL_SERVER_ERROR;
    }
    let event: Value = serde_json::from_slice(&body).expect("a document");
    let id = headers["webhook-id"].to_str().expect("text").to_owned();
    let mut taken = receiver.taken.lock().expect("unpoisoned");
    taken.insert(text(&event["data"]["job"]), id);
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
    let options = Options {
        threads: 2,
        slice_s: 0.05,
    };
    let receiver = Receiver::default();
    let url = receiver.start().await;
    let mut jobs = HashSet::new();
    let mut secret = String::new();
    for life in 0..=KILLS {
        let server = Server::start_delivering(folder.path(), options);
        if life == 0 {
            let request = server.post("/v1/webhooks").json(&json!({"url": url}));
            let (_, made) = crate::server::answer(request).await.expect("an answer");
            secret = text(&made["secret"]);
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
    let taken: HashSet<String> = {
        let taken = receiver.taken.lock().expect("unpoisoned");
        taken.keys().cloned().collect()
    };
    assert_eq!(taken, jobs);
    let verifier = standardwebhooks::Webhook::new(&secret).expect("a secret");
    for (headers, body) in receiver.came.lock().expect("unpoisoned").iter() {
        verifier.verify(body, headers).expect("a signature");
    }
}
