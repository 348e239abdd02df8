//! Requests that the program makes itself, each over a connection of its own: to receivers of events, to the
//! provider that knows people, to another server. Redirects are not followed, and no proxy is asked.

pub mod trust;

use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use http_body_util::{BodyExt, Full, LengthLimitError, Limited};
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper::header::{HOST, USER_AGENT};
use hyper::http::request::Builder;
use hyper::{Method, Request, Response};
use hyper_util::rt::TokioIo;
use rustls::ClientConfig;
use rustls::pki_types::{InvalidDnsNameError, ServerName};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use url::Url;

/// How long the other side may take to take the connection.
const LONGEST_CONNECT: Duration = Duration::from_secs(5);

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum OutboundError {
    /// The connection is not made, or broke off.
    #[error(transparent)]
    Connection(#[from] io::Error),
    /// The connection is not made in time.
    #[error("no connection was taken within {} s", LONGEST_CONNECT.as_secs())]
    NoConnection,
    /// A certificate cannot name the host.
    #[error(transparent)]
    Name(#[from] InvalidDnsNameError),
    /// What is said is no HTTP.
    #[error(transparent)]
    Http(#[from] hyper::Error),
    /// The body of the answer is larger than it may be.
    #[error("the answer has more than {0} bytes")]
    TooLarge(usize),
    /// The body of the answer broke off.
    #[error("the answer broke off: {0}")]
    BrokeOff(String),
}

/// The host of an address, as a certificate or a resolver names it.
fn host_of(url: &Url) -> &str {
    let host = url.host_str().unwrap_or_default();
    host.trim_start_matches('[').trim_end_matches(']')
}

/// The network addresses that the host of an address stands for now.
///
/// # Errors
/// The host is not known.
pub async fn resolve(url: &Url) -> Result<Vec<SocketAddr>, OutboundError> {
    let port = url.port_or_known_default().unwrap_or(443);
    let addresses = tokio::net::lookup_host((host_of(url), port)).await?;
    Ok(addresses.collect())
}

/// The beginning of a request to an address.
#[must_use]
pub fn request(method: Method, url: &Url) -> Builder {
    let path = match url.query() {
        Some(query) => format!("{}?{query}", url.path()),
        None => url.path().to_owned(),
    };
    Request::builder()
        .method(method)
        .uri(path)
        .header(HOST, url.authority().rsplit('@').next().unwrap_or_default())
        .header(USER_AGENT, concat!("greybox/", env!("CARGO_PKG_VERSION")))
}

/// The other side of an exchange.
#[derive(Clone, Copy)]
pub struct Peer<'a> {
    /// The address that is asked; its scheme says whether over TLS.
    pub url: &'a Url,
    /// The network addresses of which one is connected to.
    pub addresses: &'a [SocketAddr],
    /// Whom to trust over TLS.
    pub tls: &'a Arc<ClientConfig>,
}

/// Sends a request and reads the answer; a body of at most so many bytes, none of it where that is 0.
///
/// # Errors
/// There is no answer, or a larger one.
pub async fn exchange(
    peer: Peer<'_>,
    request: Request<Bytes>,
    largest_body: usize,
) -> Result<Response<Bytes>, OutboundError> {
    let connecting = TcpStream::connect(peer.addresses);
    let stream = tokio::time::timeout(LONGEST_CONNECT, connecting).await;
    let stream = stream.map_err(|_| OutboundError::NoConnection)??;
    if peer.url.scheme() == "https" {
        let name = ServerName::try_from(host_of(peer.url).to_owned())?;
        let connector = TlsConnector::from(Arc::clone(peer.tls));
        answered(
            connector.connect(name, stream).await?,
            request,
            largest_body,
        )
        .await
    } else {
        answered(stream, request, largest_body).await
    }
}

/// Asks an address: resolves its host, sends a request and reads the answer.
///
/// # Errors
/// The host is not known, or there is no answer, or one larger than `largest_body` bytes.
pub async fn ask(
    url: &Url,
    tls: &Arc<ClientConfig>,
    request: Request<Bytes>,
    largest_body: usize,
) -> Result<Response<Bytes>, OutboundError> {
    let addresses = resolve(url).await?;
    let peer = Peer {
        url,
        addresses: &addresses,
        tls,
    };
    exchange(peer, request, largest_body).await
}

async fn answered<S>(
    stream: S,
    request: Request<Bytes>,
    largest_body: usize,
) -> Result<Response<Bytes>, OutboundError>
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream)).await?;
    let answer = async {
        let (head, body) = sender
            .send_request(request.map(Full::new))
            .await?
            .into_parts();
        if largest_body == 0 {
            return Ok(Response::from_parts(head, Bytes::new()));
        }
        let body = Limited::new(body, largest_body).collect().await;
        let body = body.map_err(|error| match error.downcast_ref::<LengthLimitError>() {
            Some(_) => OutboundError::TooLarge(largest_body),
            None => OutboundError::BrokeOff(error.to_string()),
        })?;
        Ok(Response::from_parts(head, body.to_bytes()))
    };
    tokio::pin!(connection, answer);
    tokio::select! {
        answer = &mut answer => answer,
        ended = &mut connection => match ended {
            Ok(()) => answer.await,
            Err(error) => Err(error.into()),
        },
    }
}
