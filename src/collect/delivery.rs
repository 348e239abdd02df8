//! Pages on their way into streams of the server.

use std::collections::BTreeMap;
use std::time::Duration;

use hyper::body::Bytes;
use hyper::header::RETRY_AFTER;
use hyper::{Method, Response, StatusCode};
use serde_json::Value;

use super::endpoint::Endpoint;
use super::error::CollectError;
use super::page::SeriesPage;
use super::series::SourceSeries;
use crate::store::SourceState;

/// What a page did to its stream.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stored {
    /// Samples that were not there.
    pub added: u64,
    /// Samples that say something else than before.
    pub changed: u64,
    /// What the server remarks on how it read the page: a sentence by its code and signal.
    pub remarks: BTreeMap<String, String>,
}

impl Stored {
    /// Adds what a further page did.
    pub(super) fn add(&mut self, further: Self) {
        self.added += further.added;
        self.changed += further.changed;
        self.remarks.extend(further.remarks);
    }
}

/// The server to which samples are brought.
#[derive(Clone, Debug)]
pub struct StreamDelivery {
    server: Endpoint,
}

impl StreamDelivery {
    /// Deliveries to a server.
    pub(super) fn to(server: Endpoint) -> Self {
        Self { server }
    }

    /// Asks whether the server is there and knows the token.
    ///
    /// # Errors
    /// The server is not reached or does not know the token.
    pub async fn check(&self, stream: &str) -> Result<(), CollectError> {
        let url = self.server.address(&["v1", "streams", stream]);
        let answer = self.server.get(&url).await.map_err(away)?;
        // A token that appends alone may not see the stream, and the first batch makes it.
        let is_known = [StatusCode::OK, StatusCode::NOT_FOUND, StatusCode::FORBIDDEN];
        match is_known.contains(&answer.status()) {
            true => Ok(()),
            false => Err(refusal(&answer)),
        }
    }

    /// Appends a page to the stream of its series. The page is on disk when this comes back.
    ///
    /// # Errors
    /// The server is not reached, is busy, or refuses the page: nothing of the page is stored.
    pub async fn append(
        &self,
        series: &SourceSeries,
        page: SeriesPage,
    ) -> Result<Stored, CollectError> {
        let mut url = self.server.address(&["v1", "streams", &series.stream]);
        // What the sources file says of a series counts before what the source says of it.
        let mut options = page.options;
        options.extend(series.options.clone());
        if !options.is_empty() {
            url.query_pairs_mut().extend_pairs(&options);
        }
        let answer = self
            .server
            .post(&url, page.content_type, Bytes::from(page.body));
        let answer = answer.await.map_err(away)?;
        if !answer.status().is_success() {
            return Err(refusal(&answer));
        }
        let stored: Value = serde_json::from_slice(answer.body()).unwrap_or_default();
        let count = |name: &str| stored[name].as_u64().unwrap_or_default();
        Ok(Stored {
            added: count("added"),
            changed: count("changed"),
            remarks: remarks(&stored["report"]),
        })
    }
}

impl StreamDelivery {
    /// Says how a source is. What the server answers is of no use to the samples.
    ///
    /// # Errors
    /// The server is not reached, or does not take it.
    pub(super) async fn say(&self, source: &str, state: &SourceState) -> Result<(), CollectError> {
        let url = self.server.address(&["v1", "sources", source]);
        let body = serde_json::to_vec(state).unwrap_or_default();
        let answer = self
            .server
            .send(Method::PUT, &url, "application/json", body.into());
        let answer = answer.await.map_err(away)?;
        match answer.status().is_success() {
            true => Ok(()),
            false => Err(refusal(&answer)),
        }
    }
}

/// The warnings of a report.
fn remarks(report: &Value) -> BTreeMap<String, String> {
    let warnings = report["warnings"].as_array().into_iter().flatten();
    let remark = |warning: &Value| {
        let [code, signal, detail] =
            ["code", "signal", "detail"].map(|name| warning[name].as_str());
        let signal = signal.unwrap_or_default();
        Some((
            format!("{} {signal}", code?),
            format!("{signal} {}", detail?),
        ))
    };
    warnings.filter_map(remark).collect()
}

fn away(error: crate::outbound::OutboundError) -> CollectError {
    CollectError::ServerAway {
        why: error.to_string(),
        after: None,
    }
}

/// The refusal that an answer is, by its status.
fn refusal(answer: &Response<Bytes>) -> CollectError {
    let status = answer.status();
    if status == StatusCode::PAYLOAD_TOO_LARGE {
        return CollectError::PageTooLarge;
    }
    let why = format!("{status}{}", sentences_of(answer.body()));
    let is_passing = status.is_server_error() || status == StatusCode::TOO_MANY_REQUESTS;
    if !is_passing {
        return CollectError::ServerRefuses(why);
    }
    let after = answer.headers().get(RETRY_AFTER);
    let after = after.and_then(|seconds| seconds.to_str().ok()?.parse().ok());
    CollectError::ServerAway {
        why,
        after: after.map(Duration::from_secs),
    }
}

/// The detail and the faults of a problem document.
fn sentences_of(body: &[u8]) -> String {
    let problem: Value = serde_json::from_slice(body).unwrap_or_default();
    let faults = problem["errors"].as_array().into_iter().flatten();
    let mut details: Vec<&Value> = faults.map(|fault| &fault["detail"]).collect();
    // The detail of a problem with faults repeats the first of them.
    if details.is_empty() {
        details.push(&problem["detail"]);
    }
    let details = details.into_iter().filter_map(Value::as_str);
    details.map(|detail| format!(": {detail}")).collect()
}
