//! A client that follows the events of a job, and comes back after the server was gone.

use std::time::Duration;

use futures_util::StreamExt;

use super::server::Server;

/// An event as it was received.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    pub id: u64,
    pub name: String,
    pub data: String,
}

/// What a client has received of a job so far.
#[derive(Clone, Debug)]
pub struct Follower {
    pub job: String,
    pub events: Vec<Event>,
}

impl Follower {
    pub fn new(job: &str) -> Self {
        Self {
            job: job.to_owned(),
            events: Vec::new(),
        }
    }

    /// Whether the last event was received.
    pub fn has_ended(&self) -> bool {
        self.events.last().is_some_and(|event| event.name == "end")
    }

    /// Receives events after those it has, until the stream ends or breaks.
    pub async fn follow(mut self, server: &Server) -> Self {
        self.receive(server, |_| false).await;
        self
    }

    /// Receives events after those it has, until they are enough, or the stream ends or breaks.
    pub async fn follow_until(
        mut self,
        server: &Server,
        is_enough: impl Fn(&[Event]) -> bool,
    ) -> Self {
        self.receive(server, is_enough).await;
        self
    }

    /// Receives events for a while.
    pub async fn follow_for(mut self, server: &Server, while_: Duration) -> Self {
        // What was received before the time was up is kept.
        let _ = tokio::time::timeout(while_, self.receive(server, |_| false)).await;
        self
    }

    async fn receive(&mut self, server: &Server, is_enough: impl Fn(&[Event]) -> bool) {
        let last = self.events.last().map_or(0, |event| event.id);
        let request = server
            .get(&format!("/v1/jobs/{}/events", self.job))
            .header("last-event-id", last.to_string());
        let Ok(answer) = request.send().await else {
            return;
        };
        let mut body = answer.bytes_stream();
        let mut received = Vec::new();
        while !is_enough(&self.events)
            && let Some(Ok(bytes)) = body.next().await
        {
            received.extend_from_slice(&bytes);
            // An event counts when the empty line after it has come.
            while let Some(end) = received.windows(2).position(|pair| pair == b"\n\n") {
                let block: Vec<u8> = received.drain(..end + 2).collect();
                self.events.extend(event(&block));
            }
        }
    }
}

/// The event of a block, which may be only a comment.
fn event(block: &[u8]) -> Option<Event> {
    let block = std::str::from_utf8(block).expect("a stream of text");
    let field = |name: &str| {
        let mut lines = block.lines();
        lines.find_map(|line| line.strip_prefix(name)?.strip_prefix(": "))
    };
    Some(Event {
        id: field("id")?.parse().expect("a number"),
        name: field("event").expect("a name").to_owned(),
        data: field("data").expect("data").to_owned(),
    })
}
