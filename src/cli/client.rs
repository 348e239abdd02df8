//! The service as a client sees it, over HTTP.

use super::error::CommandError;
use super::event_stream::EventStream;
use reqwest::{RequestBuilder, Response};
use serde_json::Value;

/// A server that can be talked to.
#[derive(Debug)]
pub struct Client {
    http: reqwest::Client,
    base: String,
}

impl Client {
    /// A client of the server at `base`, e.g. `http://127.0.0.1:8080`.
    pub fn new(base: &str) -> Result<Client, CommandError> {
        // The server is asked directly, whatever proxy the environment names.
        let http = reqwest::Client::builder().no_proxy().build();
        Ok(Client {
            http: http.map_err(CommandError::failed)?,
            base: base.trim_end_matches('/').to_owned(),
        })
    }

    /// The address of a path.
    pub fn url(&self, path: &str) -> String {
        format!("{}{path}", self.base)
    }

    /// The document at a path.
    pub async fn get(&self, path: &str) -> Result<Value, CommandError> {
        let answer = self.send(self.http.get(self.url(path))).await?;
        answer.json().await.map_err(CommandError::failed)
    }

    /// Stores a recording and answers what the server says of it.
    pub async fn store(&self, name: &str, csv: Vec<u8>) -> Result<Value, CommandError> {
        let request = self
            .http
            .post(self.url("/v1/datasets"))
            .query(&[("name", name)])
            .header("content-type", "text/csv")
            .body(csv);
        let answer = self.send(request).await?;
        answer.json().await.map_err(CommandError::failed)
    }

    /// Submits a job and answers what the server says of it.
    pub async fn submit(&self, job: &Value) -> Result<Value, CommandError> {
        let request = self.http.post(self.url("/v1/jobs")).json(job);
        let answer = self.send(request).await?;
        answer.json().await.map_err(CommandError::failed)
    }

    /// The events at a path.
    pub async fn events(&self, path: &str) -> Result<EventStream, CommandError> {
        let answer = self.send(self.http.get(self.url(path))).await?;
        Ok(EventStream::of(answer))
    }

    async fn send(&self, request: RequestBuilder) -> Result<Response, CommandError> {
        let answer = request.send().await.map_err(|error| {
            let cause = std::error::Error::source(&error).map(ToString::to_string);
            let cause = cause.unwrap_or_else(|| error.to_string());
            CommandError::failed(format!("{} does not answer: {cause}", self.base))
        })?;
        if answer.status().is_success() {
            return Ok(answer);
        }
        let status = answer.status();
        let problem: Value = answer.json().await.unwrap_or_default();
        Err(CommandError::failed(format!(
            "{} answered {status}{}",
            self.base,
            sentences_of(&problem)
        )))
    }
}

/// The detail and the faults of a problem document.
fn sentences_of(problem: &Value) -> String {
    let detail = problem["detail"].as_str();
    let mut text = detail.map_or(String::new(), |detail| format!(": {detail}"));
    for fault in problem["errors"].as_array().into_iter().flatten() {
        let word = |name: &str| fault[name].as_str().unwrap_or_default();
        text += &format!("\n  {}: {}", word("pointer"), word("detail"));
    }
    text
}
