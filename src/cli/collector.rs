//! The collector of OpenTelemetry to which spans are sent, over plain HTTP or over TLS.

use std::fmt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use opentelemetry_http::{Bytes, HttpClient, HttpError, Request, Response};
use rustls::ClientConfig;
use tokio::runtime::{Builder, Runtime};
use url::Url;

use super::error::CommandError;
use crate::outbound::{self, OutboundError, trust};

/// How long a collector may take for what it is sent.
const LONGEST_EXPORT: Duration = Duration::from_secs(5);
/// The bytes of a collector's answer at the most.
const LARGEST_ANSWER: usize = 1 << 20;
/// Where a collector takes spans, below its address.
const SPANS: &str = "v1/traces";

/// Why a collector did not take what it was sent.
#[derive(Debug, thiserror::Error)]
enum ExportError {
    #[error("the collector took longer than {} s", LONGEST_EXPORT.as_secs())]
    Late,
    #[error(transparent)]
    Outbound(#[from] OutboundError),
    #[error(transparent)]
    Request(#[from] hyper::http::Error),
}

/// A collector at its address. Spans are sent from a thread of the exporter's, which waits for each answer: the
/// collector has a runtime for those waits alone.
pub(super) struct Collector {
    spans: Url,
    tls: Arc<ClientConfig>,
    runtime: Runtime,
}

impl fmt::Debug for Collector {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_tuple("Collector")
            .field(&self.spans.as_str())
            .finish()
    }
}

impl Collector {
    /// The collector of an address, believed over TLS by the system's authorities and those of a file in PEM.
    ///
    /// # Errors
    /// The address is none of HTTP, or the file holds no authorities.
    pub(super) fn at(endpoint: &str, ca: Option<&Path>) -> Result<Self, CommandError> {
        let refused = |why: &dyn fmt::Display| {
            CommandError::input(format!("--otlp-endpoint {endpoint}: {why}"))
        };
        // A path without a slash at its end would lose its last part.
        let address = Url::parse(&format!("{}/", endpoint.trim_end_matches('/')));
        let spans = address
            .and_then(|address| address.join(SPANS))
            .map_err(|error| refused(&error))?;
        if !["http", "https"].contains(&spans.scheme()) || !spans.has_host() {
            return Err(refused(
                &"the address of a collector, such as http://127.0.0.1:4318",
            ));
        }
        let authorities = trust::of_the_system_and(ca).map_err(CommandError::input)?;
        let runtime = Builder::new_current_thread().enable_all().build();
        Ok(Self {
            spans,
            tls: Arc::new(trust::client(authorities).with_no_client_auth()),
            runtime: runtime.map_err(CommandError::failed)?,
        })
    }

    /// Where spans are sent.
    pub(super) fn spans(&self) -> &str {
        self.spans.as_str()
    }

    async fn send(&self, request: Request<Bytes>) -> Result<Response<Bytes>, ExportError> {
        let (head, body) = request.into_parts();
        let mut builder = outbound::request(head.method, &self.spans);
        if let Some(headers) = builder.headers_mut() {
            headers.extend(head.headers);
        }
        Ok(outbound::ask(&self.spans, &self.tls, builder.body(body)?, LARGEST_ANSWER).await?)
    }
}

#[async_trait]
impl HttpClient for Collector {
    async fn send_bytes(&self, request: Request<Bytes>) -> Result<Response<Bytes>, HttpError> {
        let sending = async { tokio::time::timeout(LONGEST_EXPORT, self.send(request)).await };
        let sent = self.runtime.block_on(sending);
        Ok(sent.map_err(|_| ExportError::Late)??)
    }
}
