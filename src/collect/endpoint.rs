//! A server that is asked over HTTP, and what the collector shows it to be let in.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use hyper::body::Bytes;
use hyper::header::AUTHORIZATION;
use hyper::http::request::Builder;
use hyper::{Method, Request, Response};
use rustls::ClientConfig;
use url::Url;

use super::document::SourcesTable;
use super::secret;
use crate::outbound::{self, OutboundError, trust};

/// How long an answer may take.
const LONGEST_ANSWER: Duration = Duration::from_secs(120);
/// The bytes of an answer at the most.
const LARGEST_ANSWER: usize = 256 << 20;

/// The entries of a sources file that say how a server is reached.
pub(super) const ENTRIES: [&str; 5] = ["url", "user", "password", "token", "ca"];

/// A server by its address.
#[derive(Clone, Debug)]
pub(super) struct Endpoint {
    url: Url,
    authorization: Option<Authorization>,
    tls: Arc<ClientConfig>,
}

/// The value of the header `Authorization`. Neither logs nor errors show it.
#[derive(Clone)]
struct Authorization(String);

impl std::fmt::Debug for Authorization {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Authorization(…)")
    }
}

impl Endpoint {
    /// Takes the entries of a table that say how a server is reached. Paths are seen from `folder`.
    pub(super) fn take(table: &mut SourcesTable, folder: &Path) -> Option<Self> {
        let url = table.required("url", |table, key| table.parsed(key, address));
        let user = table.text("user");
        let password = secret::take(table, "password", folder);
        let token = secret::take(table, "token", folder);
        let ca = table.text("ca").map(|file| folder.join(file));
        let authorization = match (user, password, token) {
            (None, None, None) => None,
            (Some(user), Some(password), None) => {
                let both = BASE64.encode(format!("{user}:{}", password.expose()));
                Some(Authorization(format!("Basic {both}")))
            }
            (None, None, Some(token)) => Some(Authorization(format!("Bearer {}", token.expose()))),
            _ => {
                table.fault("`user` and `password` belong together, and `token` stands alone");
                return None;
            }
        };
        let roots = trust::of_the_system_and(ca.as_deref());
        let roots = roots.map_err(|error| table.fault(error.to_string())).ok()?;
        Some(Self {
            url: url?,
            authorization,
            tls: Arc::new(trust::client(roots).with_no_client_auth()),
        })
    }

    /// The server with its token said in the way of InfluxDB 2.
    pub(super) fn with_influx_token(mut self) -> Self {
        if let Some(Authorization(value)) = &mut self.authorization
            && let Some(token) = value.strip_prefix("Bearer ")
        {
            *value = format!("Token {token}");
        }
        self
    }

    /// The address below that of the server, without a query. Each part is one step of the path.
    pub(super) fn address(&self, parts: &[&str]) -> Url {
        let mut url = self.url.clone();
        if let Ok(mut path) = url.path_segments_mut() {
            path.pop_if_empty().extend(parts);
        }
        url
    }

    /// The answer at an address.
    pub(super) async fn get(&self, url: &Url) -> Result<Response<Bytes>, OutboundError> {
        self.ask(url, outbound::request(Method::GET, url), Bytes::new())
            .await
    }

    /// The answer to a body of a type.
    pub(super) async fn post(
        &self,
        url: &Url,
        content_type: &str,
        body: Bytes,
    ) -> Result<Response<Bytes>, OutboundError> {
        self.send(Method::POST, url, content_type, body).await
    }

    /// The answer to a body of a type that is sent by a method.
    pub(super) async fn send(
        &self,
        method: Method,
        url: &Url,
        content_type: &str,
        body: Bytes,
    ) -> Result<Response<Bytes>, OutboundError> {
        let request = outbound::request(method, url)
            .header(hyper::header::CONTENT_TYPE, content_type)
            .header(hyper::header::CONTENT_LENGTH, body.len());
        self.ask(url, request, body).await
    }

    async fn ask(
        &self,
        url: &Url,
        request: Builder,
        body: Bytes,
    ) -> Result<Response<Bytes>, OutboundError> {
        let request = match &self.authorization {
            Some(Authorization(value)) => request.header(AUTHORIZATION, value),
            None => request,
        };
        let broken = |error: hyper::http::Error| OutboundError::BrokeOff(error.to_string());
        let request: Request<Bytes> = request.body(body).map_err(broken)?;
        let asking = outbound::ask(url, &self.tls, request, LARGEST_ANSWER);
        let answered = tokio::time::timeout(LONGEST_ANSWER, asking).await;
        answered.unwrap_or_else(|_| {
            let seconds = LONGEST_ANSWER.as_secs();
            Err(OutboundError::BrokeOff(format!(
                "nothing came in {seconds} s"
            )))
        })
    }
}

/// The address of a server over HTTP, without secrets in it.
fn address(text: &str) -> Result<Url, String> {
    let url: Url = text
        .parse()
        .map_err(|_| "is an address such as https://historian.plant.example:8086".to_owned())?;
    if !["http", "https"].contains(&url.scheme()) || url.host_str().is_none() {
        return Err("begins with http:// or https:// and names a host".to_owned());
    }
    if !url.username().is_empty() || url.password().is_some() {
        return Err("has no user and no password in it; `user` and `password` say them".to_owned());
    }
    match url.query().is_some() || url.fragment().is_some() {
        true => Err("has neither a query nor a fragment".to_owned()),
        false => Ok(url),
    }
}
