//! Request bodies, streamed: bounded while they are read, hashed on the way, handed to a blocking
//! parser piece by piece. A small document is read whole and parsed at once.

use std::io::{self, Read};
use std::time::Duration;

use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, Request};
use axum::http::{HeaderMap, StatusCode, header};
use futures_util::TryStreamExt;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tokio_stream::{Stream, StreamExt};
use tokio_util::io::{StreamReader, SyncIoBridge};

use super::error::{Answer, Kind, Problem, ProblemFault};
use super::http_headers::hex;
use super::{ApiState, blocking};
use crate::document::{json as document, yaml};
use crate::intake::ReadError;

/// How long a client may be silent in the middle of a body.
const LONGEST_SILENCE: Duration = Duration::from_secs(30);

/// A document of so many bytes at the most is parsed where it is read: that takes less time than
/// handing it to another thread.
const SMALL_BYTES: u64 = 32 << 10;

/// What came of a body: the parser's answer, and the digest of all the bytes.
pub struct Parsed<T> {
    /// What the parser made of it.
    pub value: T,
    /// SHA-256 of the body, after any decompression.
    pub digest: Sha256,
}

/// Runs a blocking parser on a body of at most `limit` bytes.
///
/// What the parser leaves is read too, so that the digest is of the whole and a client that is
/// still sending can hear the answer.
pub async fn parse<T, P>(body: Body, limit: u64, parser: P) -> Answer<Parsed<T>>
where
    T: Send + 'static,
    P: FnOnce(&mut dyn Read) -> Result<T, Problem> + Send + 'static,
{
    parse_chunks(chunks(body), limit, parser).await
}

/// The pieces of a body, with an error where the client falls silent.
fn chunks(body: Body) -> impl Stream<Item = io::Result<Bytes>> + Send + Unpin + 'static {
    let chunks = body.into_data_stream().map_err(io::Error::other);
    Box::pin(chunks.timeout(LONGEST_SILENCE)).map(|chunk| match chunk {
        Ok(chunk) => chunk,
        Err(_silence) => Err(io::ErrorKind::TimedOut.into()),
    })
}

async fn parse_chunks<T, P>(
    chunks: impl Stream<Item = io::Result<Bytes>> + Send + Unpin + 'static,
    limit: u64,
    parser: P,
) -> Answer<Parsed<T>>
where
    T: Send + 'static,
    P: FnOnce(&mut dyn Read) -> Result<T, Problem> + Send + 'static,
{
    let mut source = Metered {
        source: SyncIoBridge::new(StreamReader::new(chunks)),
        digest: Sha256::new(),
        left: limit,
        broken: None,
    };
    blocking(move || {
        let parsed = parser(&mut source);
        let rest = io::copy(&mut source, &mut io::sink());
        match source.broken {
            Some(Broken::TooLarge) => {
                let _ = io::copy(&mut source.source.take(limit), &mut io::sink());
                Err(Problem::too_large(limit))
            }
            Some(Broken::Silent) => Err(silent()),
            Some(Broken::Off) => Err(broken_off(rest.err())),
            None => Ok(Parsed {
                value: parsed?,
                digest: source.digest,
            }),
        }
    })
    .await
}

fn silent() -> Problem {
    let detail = format!("no byte came for {} s", LONGEST_SILENCE.as_secs());
    Problem::new(Kind::RequestTimeout, detail)
}

fn broken_off(error: Option<io::Error>) -> Problem {
    let why = error.map_or_else(|| "it ended early".to_owned(), |error| error.to_string());
    Problem::new(Kind::Malformed, format!("the body broke off: {why}"))
}

/// Why a body could not be read to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Broken {
    TooLarge,
    Silent,
    Off,
}

/// Counts and hashes what passes through, and remembers how it broke.
struct Metered<R> {
    source: R,
    digest: Sha256,
    left: u64,
    broken: Option<Broken>,
}

impl<R: Read> Read for Metered<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if self.broken.is_some() {
            return Err(io::Error::other("the body broke off before"));
        }
        let read = self.source.read(buffer).inspect_err(|error| {
            let silent = error.kind() == io::ErrorKind::TimedOut;
            self.broken = Some(if silent { Broken::Silent } else { Broken::Off });
        })?;
        let Some(left) = self.left.checked_sub(read as u64) else {
            self.broken = Some(Broken::TooLarge);
            return Err(io::Error::other("the body is too large"));
        };
        self.left = left;
        self.digest.update(&buffer[..read]);
        Ok(read)
    }
}

/// A JSON body, parsed strictly, and what identifies it.
pub struct JsonDocument {
    /// The document.
    pub value: Value,
    /// SHA-256 of its bytes in hexadecimal digits.
    pub digest: String,
}

impl FromRequest<ApiState> for JsonDocument {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &ApiState) -> Answer<Self> {
        if content_type(request.headers()) != "application/json" {
            return Err(unsupported(request.headers(), "application/json"));
        }
        let limit = state.limits.document_bytes;
        let parsed = match begin(request.into_body(), limit.min(SMALL_BYTES)).await {
            Beginning::All(text) => Parsed {
                value: parse_json(&text)?,
                digest: Sha256::new_with_prefix(&text),
            },
            Beginning::More(chunks) => {
                let parser = |source: &mut dyn Read| parse_json(&whole(source)?);
                parse_chunks(chunks, limit, parser).await?
            }
        };
        Ok(Self {
            value: parsed.value,
            digest: hex(&parsed.digest.finalize()),
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

impl FromRequest<ApiState> for ModelDocument {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &ApiState) -> Answer<Self> {
        let media_type = content_type(request.headers());
        if media_type == "application/json" {
            let document = JsonDocument::from_request(request, state).await?;
            return Ok(Self(document.value));
        }
        if !YAML.contains(&media_type.as_str()) {
            let expected = "application/json and application/yaml";
            return Err(unsupported(request.headers(), expected));
        }
        let limit = state.limits.document_bytes;
        let parsed = parse(request.into_body(), limit, |source| {
            let text = String::from_utf8(whole(source)?)
                .map_err(|error| Problem::new(Kind::Malformed, format!("not a text: {error}")))?;
            yaml::parse(&text).map_err(|error| not_yaml(&error))
        });
        Ok(Self(parsed.await?.value))
    }
}

fn not_yaml(error: &yaml::Error) -> Problem {
    let fault = ProblemFault {
        line: Some(error.line),
        column: Some(error.column.to_string()),
        code: "not_yaml".to_owned(),
        detail: format!("not YAML that is understood here: {error}"),
        ..ProblemFault::default()
    };
    Problem::of_faults(Kind::Malformed, [fault])
}

fn parse_json(text: &[u8]) -> Result<Value, Problem> {
    document::parse(text).map_err(|error| not_json(&error))
}

/// A document is small and much faster to parse whole.
fn whole(source: &mut dyn Read) -> Result<Vec<u8>, Problem> {
    let mut bytes = Vec::new();
    source
        .read_to_end(&mut bytes)
        .map_err(|error| Problem::new(Kind::Malformed, format!("the body broke off: {error}")))?;
    Ok(bytes)
}

/// What came of a body before it was known to be large.
enum Beginning<Chunks> {
    /// All of it.
    All(Vec<u8>),
    /// What has come and what will.
    More(Chunks),
}

/// Reads a body of at most `small` bytes whole.
async fn begin(
    body: Body,
    small: u64,
) -> Beginning<impl Stream<Item = io::Result<Bytes>> + Send + Unpin + 'static> {
    let mut rest = chunks(body);
    let mut text = Vec::new();
    while let Some(chunk) = rest.next().await {
        let is_small = |chunk: &Bytes| (text.len() + chunk.len()) as u64 <= small;
        match chunk {
            Ok(chunk) if is_small(&chunk) => text.extend_from_slice(&chunk),
            other => {
                let begun = tokio_stream::iter([Ok(Bytes::from(text)), other]);
                return Beginning::More(begun.chain(rest));
            }
        }
    }
    Beginning::All(text)
}

fn not_json(error: &serde_json::Error) -> Problem {
    let fault = ProblemFault {
        line: Some(error.line() as u64),
        column: Some(error.column().to_string()),
        code: "not_json".to_owned(),
        detail: format!("not JSON: {error}"),
        ..ProblemFault::default()
    };
    Problem::of_faults(Kind::Malformed, [fault])
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
    let said = content_type(headers);
    let said = if said.is_empty() {
        "no Content-Type".to_owned()
    } else {
        format!("`{said}`")
    };
    let detail = format!("{said} is not understood here, only {expected}");
    Problem::new(Kind::UnsupportedMediaType, detail)
}

/// Samples could not be put aside or read back: the server's fault.
pub fn scratch_failed(error: &io::Error) -> Problem {
    tracing::error!(%error, "the scratch of a recording failed");
    Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR)
}

impl From<ReadError> for Problem {
    /// A recording that is not one. A source that broke off is told by [`parse`].
    fn from(error: ReadError) -> Self {
        let kind = match &error {
            ReadError::Scratch(error) => return scratch_failed(error),
            ReadError::Unsupported(_) => Kind::UnsupportedMediaType,
            ReadError::Invalid(_) => Kind::Invalid,
            ReadError::Malformed(_) | ReadError::Io(_) => Kind::Malformed,
        };
        if error.faults().is_empty() {
            return Self::new(kind, error.to_string());
        }
        let faults = error.faults().iter().map(|fault| ProblemFault {
            pointer: fault.pointer.clone(),
            line: fault.line,
            column: fault.column.clone(),
            parameter: fault.parameter.clone(),
            code: fault.code.to_owned(),
            detail: fault.detail.clone(),
            ..ProblemFault::default()
        });
        Self::of_faults(kind, faults)
    }
}

#[cfg(test)]
mod tests {
    use axum::response::IntoResponse;

    use super::*;

    async fn read(body: Body, limit: u64) -> Answer<Parsed<usize>> {
        parse(body, limit, |text| {
            let mut start = [0; 2];
            text.read_exact(&mut start)
                .map_err(|_| Problem::new(Kind::Malformed, "short"))?;
            Ok(2)
        })
        .await
    }

    #[tokio::test]
    async fn the_digest_is_of_the_whole_body_even_when_the_parser_stops_early() {
        let parsed = read(Body::from("hello"), 5).await.unwrap();
        assert_eq!(parsed.digest.finalize(), Sha256::digest("hello"));
    }

    #[tokio::test]
    async fn a_byte_too_many_is_refused_whatever_the_parser_said() {
        let problem = read(Body::from("hello!"), 5)
            .await
            .err()
            .expect("too large");
        assert_eq!(
            problem.into_response().status(),
            StatusCode::PAYLOAD_TOO_LARGE
        );
    }

    #[tokio::test]
    async fn a_body_that_breaks_off_is_the_clients_fault() {
        let chunks = [Ok("hel"), Err(io::Error::other("connection reset"))];
        let body = Body::from_stream(tokio_stream::iter(chunks));
        let problem = read(body, 50).await.err().expect("broken off");
        assert_eq!(problem.into_response().status(), StatusCode::BAD_REQUEST);
    }
}
