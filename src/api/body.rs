//! Request bodies: received as they come, bounded in bytes and in time, hashed on the way, and parsed
//! once they are there. A small one waits in memory, a larger one on disk; while a client is slow to
//! send, it holds nothing that others need.

use std::io::{self, Read, Write};
use std::pin::pin;
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::{FromRef, FromRequest, Request};
use axum::http::{HeaderMap, header};
use futures_util::{Stream, StreamExt};
use serde_json::Value;
use sha2::{Digest, Sha256};
use tokio::time::Instant;

use super::error::{Answer, Kind, Problem};
use super::limits::Limits;
use super::spool::{Spool, SpoolRoom};
use super::work::{LARGE_BYTES, Work};
use crate::event::EventHub;
use crate::store::{Datasets, Meaning};
use greybox::intake::ReadError;
use greybox::parsing::{json, yaml};

/// Bytes of a body that a client has to send in each [`LEAST_BYTES_IN`], or the rest of the body.
const LEAST_BYTES: usize = 16 << 10;
/// The time in which a client has to send [`LEAST_BYTES`] of a body, or the rest of the body.
const LEAST_BYTES_IN: Duration = Duration::from_secs(20);

/// A body of so many bytes at the most waits in memory until all of it is there.
const IN_MEMORY: usize = 256 << 10;

/// A document of so many bytes at the most is parsed where it was received: that takes less time
/// than handing it to another thread.
const SMALL_BYTES: usize = 32 << 10;

/// How packed files begin: workbooks and other archives, old workbooks, Parquet, gzip.
const PACKED: [&[u8]; 4] = [b"PK", b"\xd0\xcf\x11\xe0", b"PAR1", b"\x1f\x8b"];

/// A parsed body: the parser's answer, and the digest of all the bytes.
pub struct Parsed<T> {
    /// What the parser made of the body.
    pub value: T,
    /// SHA-256 of the body, after any decompression.
    pub digest: Sha256,
}

/// A body that has come.
pub struct Received {
    content: Content,
    /// SHA-256 of the body, after any decompression.
    pub digest: Sha256,
}

enum Content {
    Memory(Vec<u8>),
    Disk(Spool),
}

impl Received {
    /// How many bytes came; of a packed file, which takes more than it has, as many as of a large one at the least.
    pub(super) fn bytes(&self) -> usize {
        match &self.content {
            Content::Memory(bytes) if PACKED.iter().any(|begin| bytes.starts_with(begin)) => {
                bytes.len().max(LARGE_BYTES)
            }
            Content::Memory(bytes) => bytes.len(),
            Content::Disk(spool) => spool.bytes(),
        }
    }

    /// The bytes.
    pub fn into_reader(self) -> Answer<Box<dyn Read + Send>> {
        Ok(match self.content {
            Content::Memory(bytes) => Box::new(io::Cursor::new(bytes)),
            Content::Disk(spool) => {
                let reader = spool.into_reader();
                Box::new(reader.map_err(|error| scratch_failed(&error))?)
            }
        })
    }
}

/// Receives bodies, and writes large answers, by way of the disk. Cheap to clone.
#[derive(Clone)]
pub struct Bodies {
    /// Ends what is being received when the server goes down.
    hub: EventHub,
    /// Runs parsers.
    pub(super) work: Work,
    /// Makes temporary files beside the database.
    pub(super) datasets: Datasets,
    /// The disk that all spools share.
    room: SpoolRoom,
    /// The bytes of a JSON document at the most.
    document_bytes: u64,
    /// The bytes of a recording at the most.
    pub(super) dataset_bytes: u64,
}

impl Bodies {
    /// Bodies within limits.
    pub(super) fn new(limits: &Limits, hub: EventHub, work: Work, datasets: Datasets) -> Self {
        Self {
            hub,
            work,
            datasets,
            room: SpoolRoom::new(limits.spool_bytes),
            document_bytes: limits.document_bytes,
            dataset_bytes: limits.dataset_bytes,
        }
    }

    /// A new spool.
    pub(super) fn spool(&self) -> io::Result<Spool> {
        Ok(self.room.spool(self.datasets.nameless_file()?))
    }

    /// Receives a body of at most `limit` bytes.
    pub async fn receive(&self, body: Body, limit: u64) -> Answer<Received> {
        let chunks = body.into_data_stream();
        let receiving = pin!(self.receive_chunks(chunks, limit));
        tokio::select! {
            received = receiving => received,
            () = self.hub.closed() => Err(Problem::shutting_down()),
        }
    }

    async fn receive_chunks<E: std::fmt::Display>(
        &self,
        chunks: impl Stream<Item = Result<Bytes, E>>,
        limit: u64,
    ) -> Answer<Received> {
        let mut chunks = pin!(chunks);
        let mut pace = Pace::begin();
        let mut digest = Sha256::new();
        let (mut memory, mut disk) = (Vec::new(), None);
        let mut left = limit;
        while let Some(chunk) = pace.next(&mut chunks).await? {
            digest.update(&chunk);
            let Some(rest) = left.checked_sub(chunk.len() as u64) else {
                // A client that is still sending could not hear the answer.
                skip(&mut pace, &mut chunks, limit).await?;
                return Err(Problem::too_large(limit));
            };
            left = rest;
            memory.extend_from_slice(&chunk);
            if memory.len() > IN_MEMORY {
                disk = Some(self.put_aside(disk, std::mem::take(&mut memory)).await?);
            }
        }
        let content = match disk {
            None => Content::Memory(memory),
            Some(disk) => Content::Disk(self.put_aside(Some(disk), memory).await?),
        };
        Ok(Received { content, digest })
    }

    async fn put_aside(&self, spool: Option<Spool>, bytes: Vec<u8>) -> Answer<Spool> {
        let bodies = self.clone();
        let written = tokio::task::spawn_blocking(move || {
            let mut spool = match spool {
                Some(spool) => spool,
                None => bodies.spool()?,
            };
            spool.write_all(&bytes)?;
            Ok(spool)
        });
        let written = written.await.unwrap_or_else(|panic| Err(panic.into()));
        written.map_err(|error| scratch_failed(&error))
    }

    /// Receives a body of at most `limit` bytes and runs a blocking parser on it.
    pub async fn parse<T, P>(&self, body: Body, limit: u64, parser: P) -> Answer<Parsed<T>>
    where
        T: Send + 'static,
        P: FnOnce(&mut dyn Read) -> Result<T, Problem> + Send + 'static,
    {
        let received = self.receive(body, limit).await?;
        self.parse_received(received, parser).await
    }

    /// Runs a blocking parser on a body that has come.
    pub async fn parse_received<T, P>(&self, received: Received, parser: P) -> Answer<Parsed<T>>
    where
        T: Send + 'static,
        P: FnOnce(&mut dyn Read) -> Result<T, Problem> + Send + 'static,
    {
        let digest = received.digest.clone();
        let value = self.work.convert_bytes(received.bytes(), move || {
            parser(&mut received.into_reader()?)
        });
        Ok(Parsed {
            value: value.await?,
            digest,
        })
    }
}

/// Takes in what a client sends beyond the limit, as much again at the most.
async fn skip<E: std::fmt::Display>(
    pace: &mut Pace,
    chunks: &mut (impl Stream<Item = Result<Bytes, E>> + Unpin),
    limit: u64,
) -> Answer<()> {
    let mut left = limit;
    while let Some(chunk) = pace.next(chunks).await? {
        match left.checked_sub(chunk.len() as u64) {
            Some(rest) => left = rest,
            None => break,
        }
    }
    Ok(())
}

/// How fast a body comes.
struct Pace {
    until: Instant,
    /// What has come since the last look.
    bytes: usize,
}

impl Pace {
    fn begin() -> Self {
        Self {
            until: Instant::now() + LEAST_BYTES_IN,
            bytes: 0,
        }
    }

    /// The next piece; a problem where the body breaks off or comes too slowly.
    async fn next<E: std::fmt::Display>(
        &mut self,
        chunks: &mut (impl Stream<Item = Result<Bytes, E>> + Unpin),
    ) -> Answer<Option<Bytes>> {
        loop {
            match tokio::time::timeout_at(self.until, chunks.next()).await {
                Ok(None) => return Ok(None),
                Ok(Some(Ok(chunk))) => {
                    self.bytes += chunk.len();
                    return Ok(Some(chunk));
                }
                Ok(Some(Err(error))) => {
                    let detail = format!("the body broke off: {error}");
                    return Err(Problem::new(Kind::Malformed, detail));
                }
                Err(_time_is_up) => self.time_is_up()?,
            }
        }
    }

    /// Begins anew where enough came; else a problem.
    fn time_is_up(&mut self) -> Answer<()> {
        if self.bytes >= LEAST_BYTES {
            *self = Self::begin();
            return Ok(());
        }
        let detail = format!(
            "{} bytes came in {} s; at least {LEAST_BYTES} do of a body that goes on",
            self.bytes,
            LEAST_BYTES_IN.as_secs()
        );
        Err(Problem::new(Kind::RequestTimeout, detail))
    }
}

/// A JSON body, parsed strictly, and what identifies it.
pub struct JsonDocument {
    /// The document.
    pub value: Value,
    /// SHA-256 of its bytes in hexadecimal digits.
    pub digest: String,
}

impl<S: Send + Sync> FromRequest<S> for JsonDocument
where
    Bodies: FromRef<S>,
{
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Answer<Self> {
        let bodies = Bodies::from_ref(state);
        if content_type(request.headers()) != "application/json" {
            return Err(unsupported(request.headers(), "application/json"));
        }
        let limit = bodies.document_bytes;
        let received = bodies.receive(request.into_body(), limit).await?;
        let parsed = match &received.content {
            Content::Memory(text) if text.len() <= SMALL_BYTES => Parsed {
                value: parse_json(text)?,
                digest: received.digest,
            },
            _ => {
                let parser = |source: &mut dyn Read| parse_json(&whole(source)?);
                bodies.parse_received(received, parser).await?
            }
        };
        Ok(Self {
            value: parsed.value,
            digest: hex::encode(parsed.digest.finalize()),
        })
    }
}

/// A model document, JSON or YAML, parsed strictly.
pub struct ModelDocument(pub Value);

/// The media types of YAML: that of RFC 9512, and those that were in use before it.
const YAML: [&str; 4] = [
    "application/yaml",
    "application/x-yaml",
    "text/yaml",
    "text/x-yaml",
];

impl<S: Send + Sync> FromRequest<S> for ModelDocument
where
    Bodies: FromRef<S>,
{
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Answer<Self> {
        let bodies = Bodies::from_ref(state);
        let media_type = content_type(request.headers());
        if media_type == "application/json" {
            let document = JsonDocument::from_request(request, state).await?;
            return Ok(Self(document.value));
        }
        if !YAML.contains(&media_type.as_str()) {
            let expected = "application/json and application/yaml";
            return Err(unsupported(request.headers(), expected));
        }
        let limit = bodies.document_bytes;
        let parsed = bodies.parse(request.into_body(), limit, |source| {
            let text = String::from_utf8(whole(source)?)
                .map_err(|error| Problem::new(Kind::Malformed, format!("not a text: {error}")))?;
            yaml::parse(&text).map_err(|error| Problem::of_faults(Kind::Malformed, [error.into()]))
        });
        Ok(Self(parsed.await?.value))
    }
}

fn parse_json(text: &[u8]) -> Result<Value, Problem> {
    json::parse(text).map_err(|error| Problem::of_faults(Kind::Malformed, [json::not_json(&error)]))
}

/// A document is small and much faster to parse whole.
fn whole(source: &mut dyn Read) -> Result<Vec<u8>, Problem> {
    let mut bytes = Vec::new();
    source
        .read_to_end(&mut bytes)
        .map_err(|error| Problem::new(Kind::Malformed, format!("the body broke off: {error}")))?;
    Ok(bytes)
}

/// The media type of a body in lower case, without parameters; empty when none is said.
pub fn content_type(headers: &HeaderMap) -> String {
    let value = headers.get(header::CONTENT_TYPE);
    let text = value
        .and_then(|value| value.to_str().ok())
        .unwrap_or_default();
    let media_type = text.split(';').next().unwrap_or_default();
    media_type.trim().to_ascii_lowercase()
}

/// The body is not of a type that is understood here.
pub fn unsupported(headers: &HeaderMap, expected: &str) -> Problem {
    let media_type = content_type(headers);
    let media_type = if media_type.is_empty() {
        "no Content-Type".to_owned()
    } else {
        format!("`{media_type}`")
    };
    let detail = format!("{media_type} is not understood here, only {expected}");
    Problem::new(Kind::UnsupportedMediaType, detail)
}

/// A temporary file could not be written or read back.
pub fn scratch_failed(error: &io::Error) -> Problem {
    if error.kind() == io::ErrorKind::ResourceBusy {
        return Problem::new(Kind::Busy, "too much is on its way at once").retry_after(2);
    }
    tracing::error!(%error, "a scratch file failed");
    Problem::of_meaning(Meaning::of_file(error))
}

impl From<ReadError> for Problem {
    /// A recording that is not one. [`Bodies::receive`] tells of a body that broke off.
    fn from(error: ReadError) -> Self {
        match error {
            ReadError::Scratch(error) => scratch_failed(&error),
            ReadError::Unsupported(_) => Self::new(Kind::UnsupportedMediaType, error.to_string()),
            ReadError::Io(_) => Self::new(Kind::Malformed, error.to_string()),
            ReadError::Invalid(faults) => Self::of_faults(Kind::Invalid, faults),
            ReadError::Malformed(faults) => Self::of_faults(Kind::Malformed, faults),
        }
    }
}

#[cfg(test)]
mod tests {
    use axum::http::StatusCode;
    use axum::response::IntoResponse;

    use super::*;
    use crate::api::state::tests::state;

    async fn read(body: Body, limit: u64) -> Answer<Parsed<usize>> {
        let (state, _folder) = state().await;
        state
            .bodies
            .parse(body, limit, |text| {
                let mut start = [0; 2];
                text.read_exact(&mut start)
                    .map_err(|_| Problem::new(Kind::Malformed, "short"))?;
                Ok(2)
            })
            .await
    }

    fn status(answer: Answer<Parsed<usize>>) -> StatusCode {
        let problem = answer.err().expect("a problem");
        problem.into_response().status()
    }

    #[tokio::test]
    async fn the_digest_is_of_the_whole_body_even_when_the_parser_stops_early() {
        let parsed = read(Body::from("hello"), 5).await.unwrap();
        assert_eq!(parsed.digest.finalize(), Sha256::digest("hello"));
    }

    #[tokio::test]
    async fn a_body_that_is_too_large_for_memory_is_the_same_body() {
        let text: Vec<u8> = (0..3 * IN_MEMORY).map(|k| (k % 251) as u8).collect();
        let (state, _folder) = state().await;
        let pieces: Vec<io::Result<Bytes>> = text
            .chunks(1000)
            .map(|piece| Ok(Bytes::copy_from_slice(piece)))
            .collect();
        let body = Body::from_stream(futures_util::stream::iter(pieces));
        let parsed = state.bodies.parse(body, 1 << 20, whole).await.unwrap();
        assert!(parsed.value == text);
        assert_eq!(parsed.digest.finalize(), Sha256::digest(&text));
    }

    #[tokio::test]
    async fn a_byte_too_many_is_refused_whatever_the_parser_said() {
        let refused = read(Body::from("hello!"), 5).await;
        assert_eq!(status(refused), StatusCode::PAYLOAD_TOO_LARGE);
    }

    #[tokio::test]
    async fn a_body_that_breaks_off_is_the_clients_fault() {
        let chunks = [Ok("hel"), Err(io::Error::other("connection reset"))];
        let body = Body::from_stream(futures_util::stream::iter(chunks));
        assert_eq!(status(read(body, 50).await), StatusCode::BAD_REQUEST);
    }

    #[test]
    fn a_body_that_comes_byte_by_byte_is_let_go_and_one_that_is_only_long_is_not() {
        let mut pace = Pace::begin();
        pace.bytes = LEAST_BYTES;
        pace.time_is_up().expect("it comes as fast as it must");
        pace.bytes = LEAST_BYTES - 1;
        let refused = pace.time_is_up().expect_err("too slow").into_response();
        assert_eq!(refused.status(), StatusCode::REQUEST_TIMEOUT);
    }
}
