//! Lets a request on that its caller may ask: a token, or a proxy that knows people, says who that is.
//!
//! What a path names is held against the caller's project where the name is read ([`Named`]); lists
//! and what is made go by the [`Client`] that this layer hands on.
//!
//! [`Named`]: super::extract::Named

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::body::Body;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::StreamExt;
use ipnet::IpNet;
use jiff::Timestamp;

use super::admission::as_caller;
use super::client::{Client, PeerAddress};
use super::error::{Answer, Kind, Problem};
use super::events::EVENT_STREAM;
use super::{ApiState, session_cookie};
use crate::access::{BELIEVED, Digest, Roles, Scope, Secret};
use crate::store::TokenRow;

/// What a request brings that brings another text than the secret of a token.
pub(super) const NO_TOKEN: &str = "no token of this server";
/// Tokens that are remembered at the most.
const REMEMBERED: usize = 1000;
/// How often at the most it is noted that a token was used.
const NOTED_EVERY: Duration = Duration::from_secs(60);

/// How often it is looked whether the reader of a stream may still ask.
const LOOKED_AGAIN: Duration = Duration::from_secs(2);

/// Who may ask, as the server is set up; its tokens stand in the database.
#[derive(Clone, Debug)]
pub struct AccessSettings {
    /// The addresses of the proxies that say who a person is.
    pub proxies: Vec<IpNet>,
    /// The header in which they name the person.
    pub user_header: HeaderName,
    /// The header in which they list the person's groups, separated by commas.
    pub groups_header: HeaderName,
    /// What the groups may do.
    pub roles: Roles,
    /// Whether the server speaks TLS, so that cookies are for nothing else.
    pub speaks_tls: bool,
}

impl Default for AccessSettings {
    fn default() -> Self {
        Self {
            proxies: Vec::new(),
            user_header: HeaderName::from_static("x-forwarded-user"),
            groups_header: HeaderName::from_static("x-forwarded-groups"),
            roles: Roles::default(),
            speaks_tls: false,
        }
    }
}

/// What is remembered of callers.
pub(super) struct Callers {
    settings: AccessSettings,
    /// Whether everybody has to say who they are.
    asks: AtomicBool,
    looked: Mutex<Option<Instant>>,
    tokens: Mutex<Tokens>,
}

/// The tokens that callers brought lately, and the tokens of their sessions.
#[derive(Default)]
struct Tokens {
    remembered: HashMap<Digest, Remembered>,
    /// How many sessions have ended here.
    ended: u64,
}

struct Remembered {
    row: TokenRow,
    /// When it was begun to read the row.
    read: Instant,
    /// When its use was last written down.
    noted: Instant,
}

/// What holds when it is begun to read a token from the database.
struct Reading {
    at: Instant,
    ended: u64,
}

impl Callers {
    pub(super) fn new(settings: AccessSettings) -> Self {
        Self {
            asks: AtomicBool::new(!settings.proxies.is_empty()),
            settings,
            looked: Mutex::default(),
            tokens: Mutex::default(),
        }
    }

    /// Whether callers have to say who they are: a proxy is trusted, or a token was made.
    async fn asks(&self, state: &ApiState) -> Answer<bool> {
        if self.asks.load(Ordering::Relaxed) {
            return Ok(true);
        }
        let is_fresh = |looked: &Option<Instant>| looked.is_some_and(|at| at.elapsed() < BELIEVED);
        if is_fresh(&lock(&self.looked)) {
            return Ok(false);
        }
        let asks = state.store.tokens().exist().await?;
        *lock(&self.looked) = Some(Instant::now());
        if asks {
            self.asks.store(true, Ordering::Relaxed);
        }
        Ok(asks)
    }

    /// Who asks.
    async fn client(
        &self,
        state: &ApiState,
        peer: Option<PeerAddress>,
        headers: &HeaderMap,
    ) -> Answer<Client> {
        let address = peer.as_ref().map_or_else(String::new, PeerAddress::to_text);
        let peer = peer.map(|PeerAddress(ip)| ip.to_canonical());
        if !self.asks(state).await? {
            return Ok(Client::local(address));
        }
        if let Some(given) = headers.get(header::AUTHORIZATION) {
            let secret = bearer(given).ok_or_else(|| refused(NO_TOKEN))?;
            let row = self.token(state, &secret).await?;
            return Ok(Client::of_token(row, address));
        }
        if let Some(person) = self.person(peer, headers, &address)? {
            return Ok(person);
        }
        let secret = session_cookie::cookie(headers);
        let secret = secret.ok_or_else(|| refused("nothing that says who asks"))?;
        let digest = secret.session_digest();
        let row = match self.remembered(&digest) {
            // Who signs out at another node is signed out at this one too.
            Some(row) if !state.store.is_shared() => row,
            _ => self.session(state, &digest).await?,
        };
        let row = self.checked(state, &digest, row)?;
        Ok(Client {
            has_session: true,
            ..Client::of_token(row, address)
        })
    }

    /// The token of a secret, where it counts.
    pub(super) async fn token(&self, state: &ApiState, secret: &Secret) -> Answer<TokenRow> {
        let digest = secret.digest();
        let row = match self.remembered(&digest) {
            Some(row) => row,
            None => {
                let reading = self.reading();
                let row = state.store.tokens().find(&digest).await?;
                let row = row.ok_or_else(|| refused(NO_TOKEN))?;
                self.remember(&digest, &row, reading);
                row
            }
        };
        self.checked(state, &digest, row)
    }

    /// The token of a session, from the database.
    async fn session(&self, state: &ApiState, digest: &Digest) -> Answer<TokenRow> {
        let reading = self.reading();
        let row = state.store.sessions().find(digest).await?;
        let row = row.ok_or_else(|| refused("a session that is over"))?;
        self.remember(digest, &row, reading);
        Ok(row)
    }

    /// What stands for a caller, where it still counts; that it was used is noted.
    fn checked(&self, state: &ApiState, digest: &Digest, row: TokenRow) -> Answer<TokenRow> {
        if row.revoked_at.is_some() {
            return Err(refused("a token that was revoked"));
        }
        if !row.is_valid_at(Timestamp::now()) {
            return Err(refused("a token that has expired"));
        }
        if self.is_to_be_noted(digest) {
            let (store, id) = (state.store.clone(), row.id);
            tokio::spawn(async move {
                let noted = store.tokens().note_use(id).await;
                let warn = |error| tracing::warn!(%error, "it was not noted that a token was used");
                noted.unwrap_or_else(warn);
            });
        }
        Ok(row)
    }

    /// The row of a token, as long as it is believed.
    fn remembered(&self, digest: &Digest) -> Option<TokenRow> {
        let tokens = lock(&self.tokens);
        let remembered = tokens.remembered.get(digest)?;
        (remembered.read.elapsed() < BELIEVED).then(|| remembered.row.clone())
    }

    /// Says that a token is now read from the database.
    fn reading(&self) -> Reading {
        let ended = lock(&self.tokens).ended;
        let at = Instant::now();
        Reading { at, ended }
    }

    /// Forgets a session that has ended, and lets nobody remember a row that was read before that.
    pub(super) fn forget(&self, digest: &Digest) {
        let mut tokens = lock(&self.tokens);
        tokens.remembered.remove(digest);
        tokens.ended += 1;
    }

    fn remember(&self, digest: &Digest, row: &TokenRow, reading: Reading) {
        let mut tokens = lock(&self.tokens);
        if tokens.ended != reading.ended {
            return;
        }
        let all = &mut tokens.remembered;
        if all.len() >= REMEMBERED && !all.contains_key(digest) {
            all.clear();
        }
        let now = Instant::now();
        let long_ago = now.checked_sub(NOTED_EVERY).unwrap_or(now);
        let noted = all.get(digest).map_or(long_ago, |known| known.noted);
        let (row, read) = (row.clone(), reading.at);
        all.insert(digest.clone(), Remembered { row, read, noted });
    }

    fn is_to_be_noted(&self, digest: &Digest) -> bool {
        let mut tokens = lock(&self.tokens);
        let known = tokens.remembered.get_mut(digest);
        known.is_some_and(|known| {
            let is_due = known.noted.elapsed() >= NOTED_EVERY;
            if is_due {
                known.noted = Instant::now();
            }
            is_due
        })
    }

    /// Who a trusted proxy says that asks, where one does.
    fn person(
        &self,
        peer: Option<IpAddr>,
        headers: &HeaderMap,
        address: &str,
    ) -> Answer<Option<Client>> {
        let is_trusted = |peer: IpAddr| self.settings.proxies.iter().any(|net| net.contains(&peer));
        let one = |name: &HeaderName| {
            let mut values = headers.get_all(name).iter();
            let value = values.next()?.to_str().ok()?.trim();
            (values.next().is_none() && !value.is_empty()).then_some(value)
        };
        let user = peer.filter(|peer| is_trusted(*peer));
        let user = user.and_then(|_| one(&self.settings.user_header));
        let Some(user) = user else {
            return Ok(None);
        };
        let groups = one(&self.settings.groups_header).unwrap_or_default();
        let role = self.settings.roles.of(groups).ok_or_else(|| {
            let detail = "no group of this person has a role here";
            Problem::new(Kind::Forbidden, detail)
        })?;
        let user: String = user.chars().filter(|c| !c.is_control()).take(80).collect();
        Ok(Some(Client {
            address: address.to_owned(),
            who: format!("person {user}"),
            project: role.project.clone(),
            scope: role.scope,
            is_known: true,
            has_session: false,
        }))
    }
}

/// The secret that `Authorization` brings.
fn bearer(given: &HeaderValue) -> Option<Secret> {
    let (scheme, secret) = given.to_str().ok()?.split_once(' ')?;
    let is_bearer = scheme.eq_ignore_ascii_case("bearer");
    is_bearer.then(|| secret.trim().parse().ok())?
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(super) fn refused(what: &str) -> Problem {
    let detail = format!("the request brings {what}; `Authorization: Bearer gbx_…` carries one");
    let bearer = HeaderValue::from_static("Bearer realm=\"greybox\"");
    Problem::new(Kind::Unauthorised, detail).with_header(header::WWW_AUTHENTICATE, bearer)
}

/// What a request takes; nothing where everybody may ask.
fn needed(method: &Method, path: &str) -> Option<Scope> {
    let looks = matches!(*method, Method::GET | Method::HEAD);
    let below = |place: &str| {
        let rest = path.strip_prefix(place);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    if path == "/metrics" {
        Some(Scope::Read)
    } else if !below("/v1") || (path == session_cookie::PATH && *method == Method::POST) {
        None
    } else if path == session_cookie::PATH {
        Some(Scope::Read)
    } else if ["/v1/audit", "/v1/webhooks", "/v1/deliveries"]
        .into_iter()
        .any(below)
    {
        Some(Scope::Admin)
    } else if looks {
        Some(Scope::Read)
    } else {
        Some(Scope::Submit)
    }
}

/// Lets a request on whose caller is known and may ask it; notes who that is, for the handlers and
/// for the log.
pub(super) async fn authorise(
    State(state): State<ApiState>,
    mut request: Request,
    next: Next,
) -> Response {
    let Some(needed) = needed(request.method(), request.uri().path()) else {
        return next.run(request).await;
    };
    let peer = request.extensions().get::<PeerAddress>().copied();
    let client = state
        .0
        .callers
        .client(&state, peer, request.headers())
        .await;
    let client = match client {
        Ok(client) => client,
        Err(problem) => return problem.into_response(),
    };
    let forgeable = client.has_session && !matches!(*request.method(), Method::GET | Method::HEAD);
    let counted = client.is_known.then(|| state.0.rates.count(&client.who));
    let mut response = match counted.transpose() {
        Err(problem) => problem.into_response(),
        Ok(_) if forgeable && !session_cookie::brings_csrf_token(request.headers()) => {
            session_cookie::no_csrf_token().into_response()
        }
        Ok(_) if client.scope < needed => {
            let detail = format!(
                "this takes the scope `{needed}`; yours is `{}`",
                client.scope
            );
            Problem::new(Kind::Forbidden, detail).into_response()
        }
        Ok(counted) => {
            request.extensions_mut().insert(client.clone());
            let who = match client.is_known {
                true => &client.who,
                false => &client.address,
            };
            let headers = request.headers().clone();
            let response = as_caller(who, next.run(request)).await;
            match counted {
                Some(under_way) => {
                    let response = until_refused(response, state, peer, headers);
                    under_way.until_the_end_of(response)
                }
                None => response,
            }
        }
    };
    response.extensions_mut().insert(client);
    response
}

/// The answer, which ends if it is a stream of events and whoever asked for it may ask no more.
fn until_refused(
    answer: Response,
    state: ApiState,
    peer: Option<PeerAddress>,
    headers: HeaderMap,
) -> Response {
    let kind = answer.headers().get(header::CONTENT_TYPE);
    if kind.is_none_or(|kind| kind != EVENT_STREAM) {
        return answer;
    }
    let refused = async move {
        loop {
            tokio::time::sleep(LOOKED_AGAIN).await;
            let client = state.0.callers.client(&state, peer, &headers).await;
            let kind = client.err().map(|problem| problem.kind());
            if let Some(Kind::Unauthorised | Kind::Forbidden) = kind {
                return;
            }
        }
    };
    answer.map(|body| Body::from_stream(body.into_data_stream().take_until(Box::pin(refused))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_needed_goes_by_the_path_and_the_method() {
        for (method, path, expected) in [
            (Method::GET, "/livez", None),
            (Method::GET, "/openapi.json", None),
            (Method::GET, "/metrics", Some(Scope::Read)),
            (Method::GET, "/v1/jobs", Some(Scope::Read)),
            (Method::HEAD, "/v1/jobs", Some(Scope::Read)),
            (Method::POST, "/v1/jobs", Some(Scope::Submit)),
            (Method::DELETE, "/v1/jobs/x", Some(Scope::Submit)),
            (Method::OPTIONS, "/v1/anything", Some(Scope::Submit)),
            (Method::GET, "/v1/audit", Some(Scope::Admin)),
            (Method::POST, "/v1/session", None),
            (Method::GET, "/v1/session", Some(Scope::Read)),
            (Method::DELETE, "/v1/session", Some(Scope::Read)),
            (Method::GET, "/v1/webhooks/x/deliveries", Some(Scope::Admin)),
        ] {
            assert_eq!(needed(&method, path), expected, "{method} {path}");
        }
    }
}
