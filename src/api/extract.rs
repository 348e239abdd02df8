//! What a path names, as a type (a name that is not one names nothing: 404), and who asks.

use std::convert::Infallible;
use std::net::IpAddr;
use std::str::FromStr;

use axum::extract::{FromRequestParts, RawPathParams};
use axum::http::request::Parts;

use super::error::{Answer, Problem};
use crate::job::{ComparisonId, DatasetId, JobId, MonitorId};

/// What the one parameter of a path names.
pub struct Named<T>(pub T);

/// A type that paths name.
pub trait PathName: FromStr {
    /// What it is called in a sentence.
    const WHAT: &'static str;
}

impl PathName for JobId {
    const WHAT: &'static str = "job";
}

impl PathName for ComparisonId {
    const WHAT: &'static str = "comparison";
}

impl PathName for MonitorId {
    const WHAT: &'static str = "monitor";
}

impl PathName for DatasetId {
    const WHAT: &'static str = "dataset";
}

impl PathName for String {
    const WHAT: &'static str = "thing";
}

impl<T: PathName, S: Send + Sync> FromRequestParts<S> for Named<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        let params = RawPathParams::from_request_parts(parts, state).await;
        let params = params.map_err(|_| Problem::not_found(T::WHAT, "�"))?;
        let name = params.iter().next().map_or("", |(_, value)| value);
        let named = name
            .parse()
            .map_err(|_| Problem::not_found(T::WHAT, name))?;
        Ok(Named(named))
    }
}

/// The address at the other end of a connection, which whoever takes it notes.
#[derive(Clone, Copy, Debug)]
pub struct PeerAddress(pub IpAddr);

/// Who asks, as far as the server can tell clients apart: the address; nothing where there is none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Client(pub String);

impl<S: Send + Sync> FromRequestParts<S> for Client {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _state: &S) -> Result<Self, Infallible> {
        let address = parts.extensions.get::<PeerAddress>();
        Ok(Self(address.map_or_else(String::new, |PeerAddress(ip)| {
            ip.to_canonical().to_string()
        })))
    }
}
