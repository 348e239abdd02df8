//! Server-sent events, read as they come.
//!
//! As far as this service sends them (HTML Living Standard, section 9.2.6): `event` and `data` of
//! one line each, an empty line after each event; comments and other fields are passed over.

use super::error::CommandError;
use serde_json::Value;

/// The longest event that is taken; the service's are far shorter.
const LONGEST_EVENT: usize = 1 << 20;

/// One event.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The name of the event.
    pub name: String,
    /// The data of the event.
    pub data: Value,
}

/// The events of an answer, in order.
#[derive(Debug)]
pub struct EventStream {
    answer: reqwest::Response,
    received: Received,
}

impl EventStream {
    /// The events of an answer that has begun.
    pub fn of(answer: reqwest::Response) -> EventStream {
        EventStream {
            answer,
            received: Received::default(),
        }
    }

    /// The next event; none at the end of the stream.
    pub async fn next(&mut self) -> Result<Option<Event>, CommandError> {
        loop {
            if let Some(event) = self.received.take_event()? {
                return Ok(Some(event));
            }
            let piece = self.answer.chunk().await.map_err(broken)?;
            let Some(piece) = piece else {
                return Ok(None);
            };
            self.received.bytes.extend_from_slice(&piece);
            if self.received.bytes.len() > LONGEST_EVENT {
                return Err(broken("an event is too long"));
            }
        }
    }
}

fn broken(error: impl std::fmt::Display) -> CommandError {
    CommandError::failed(format!("the event stream broke off: {error}"))
}

/// What has come and has not been understood yet.
#[derive(Debug, Default)]
struct Received {
    bytes: Vec<u8>,
}

impl Received {
    /// The first complete event, taken out.
    fn take_event(&mut self) -> Result<Option<Event>, CommandError> {
        while let Some(end) = self.bytes.windows(2).position(|pair| pair == b"\n\n") {
            let block: Vec<u8> = self.bytes.drain(..end + 2).collect();
            let block = String::from_utf8_lossy(&block);
            let field = |name: &str| {
                let mut lines = block.lines();
                lines.find_map(|line| line.strip_prefix(name)?.strip_prefix(": "))
            };
            if let (Some(name), Some(data)) = (field("event"), field("data")) {
                return Ok(Some(Event {
                    name: name.to_owned(),
                    data: serde_json::from_str(data).map_err(broken)?,
                }));
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn events_are_read_from_pieces_of_any_size() {
        let text = "retry: 2000\n\n: alive\n\nid: 1\nevent: state\ndata: {\"status\":\"queued\"}\n\n\
                    id: 2\nevent: end\ndata: {\"status\":\"succeeded\"}\n\n";
        for size in 1..text.len() {
            let mut received = Received::default();
            let mut events = Vec::new();
            for piece in text.as_bytes().chunks(size) {
                received.bytes.extend_from_slice(piece);
                let complete = std::iter::from_fn(|| received.take_event().expect("events"));
                events.extend(complete.map(|event| (event.name, event.data)));
            }
            let state = ("state".to_owned(), json!({"status": "queued"}));
            let end = ("end".to_owned(), json!({"status": "succeeded"}));
            assert_eq!(events, [state, end]);
        }
    }

    #[test]
    fn data_that_is_not_json_is_an_error() {
        let mut received = Received {
            bytes: b"event: state\ndata: {\n\n".to_vec(),
        };
        assert!(received.take_event().is_err());
    }
}
