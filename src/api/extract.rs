//! What a path names, as a type. A name that is not one names nothing: 404.

use std::str::FromStr;

use axum::extract::{FromRequestParts, RawPathParams};
use axum::http::request::Parts;

use super::error::{Answer, Problem};
use crate::job::{ComparisonId, DatasetId, JobId};

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
