//! What a path names, as a type: a name that is not one names nothing (404).

use std::convert::Infallible;
use std::fmt::Display;
use std::str::FromStr;

use axum::extract::{FromRef, FromRequestParts, RawPathParams};
use axum::http::request::Parts;

use super::client::Client;
use super::error::{Answer, Problem};
use crate::access::Project;
use crate::job::{ComparisonId, DeliveryId, MonitorId, WebhookId};
use crate::store::{Store, StoreError};
use greybox::identification::{DatasetId, JobId};

/// What the one parameter of a path names: something of the caller's project, or nothing.
pub struct Named<T>(pub T);

/// A name that a person chose, of so many characters at the most; nothing where the name has a slash or a control
/// character, or is a step of a path (`.`, `..`), which browsers take out of an address.
pub fn chosen_name(text: &str, most: usize) -> Option<String> {
    let is_plain =
        text.chars().all(|c| !c.is_control() && c != '/') && ![".", ".."].contains(&text);
    let is_name = is_plain && (1..=most).contains(&text.chars().count());
    is_name.then(|| text.to_owned())
}

/// A type that paths name.
pub trait PathName: FromStr + Sync {
    /// The word for the type in a sentence.
    const WHAT: &'static str;

    /// The project that owns the named thing; nothing where there is no such thing, or where only the
    /// caller's project is searched.
    fn project(
        &self,
        store: &Store,
    ) -> impl Future<Output = Result<Option<Project>, StoreError>> + Send;

    /// The answer where nothing has the name.
    fn not_found(&self) -> Problem
    where
        Self: Display,
    {
        Problem::not_found(Self::WHAT, &self.to_string())
    }
}

impl PathName for JobId {
    const WHAT: &'static str = "job";

    async fn project(&self, store: &Store) -> Result<Option<Project>, StoreError> {
        store.jobs().project_of(*self).await
    }
}

impl PathName for ComparisonId {
    const WHAT: &'static str = "comparison";

    async fn project(&self, store: &Store) -> Result<Option<Project>, StoreError> {
        store.comparisons().project_of(*self).await
    }
}

impl PathName for MonitorId {
    const WHAT: &'static str = "monitor";

    async fn project(&self, store: &Store) -> Result<Option<Project>, StoreError> {
        store.monitors().project_of(*self).await
    }
}

impl PathName for DatasetId {
    const WHAT: &'static str = "dataset";

    async fn project(&self, store: &Store) -> Result<Option<Project>, StoreError> {
        let row = store.datasets().find(*self).await?;
        Ok(row.map(|row| row.project.clone()))
    }
}

impl PathName for WebhookId {
    const WHAT: &'static str = "webhook";

    async fn project(&self, store: &Store) -> Result<Option<Project>, StoreError> {
        let row = store.webhooks().find(*self).await?;
        Ok(row.map(|row| row.project))
    }
}

impl PathName for DeliveryId {
    const WHAT: &'static str = "delivery";

    async fn project(&self, store: &Store) -> Result<Option<Project>, StoreError> {
        store.deliveries().project_of(*self).await
    }
}

/// The name of a model: one of the program's, or `name@digest`, which is looked for in the project.
pub struct ModelName(pub String);

impl FromStr for ModelName {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self(text.to_owned()))
    }
}

impl PathName for ModelName {
    const WHAT: &'static str = "model";

    async fn project(&self, _store: &Store) -> Result<Option<Project>, StoreError> {
        Ok(None)
    }
}

impl<T: PathName + Send, S: Send + Sync> FromRequestParts<S> for Named<T>
where
    Store: FromRef<S>,
{
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Answer<Self> {
        let client = Client::of(parts)?.clone();
        let params = RawPathParams::from_request_parts(parts, state).await;
        let params = params.map_err(|_| Problem::not_found(T::WHAT, "�"))?;
        let name = params.iter().next().map_or("", |(_, value)| value);
        let named: T = name
            .parse()
            .map_err(|_| Problem::not_found(T::WHAT, name))?;
        // Where nobody has to say who they are there is one project.
        if client.is_known
            && let Some(project) = named.project(&Store::from_ref(state)).await?
            && project != client.project
        {
            return Err(client.refuse_another_project());
        }
        Ok(Named(named))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chosen_name_is_one_that_an_address_can_hold() {
        for name in ["a", "monthly export, 100 %", "...", "Halle 2 · Öl"] {
            assert_eq!(chosen_name(name, 30).as_deref(), Some(name));
        }
        for name in [
            "",
            ".",
            "..",
            "a/b",
            "a\nb",
            "longer than it may be, by far",
        ] {
            assert_eq!(chosen_name(name, 20), None, "{name:?}");
        }
    }
}
