//! Who asks: the caller of a request and the address that it comes from.

use std::net::IpAddr;

use axum::extract::FromRequestParts;
use axum::http::StatusCode;
use axum::http::request::Parts;

use super::error::{Answer, Kind, Problem};
use crate::access::{Project, Scope, StreamNames};
use crate::store::TokenRow;

/// The address at the other end of a connection, which whoever takes it notes.
#[derive(Clone, Copy, Debug)]
pub struct PeerAddress(pub IpAddr);

impl PeerAddress {
    /// The address as it is written down.
    #[must_use]
    pub fn to_text(&self) -> String {
        self.0.to_canonical().to_string()
    }
}

/// Who asks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client {
    /// The address that the request comes from; empty where there is none.
    pub address: String,
    /// What the caller is called: `token <name>`, `person <name>`, or `local`.
    pub who: String,
    /// The project that it asks in.
    pub project: Project,
    /// How much it may do there.
    pub scope: Scope,
    /// The streams that it may append to; all where there is no list.
    pub streams: Option<StreamNames>,
    /// Whether the caller said who it is; never where nobody has to.
    pub is_known: bool,
    /// Whether a session's cookie says so, which a browser sends with every request.
    pub has_session: bool,
}

impl Client {
    /// A caller of a server that asks nobody who they are.
    #[must_use]
    pub fn local(address: String) -> Self {
        Self {
            address,
            who: "local".to_owned(),
            project: Project::default(),
            scope: Scope::Admin,
            streams: None,
            is_known: false,
            has_session: false,
        }
    }

    /// The caller that a token stands for.
    pub(super) fn of_token(token: TokenRow, address: String) -> Self {
        Self {
            address,
            who: format!("token {}", token.name),
            project: token.project,
            scope: token.scope,
            streams: token.streams,
            is_known: true,
            has_session: false,
        }
    }

    /// The refusal of what belongs to another project than the caller's.
    pub(super) fn refuse_another_project(&self) -> Problem {
        let project = &self.project;
        let detail = format!("this belongs to another project than `{project}`, which you ask for");
        Problem::new(Kind::Forbidden, detail)
    }

    /// Refuses to append to a stream that the caller's token does not name.
    pub(super) fn check_append(&self, stream: &str) -> Answer<()> {
        match &self.streams {
            Some(streams) if !streams.contain(stream) => {
                let detail = format!("your token appends to {streams} and not to `{stream}`");
                Err(Problem::new(Kind::Forbidden, detail))
            }
            _ => Ok(()),
        }
    }

    /// Who asks a request. Nothing is answered to one that came past the layer which says so.
    pub(super) fn of(parts: &Parts) -> Answer<&Self> {
        let client = parts.extensions.get::<Self>();
        client.ok_or_else(|| Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR))
    }
}

impl<S: Send + Sync> FromRequestParts<S> for Client {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Answer<Self> {
        Self::of(parts).cloned()
    }
}
