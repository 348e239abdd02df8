//! Sessions of people at the page: a token is taken once, or the identity provider says who it is ([`provider`]), and
//! a cookie stands for that from then on.
//!
//! The cookie holds 256 random bits and is out of reach of scripts; the server keeps a digest of them.
//! A browser sends it with each request to this server, whoever had it ask, so that a request that
//! changes something has to bring a second text, which only a page of this server can know; that it
//! comes from no other site is looked at before ([`origin`](super::origin)). A session may do what its
//! token may, and ends with it, with its own time, or by signing out.

pub mod provider;

use std::sync::Arc;

use axum::extract::{FromRequest, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::IntoResponse;
use jiff::{SignedDuration, Timestamp};
use serde::Serialize;
use utoipa::ToSchema;

use super::access::{Callers, NO_TOKEN, refused};
use super::body::{Bodies, JsonDocument};
use super::client::{Client, PeerAddress};
use super::error::{Answer, Kind, Problem};
use super::http_headers::json;
use super::query::{NoQuery, Params};
use super::session_cookie::SESSION;
use crate::access::{Scope, Secret};
use crate::store::NewHolder;
use greybox::parsing::reader::{Field, read_document};

/// How long a session lasts.
const LIFE: SignedDuration = SignedDuration::from_hours(12);

/// A token, to begin a session with.
#[derive(ToSchema)]
#[schema(example = json!({"token": "gbx_0f3a…"}))]
#[allow(dead_code, reason = "it describes a body that is read field by field")]
pub struct SignIn {
    /// The secret of the token.
    token: String,
}

/// Who asks.
#[derive(Serialize, ToSchema)]
pub struct Session {
    /// What the caller is called: `token <name>`, `person <name>`, or `local` where nobody has to say who
    /// they are.
    #[schema(example = "token operator")]
    who: String,
    /// The project that it asks in.
    #[schema(example = "hall-2")]
    project: String,
    /// How much it may do there.
    #[schema(value_type = String, example = "submit")]
    scope: &'static str,
    /// What requests that change something bring as `X-CSRF-Token` beside the cookie of a session;
    /// `null` where there is no session.
    csrf_token: Option<String>,
    /// When the session ends at the latest; told when it is begun.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = String, format = DateTime, required = false)]
    expires_at: Option<Timestamp>,
}

impl Session {
    fn new(client: &Client, secret: Option<&Secret>) -> Self {
        Self {
            who: client.who.clone(),
            project: client.project.to_string(),
            scope: client.scope.as_str(),
            csrf_token: secret.map(Secret::csrf_token),
            expires_at: None,
        }
    }
}

/// Begin a session: a browser sends its cookie from then on.
///
/// It may do what the token may, for twelve hours at the most, and ends when the token does. Requests
/// that change something bring `csrf_token` as `X-CSRF-Token`. Programs need no session: they bring
/// their token with each request.
#[utoipa::path(
    post, path = "/v1/session", operation_id = "sign_in", tag = "access",
    request_body(content = SignIn, content_type = "application/json"),
    responses((status = 200, description = "The session", body = Session,
               headers(("Set-Cookie" = String, description = "The cookie of the session"))))
)]
pub async fn sign_in(
    State(callers): State<Arc<Callers>>,
    State(bodies): State<Bodies>,
    _query: Params<NoQuery>,
    request: Request,
) -> Answer {
    let peer = request.extensions().get::<PeerAddress>();
    let address = peer.map_or_else(String::new, PeerAddress::to_text);
    let attempts = format!("attempts to sign in from {address}");
    let _counted = callers.sign_ins.count(&attempts).await?;
    let headers = request.headers().clone();
    let document = JsonDocument::from_request(request, &bodies).await?;
    let token = read_document(&document.value, read).map_err(Problem::of_document)?;
    let token = token.trim().parse::<Secret>();
    let token = token.map_err(|()| refused(NO_TOKEN))?;
    let row = callers.token(&token, &address).await?;
    if row.scope == Scope::Append {
        let detail =
            "a token with the scope `append` is for programs that append; it begins no session";
        return Err(Problem::new(Kind::Forbidden, detail));
    }
    let holder = NewHolder::Token(row.id);
    let begun = begin(&callers, &headers, holder, row.expires_at).await?;
    let client = Client::of_token(row, address);
    let shown = Session {
        expires_at: Some(begun.ends),
        ..Session::new(&client, Some(&begun.secret))
    };
    let mut response = json(StatusCode::OK, &shown);
    begun.keep(response.headers_mut(), is_secure(&callers, &headers));
    response.extensions_mut().insert(client);
    Ok(response)
}

/// A session that has begun.
struct BegunSession {
    secret: Secret,
    ends: Timestamp,
    life_s: i64,
}

impl BegunSession {
    /// Has the browser keep the cookie of the session.
    fn keep(&self, headers: &mut HeaderMap, is_secure: bool) {
        SESSION.keep(headers, &self.secret, self.life_s, is_secure);
    }
}

/// Ends the session that a request brings, and begins another, which lasts no longer than to an instant.
async fn begin(
    callers: &Callers,
    headers: &HeaderMap,
    holder: NewHolder,
    at_most: Option<Timestamp>,
) -> Answer<BegunSession> {
    end(callers, headers).await?;
    let secret = new_secret()?;
    let now = Timestamp::now();
    let latest = now + LIFE;
    let ends = at_most.map_or(latest, |end| end.min(latest));
    let digest = secret.session_digest();
    callers.sessions.begin(holder, digest, ends).await?;
    let life_s = ends.duration_since(now).as_secs();
    Ok(BegunSession {
        secret,
        ends,
        life_s,
    })
}

fn new_secret() -> Answer<Secret> {
    Secret::new().map_err(|error| {
        tracing::error!(%error, "the system gives no random bytes");
        Problem::of_status(StatusCode::INTERNAL_SERVER_ERROR)
    })
}

fn read(root: &Field<'_>) -> Option<String> {
    let mut object = root.object()?;
    let token = object.required("token").and_then(|field| field.text());
    let token = token.map(str::to_owned);
    object.finish();
    token
}

/// Whether the browser speaks TLS, to this server or to a proxy in front of it.
fn is_secure(callers: &Callers, headers: &HeaderMap) -> bool {
    let origin = headers.get(header::ORIGIN);
    let https = origin.is_some_and(|origin| origin.as_bytes().starts_with(b"https:"));
    https || callers.settings.speaks_tls
}

/// Ends the session that a request brings, where it brings one.
async fn end(callers: &Callers, headers: &HeaderMap) -> Answer<()> {
    if let Some(secret) = SESSION.of(headers) {
        let digest = secret.session_digest();
        callers.sessions.end(digest.clone()).await?;
        callers.forget(&digest);
    }
    Ok(())
}

/// Show who asks, by whatever it says so.
#[utoipa::path(
    get, path = "/v1/session", operation_id = "show_session", tag = "access",
    responses((status = 200, description = "The caller", body = Session))
)]
pub async fn show(client: Client, _query: Params<NoQuery>, headers: HeaderMap) -> Answer {
    let secret = SESSION.of(&headers).filter(|_| client.has_session);
    let mut response = json(StatusCode::OK, &Session::new(&client, secret.as_ref()));
    let no_store = HeaderValue::from_static("no-store");
    response
        .headers_mut()
        .insert(header::CACHE_CONTROL, no_store);
    Ok(response)
}

/// End the session.
#[utoipa::path(
    delete, path = "/v1/session", operation_id = "sign_out", tag = "access",
    responses((status = 204, description = "It is over"),
              (status = 409, description = "The caller has no session"))
)]
pub async fn sign_out(
    State(callers): State<Arc<Callers>>,
    client: Client,
    _query: Params<NoQuery>,
    headers: HeaderMap,
) -> Answer {
    if !client.has_session {
        let detail = "there is no session: the request does not bring the cookie of one";
        return Err(Problem::new(Kind::WrongState, detail));
    }
    end(&callers, &headers).await?;
    let mut response = StatusCode::NO_CONTENT.into_response();
    SESSION.forget(response.headers_mut(), is_secure(&callers, &headers));
    Ok(response)
}
