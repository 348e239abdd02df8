//! P5: event ids have no gap and no repeat, whenever a client comes and comes back.

use std::pin::Pin;

use futures_util::{Stream as Chunks, StreamExt};
use reqwest::Method;
use serde_json::Value;

use crate::app::{TestApp, drive_job, endless_job};

/// An event as a client reads it.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamEvent {
    pub id: u64,
    pub name: String,
    pub data: Value,
}

/// A client's stream of a job's events.
pub struct Stream {
    chunks: Pin<Box<dyn Chunks<Item = reqwest::Result<bytes::Bytes>> + Send>>,
    text: String,
}

impl Stream {
    pub async fn open(app: &TestApp, job: &str, last_event_id: Option<u64>) -> Self {
        let mut request = app.request(Method::GET, &format!("/v1/jobs/{job}/events"));
        if let Some(id) = last_event_id {
            request = request.header("last-event-id", id);
        }
        Self::of(request).await
    }

    pub async fn of(request: reqwest::RequestBuilder) -> Self {
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        let mut stream = Self {
            chunks: Box::pin(response.bytes_stream()),
            text: String::new(),
        };
        assert_eq!(stream.block().await.as_deref(), Some("retry: 2000"));
        stream
    }

    /// The next block of lines; `None` at the end of the stream.
    async fn block(&mut self) -> Option<String> {
        loop {
            if let Some((block, rest)) = self.text.split_once("\n\n") {
                let block = block.to_owned();
                self.text = rest.to_owned();
                return Some(block);
            }
            let chunk = self.chunks.next().await?.unwrap();
            self.text += std::str::from_utf8(&chunk).unwrap();
        }
    }

    /// The next change of the stream of all jobs, which has no identifiers.
    async fn next_change(&mut self) -> (String, Value) {
        loop {
            let block = self.block().await.expect("the stream goes on");
            let event = block.split_once('\n').and_then(|(name, data)| {
                Some((name.strip_prefix("event: ")?, data.strip_prefix("data: ")?))
            });
            if let Some((name, data)) = event {
                return (name.to_owned(), serde_json::from_str(data).unwrap());
            }
            assert!(block.starts_with(':'), "{block}");
        }
    }

    /// The next event, past comments.
    pub async fn next(&mut self) -> Option<StreamEvent> {
        loop {
            let block = self.block().await?;
            if block.starts_with(':') {
                continue;
            }
            let field = |name: &str| {
                let line = block.lines().find_map(|line| line.strip_prefix(name));
                line.unwrap_or_else(|| panic!("{name} in {block}"))
                    .to_owned()
            };
            return Some(StreamEvent {
                id: field("id: ").parse().unwrap(),
                name: field("event: "),
                data: serde_json::from_str(&field("data: ")).unwrap(),
            });
        }
    }

    /// Reads until `wanted` comes.
    pub async fn until(mut self, wanted: impl Fn(&StreamEvent) -> bool) -> StreamEvent {
        while let Some(event) = self.next().await {
            if wanted(&event) {
                return event;
            }
        }
        panic!("the stream ended before");
    }

    /// Reads to the end.
    pub async fn rest(mut self) -> Vec<StreamEvent> {
        let mut events = Vec::new();
        while let Some(event) = self.next().await {
            events.push(event);
        }
        events
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_tells_a_job_from_its_first_event_to_its_end() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    let events = Stream::open(&app, &id, None).await.rest().await;
    let ids: Vec<u64> = events.iter().map(|event| event.id).collect();
    assert_eq!(ids, (1..=events.len() as u64).collect::<Vec<_>>());
    assert_eq!(events[0].name, "state");
    assert_eq!(events[0].data["status"], "queued");
    assert_eq!(events[1].data["status"], "running");
    let end = events.last().unwrap();
    assert_eq!(
        (end.name.as_str(), &end.data["status"]),
        ("end", &"succeeded".into())
    );
    let names: std::collections::HashSet<&str> = events.iter().map(|e| e.name.as_str()).collect();
    for name in ["generation", "refinement", "result"] {
        assert!(names.contains(name), "{name}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_comes_back_misses_nothing_and_gets_nothing_twice() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    let whole = Stream::open(&app, &id, None).await.rest().await;
    for last in 0..whole.len() as u64 {
        let rest = Stream::open(&app, &id, Some(last)).await.rest().await;
        assert_eq!(rest, whole[last as usize..]);
    }
    let path = format!("/v1/jobs/{id}/events");
    let query = app
        .get(&format!("{path}?last_event_id={}", whole.len() - 1))
        .await
        .expect(200);
    assert!(query.text.contains("event: end"));
    assert!(!query.text.contains("event: result"));
    let ended = app
        .request(Method::GET, &path)
        .header("last-event-id", whole.len());
    app.send(ended).await.expect(204);
}

#[tokio::test(flavor = "multi_thread")]
async fn many_readers_see_the_same_events() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    let mut streams = Vec::new();
    for _ in 0..10 {
        streams.push(Stream::open(&app, &id, None).await.rest());
    }
    let told = futures_util::future::join_all(streams).await;
    assert!(told.iter().all(|events| *events == told[0]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_ends_when_the_server_does() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&endless_job(&dataset)).await;
    let mut stream = Stream::open(&app, &id, None).await;
    assert_eq!(stream.next().await.expect("the first event").id, 1);
    let reader = tokio::spawn(stream.rest());
    app.shutdown().await;
    let rest = reader.await.expect("an orderly end of the stream");
    assert!(rest.iter().all(|event| event.name != "end"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_last_event_that_is_no_number_is_refused() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    let path = format!("/v1/jobs/{id}/events");
    for bad in ["x", "-1", "1.5", "9007199254740992"] {
        let request = app.request(Method::GET, &path).header("last-event-id", bad);
        let problem = app.send(request).await.problem(422);
        assert_eq!(problem["errors"][0]["header"], "Last-Event-ID");
    }
}

/// The changes of all jobs: each as the list shows it, and those that were deleted.
#[tokio::test(flavor = "multi_thread")]
async fn the_changes_of_all_jobs_come_as_one_stream() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut stream = Stream::of(app.request(Method::GET, "/v1/events")).await;
    let id = app.submit(&drive_job(&dataset)).await;
    let mut seen = Vec::new();
    let last = loop {
        let (name, data) = stream.next_change().await;
        assert_eq!(
            (name.as_str(), &data["id"]),
            ("job", &Value::from(id.as_str()))
        );
        seen.push(data["status"].as_str().unwrap().to_owned());
        if data["status"] == "succeeded" {
            break data;
        }
    };
    seen.dedup();
    let order = ["queued", "running", "succeeded"];
    let places = seen
        .iter()
        .map(|status| order.iter().position(|known| known == status));
    assert!(places.is_sorted(), "{seen:?}");
    let listed = app.get("/v1/jobs?view=summary").await.expect(200).json();
    assert_eq!(listed["items"][0], last);
    app.delete(&format!("/v1/jobs/{id}")).await.expect(204);
    let (name, data) = stream.next_change().await;
    assert_eq!(
        (name.as_str(), data["id"].as_str()),
        ("removed", Some(id.as_str()))
    );
}
