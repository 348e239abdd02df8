//! One request to a receiver: its name is resolved once, every address that it stands for is looked
//! at, and the connection goes to one of those.

use std::net::SocketAddr;
use std::sync::{Arc, LazyLock};

use hyper::body::Bytes;
use hyper::header::CONTENT_TYPE;
use hyper::{Method, Request};
use rustls::ClientConfig;
use url::Url;

use super::destination::{Destinations, RefusedDestination};
use crate::outbound::{self, Peer, trust};

/// What is sent.
pub(super) struct Message {
    pub(super) id: String,
    /// When `[s since 1970]`.
    pub(super) at: i64,
    pub(super) signature: String,
    pub(super) body: String,
}

/// Why the receiver has not taken it.
#[derive(Debug, thiserror::Error)]
pub(super) enum Failure {
    /// It may not be sent there.
    #[error(transparent)]
    Refused(RefusedDestination),
    /// The receiver sends elsewhere.
    #[error("the receiver answered {0}; redirects are not followed")]
    Redirect(u16),
    /// The receiver does not take it.
    #[error("the receiver answered {0}")]
    Status(u16),
    /// There was no answer.
    #[error("{0}")]
    Other(String),
}

impl Failure {
    /// The status that the receiver answered.
    pub(super) fn status(&self) -> Option<u16> {
        match self {
            Self::Redirect(status) | Self::Status(status) => Some(*status),
            Self::Refused(_) | Self::Other(_) => None,
        }
    }
}

fn other(error: impl std::fmt::Display) -> Failure {
    Failure::Other(error.to_string())
}

/// Sends to receivers. Cheap to clone.
#[derive(Clone)]
pub(super) struct Exchange {
    destinations: Arc<Destinations>,
}

/// Receivers are trusted whom the system trusts: a plant's own authority is one of these.
static TRUSTED: LazyLock<Arc<ClientConfig>> = LazyLock::new(|| {
    let roots = trust::of_the_system();
    if roots.is_empty() {
        tracing::warn!("the system trusts no authority: no delivery over https will be made");
    }
    Arc::new(trust::client(roots).with_no_client_auth())
});

impl Exchange {
    pub(super) fn new(destinations: Arc<Destinations>) -> Self {
        Self { destinations }
    }

    /// Sends a message; answers the status with which it was taken. What the receiver says beside its status is not
    /// read.
    pub(super) async fn post(&self, url: &Url, message: Message) -> Result<u16, Failure> {
        let addresses = self.resolve(url).await?;
        let peer = Peer {
            url,
            addresses: &addresses,
            tls: &TRUSTED,
        };
        let answer = outbound::exchange(peer, request(url, message)?, 0).await;
        let status = answer.map_err(other)?.status();
        if status.is_success() {
            Ok(status.as_u16())
        } else if status.is_redirection() {
            Err(Failure::Redirect(status.as_u16()))
        } else {
            Err(Failure::Status(status.as_u16()))
        }
    }

    /// The addresses that a name stands for now. One of the inside among others is a trap, too.
    async fn resolve(&self, url: &Url) -> Result<Vec<SocketAddr>, Failure> {
        let addresses = outbound::resolve(url).await.map_err(other)?;
        for address in &addresses {
            let checked = self.destinations.check_address(address.ip());
            checked.map_err(Failure::Refused)?;
        }
        Ok(addresses)
    }
}

fn request(url: &Url, message: Message) -> Result<Request<Bytes>, Failure> {
    outbound::request(Method::POST, url)
        .header(CONTENT_TYPE, "application/json")
        .header("webhook-id", message.id)
        .header("webhook-timestamp", message.at)
        .header("webhook-signature", message.signature)
        .body(message.body.into())
        .map_err(other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_name_that_stands_for_a_private_address_is_not_asked() {
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0")
            .await
            .expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let destinations = Arc::new(Destinations::new(["localhost"]).expect("a name"));
        let url = destinations.check(&format!("http://localhost:{port}/"));
        let exchange = Exchange::new(Arc::clone(&destinations));
        let message = Message {
            id: "msg_1".to_owned(),
            at: 0,
            signature: "v1,x".to_owned(),
            body: "{}".to_owned(),
        };
        let refused = exchange.post(&url.expect("a destination"), message).await;
        let is_refused = matches!(
            refused,
            Err(Failure::Refused(RefusedDestination::NotPublic(_)))
        );
        assert!(is_refused, "{refused:?}");
    }
}
