//! The manners of HTTP that several resources share: what a client prefers, what it has already,
//! which type it wants, under which key it calls.

use std::time::Duration;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::Response;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::error::{Answer, Kind, Problem};
use greybox::parsing::Fault;

/// How long a client may let the server hold its answer back `[s]`.
pub const MAX_WAIT_S: u64 = 60;
/// The characters of an idempotency key at the most.
const MAX_KEY_CHARS: usize = 255;

/// What a client prefers (RFC 7240), each preference by itself.
fn preferences(headers: &HeaderMap) -> impl Iterator<Item = &str> {
    let values = headers.get_all("prefer").iter();
    values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split([',', ';']))
}

/// Whether the client would rather have a job than wait: `Prefer: respond-async`.
pub fn prefers_job(headers: &HeaderMap) -> bool {
    preferences(headers).any(|preference| preference.trim().eq_ignore_ascii_case("respond-async"))
}

/// `Prefer: wait=N`, at most [`MAX_WAIT_S`]; other preferences are ignored.
pub fn preferred_wait(headers: &HeaderMap) -> Option<Duration> {
    preferences(headers).find_map(|preference| {
        let (name, value) = preference.split_once('=')?;
        if !name.trim().eq_ignore_ascii_case("wait") {
            return None;
        }
        let seconds: u64 = value.trim().trim_matches('"').parse().ok()?;
        Some(Duration::from_secs(seconds.min(MAX_WAIT_S)))
    })
}

/// The `Idempotency-Key` of a request.
pub fn idempotency_key(headers: &HeaderMap) -> Answer<Option<String>> {
    let Some(value) = headers.get("idempotency-key") else {
        return Ok(None);
    };
    let text = value.to_str().unwrap_or_default().trim();
    if text.is_empty() || text.len() > MAX_KEY_CHARS {
        let detail = format!("the key has 1 to {MAX_KEY_CHARS} visible ASCII characters");
        return Err(header_fault("Idempotency-Key", detail));
    }
    Ok(Some(text.to_owned()))
}

/// The problem of one bad header.
pub fn header_fault(name: &str, detail: String) -> Problem {
    let fault = Fault {
        header: Some(name.into()),
        ..Fault::of_whole("invalid_header", detail)
    };
    Problem::of_faults(Kind::Invalid, [fault])
}

/// Whether the client would rather have `wanted` (e.g. `text/csv`) than JSON.
///
/// Of the ranges in `Accept` the one with the higher quality wins, JSON on a draw.
pub fn prefers(headers: &HeaderMap, wanted: &str) -> bool {
    quality_of(headers, wanted) > quality_of(headers, "application/json")
}

/// The quality that `Accept` gives to a media type, by its most specific range; 1 without any.
fn quality_of(headers: &HeaderMap, media_type: &str) -> f64 {
    let whole_type = media_type.split('/').next().unwrap_or_default();
    let ranges = headers.get_all(header::ACCEPT).iter();
    let ranges = ranges.filter_map(|value| value.to_str().ok());
    let matching = ranges
        .flat_map(|value| value.split(','))
        .filter_map(|range| {
            let mut parts = range.split(';').map(str::trim);
            let name = parts.next()?.to_ascii_lowercase();
            let specific = match name.as_str() {
                "*/*" => 0,
                name if name == media_type => 2,
                name if name.strip_suffix("/*") == Some(whole_type) => 1,
                _ => return None,
            };
            let quality = parts.find_map(|part| part.strip_prefix("q=")?.parse().ok());
            Some((specific, quality.unwrap_or(1.0)))
        });
    let best = matching.max_by_key(|(specific, _)| *specific);
    match best {
        Some((_, quality)) => quality,
        None if headers.contains_key(header::ACCEPT) => 0.0,
        None => 1.0,
    }
}

/// A JSON answer.
pub fn json(status: StatusCode, body: &impl Serialize) -> Response {
    let body = serde_json::to_vec(body).expect("answers have only text keys");
    let mut response = Response::new(Body::from(body));
    *response.status_mut() = status;
    let application_json = HeaderValue::from_static("application/json");
    response
        .headers_mut()
        .insert(header::CONTENT_TYPE, application_json);
    response
}

/// A JSON answer with a strong `ETag`, or 304 when the client has these very bytes.
pub fn tagged_json(headers: &HeaderMap, body: &impl Serialize) -> Response {
    let body = serde_json::to_string(body).expect("answers have only text keys");
    tagged_stored(headers, body)
}

/// Stored JSON with a strong `ETag`, or 304 when the client has these very bytes.
pub fn tagged_stored(headers: &HeaderMap, json: String) -> Response {
    tagged_bytes(headers, &entity_tag(json.as_bytes()), || json.into_bytes())
}

/// A JSON answer with a strong tag that is known without it, or 304 when the client has it.
pub fn tagged<T: Serialize>(headers: &HeaderMap, tag: &str, body: impl FnOnce() -> T) -> Response {
    tagged_bytes(headers, tag, || {
        serde_json::to_vec(&body()).expect("answers have only text keys")
    })
}

fn tagged_bytes(headers: &HeaderMap, tag: &str, body: impl FnOnce() -> Vec<u8>) -> Response {
    let is_current = has_already(headers, tag);
    let mut response = Response::new(if is_current {
        Body::empty()
    } else {
        Body::from(body())
    });
    let answer_headers = response.headers_mut();
    let tag = HeaderValue::from_str(tag).expect("a tag is visible ASCII in quotes");
    answer_headers.insert(header::ETAG, tag);
    answer_headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    if is_current {
        *response.status_mut() = StatusCode::NOT_MODIFIED;
    } else {
        let application_json = HeaderValue::from_static("application/json");
        answer_headers.insert(header::CONTENT_TYPE, application_json);
    }
    response
}

/// A strong tag: equal tags, equal bytes.
fn entity_tag(body: &[u8]) -> String {
    /// 128 bits of the digest are enough never to see a collision.
    const TAG_BYTES: usize = 16;
    let digest = Sha256::digest(body);
    format!("\"{}\"", hex::encode(&digest[..TAG_BYTES]))
}

/// Whether `If-None-Match` names the tag. A tag that the compression layer marked is the same.
fn has_already(headers: &HeaderMap, tag: &str) -> bool {
    let values = headers.get_all(header::IF_NONE_MATCH).iter();
    let mut tags = values
        .filter_map(|value| value.to_str().ok())
        .flat_map(|value| value.split(','))
        .map(|tag| tag.trim().trim_start_matches("W/"));
    tags.any(|candidate| {
        candidate == "*" || candidate == tag || candidate.replace(GZIP_TAG_END, "\"") == tag
    })
}

/// How the tag of a compressed answer ends: other bytes, another strong tag.
pub const GZIP_TAG_END: &str = "-gzip\"";

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(name: &'static str, value: &str) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(name, value.parse().unwrap());
        headers
    }

    #[test]
    fn a_preferred_wait_is_found_among_others_and_bounded() {
        let wait = |value| preferred_wait(&headers("prefer", value)).map(|wait| wait.as_secs());
        assert_eq!(wait("respond-async, wait=10"), Some(10));
        assert_eq!(wait("Wait=\"5\"; x=1"), Some(5));
        assert_eq!(wait("wait=1000"), Some(60));
        assert_eq!(wait("wait=soon"), None);
        assert_eq!(wait("return=minimal"), None);
    }

    #[test]
    fn csv_is_sent_to_those_who_would_rather_have_it() {
        let csv = |value| prefers(&headers("accept", value), "text/csv");
        assert!(csv("text/csv"));
        assert!(csv("text/csv, application/json;q=0.5"));
        assert!(csv("application/json;q=0.1, text/*"));
        assert!(!csv("*/*"));
        assert!(!csv("application/json, text/csv;q=0.9"));
        assert!(!csv("application/json, text/csv"));
        assert!(!prefers(&HeaderMap::new(), "text/csv"));
    }

    #[test]
    fn a_client_that_has_the_bytes_gets_304() {
        let body = serde_json::json!({"status": "running"});
        let first = tagged_json(&HeaderMap::new(), &body);
        let tag = first.headers()[header::ETAG].to_str().unwrap().to_owned();
        let again = |known: &str| tagged_json(&headers("if-none-match", known), &body).status();
        assert_eq!(again(&tag), StatusCode::NOT_MODIFIED);
        assert_eq!(again(&format!("\"x\", W/{tag}")), StatusCode::NOT_MODIFIED);
        let compressed = format!("{}{GZIP_TAG_END}", tag.trim_end_matches('"'));
        assert_eq!(again(&compressed), StatusCode::NOT_MODIFIED);
        assert_eq!(again("\"x\""), StatusCode::OK);
    }
}
