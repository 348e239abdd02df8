//! Signing in at the identity provider: the way there, and the way back.

use std::sync::Arc;

use axum::extract::{Query, State};
use axum::http::{Extensions, HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use utoipa::IntoParams;

use super::begin;
use crate::access::Secret;
use crate::api::access::Callers;
use crate::api::client::PeerAddress;
use crate::api::error::{Answer, Kind, Problem};
use crate::api::query::{NoQuery, Params};
use crate::api::session_cookie::ATTEMPT;
use crate::identity::{Provider, ProviderError, SignInAttempt};
use crate::store::{NewHolder, PersonRow};

/// How long a person may take at the provider `[s]`.
const ATTEMPT_LIFE_S: i64 = 600;
/// The characters of what a provider says that are repeated.
const SAID_CHARS: usize = 200;

/// The parameters that the identity provider has a browser bring back. Other parameters of a provider are passed over.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct Returned {
    /// The code for which the provider says who the person is.
    code: Option<String>,
    /// The text that binds the way back to the way there.
    state: Option<String>,
    /// The issuer, where the provider says so (RFC 9207).
    iss: Option<String>,
    /// Why nobody signed in, a word.
    error: Option<String>,
    /// Why nobody signed in, a sentence.
    error_description: Option<String>,
}

/// Sign in at the plant's identity provider: a browser is sent there, and comes back with a session.
///
/// What a person may do goes by the groups that the provider tells (`--role`), and the session lasts for twelve
/// hours.
#[utoipa::path(
    get, path = "/v1/session/provider", operation_id = "sign_in_at_provider", tag = "access",
    responses((status = 303, description = "To the identity provider",
               headers(("Location" = String, description = "The identity provider"))),
              (status = 404, description = "The server has no identity provider"),
              (status = 502, description = "The identity provider does not answer as it should"))
)]
pub async fn leave(
    State(callers): State<Arc<Callers>>,
    _query: Params<NoQuery>,
    extensions: Extensions,
) -> Answer {
    let provider = provider(&callers)?;
    let _counted = count(&callers, "leave for the provider", &extensions).await?;
    let secret = super::new_secret()?;
    let attempt = SignInAttempt::new(secret.clone());
    let url = provider.authorization_url(&attempt).await;
    let mut response = see_other(url.map_err(failed)?.as_str());
    let is_secure = provider.returns_over_tls();
    ATTEMPT.keep(response.headers_mut(), &secret, ATTEMPT_LIFE_S, is_secure);
    Ok(response)
}

/// Come back from the identity provider: begin a session and go to the page.
#[utoipa::path(
    get, path = "/v1/session/callback", operation_id = "return_from_provider", tag = "access",
    params(Returned),
    responses((status = 303, description = "To the page",
               headers(("Set-Cookie" = String, description = "The cookie of the session"))),
              (status = 403, description = "Nobody signed in here before, the provider refused, or no group of the \
                                            person has a role"),
              (status = 404, description = "The server has no identity provider"),
              (status = 502, description = "The identity provider does not answer as it should, or is not believed"))
)]
pub async fn arrive(
    State(callers): State<Arc<Callers>>,
    Query(returned): Query<Returned>,
    headers: HeaderMap,
    extensions: Extensions,
) -> Answer {
    let provider = provider(&callers)?;
    let attempt = ATTEMPT.of(&headers);
    let attempt = attempt.and_then(|secret| returned.of_attempt(provider, secret));
    let attempt = attempt.ok_or_else(|| {
        let detail = "this browser has not begun to sign in here, or more than ten minutes ago; begin again at the page";
        Problem::new(Kind::Forbidden, detail)
    })?;
    let (_counted, address) = count(&callers, "come back from the provider", &extensions).await?;
    let person = provider.person(returned.code()?, &attempt).await;
    let person = person.map_err(failed)?;
    let client = callers.person_in_groups(&person.name, &person.groups, &address)?;
    let person = PersonRow {
        name: person.name,
        groups: person.groups,
    };
    let begun = begin(&callers, &headers, NewHolder::Person(person), None).await?;
    let mut response = see_other("/");
    let is_secure = provider.returns_over_tls();
    begun.keep(response.headers_mut(), is_secure);
    ATTEMPT.forget(response.headers_mut(), is_secure);
    response.extensions_mut().insert(client);
    Ok(response)
}

impl Returned {
    /// The attempt of a secret, where the provider answers that attempt.
    fn of_attempt(&self, provider: &Provider, secret: Secret) -> Option<SignInAttempt> {
        let attempt = SignInAttempt::new(secret);
        let is_from_there = |issuer: &String| provider.is_issuer(issuer);
        let is_answered = self.state.as_deref() == Some(&*attempt.state())
            && self.iss.as_ref().is_none_or(is_from_there);
        is_answered.then_some(attempt)
    }

    /// The code, or the refusal of the provider.
    fn code(&self) -> Answer<&str> {
        let reason = self.error.iter().chain(&self.error_description);
        let reason: Vec<&str> = reason.map(String::as_str).collect();
        match &self.code {
            Some(code) if reason.is_empty() => Ok(code),
            _ => {
                let reason = reason.join(": ");
                let reason = reason.chars().filter(|c| !c.is_control()).take(SAID_CHARS);
                let reason: String = reason.collect();
                let detail = format!("the identity provider let nobody sign in ({reason})");
                Err(Problem::new(Kind::Forbidden, detail))
            }
        }
    }
}

fn provider(callers: &Callers) -> Answer<&Provider> {
    let none = || {
        let detail = "this server has no identity provider (--oidc-issuer)";
        Problem::new(Kind::NotFound, detail)
    };
    callers.provider.as_deref().ok_or_else(none)
}

/// Counts an attempt of an address, which is answered too.
async fn count(
    callers: &Callers,
    what: &str,
    extensions: &Extensions,
) -> Answer<(impl Sized + use<>, String)> {
    let peer = extensions.get::<PeerAddress>();
    let address = peer.map_or_else(String::new, PeerAddress::to_text);
    let attempts = format!("attempts to {what} from {address}");
    let counted = callers.sign_ins.count(&attempts).await?;
    Ok((counted, address))
}

fn failed(error: ProviderError) -> Problem {
    tracing::error!(%error, "nobody signed in at the identity provider");
    let detail = format!("nobody could sign in at the identity provider: {error}");
    Problem::new(Kind::Other(StatusCode::BAD_GATEWAY), detail)
}

fn see_other(place: &str) -> Response {
    let place = HeaderValue::from_str(place).expect("an address is visible ASCII");
    let headers: [(HeaderName, HeaderValue); 1] = [(header::LOCATION, place)];
    (StatusCode::SEE_OTHER, headers).into_response()
}
