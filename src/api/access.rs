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

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use ipnet::IpNet;
use jiff::Timestamp;

use super::ApiState;
use super::client::{Client, PeerAddress};
use super::error::{Answer, Kind, Problem};
use crate::access::{Digest, Roles, Scope, Secret};
use crate::store::TokenRow;

/// How long what the database says of a token is believed.
const BELIEVED: Duration = Duration::from_secs(1);
/// Tokens that are remembered at the most.
const REMEMBERED: usize = 1000;
/// How often at the most it is noted that a token was used.
const NOTED_EVERY: Duration = Duration::from_secs(60);

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
}

impl Default for AccessSettings {
    fn default() -> Self {
        Self {
            proxies: Vec::new(),
            user_header: HeaderName::from_static("x-forwarded-user"),
            groups_header: HeaderName::from_static("x-forwarded-groups"),
            roles: Roles::default(),
        }
    }
}

/// What is remembered of callers.
pub(super) struct Callers {
    settings: AccessSettings,
    /// Whether everybody has to say who they are.
    asks: AtomicBool,
    looked: Mutex<Option<Instant>>,
    tokens: Mutex<HashMap<Digest, Remembered>>,
}

struct Remembered {
    row: TokenRow,
    read: Instant,
    /// When its use was last written down.
    noted: Instant,
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
        let asks = state.store.has_tokens().await?;
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
            let row = self.token(state, given).await?;
            return Ok(Client {
                address,
                who: format!("token {}", row.name),
                project: row.project,
                scope: row.scope,
                is_known: true,
            });
        }
        self.person(peer, headers, address)
    }

    async fn token(&self, state: &ApiState, given: &HeaderValue) -> Answer<TokenRow> {
        let text = given.to_str().unwrap_or_default();
        let secret = text.split_once(' ').and_then(|(scheme, secret)| {
            let is_bearer = scheme.eq_ignore_ascii_case("bearer");
            is_bearer.then(|| secret.trim().parse::<Secret>().ok())?
        });
        let digest = secret.ok_or_else(|| refused("no token of this server"))?;
        let digest = digest.digest();
        let row = match self.remembered(&digest) {
            Some(row) => row,
            None => {
                let row = state.store.token(&digest).await?;
                let row = row.ok_or_else(|| refused("no token of this server"))?;
                self.remember(digest.clone(), &row);
                row
            }
        };
        if row.revoked_at.is_some() {
            return Err(refused("a token that was revoked"));
        }
        if !row.is_valid_at(Timestamp::now()) {
            return Err(refused("a token that has expired"));
        }
        if self.is_to_be_noted(&digest) {
            let (store, id) = (state.store.clone(), row.id);
            tokio::spawn(async move {
                let noted = store.note_use(id).await;
                let warn = |error| tracing::warn!(%error, "it was not noted that a token was used");
                noted.unwrap_or_else(warn);
            });
        }
        Ok(row)
    }

    fn remembered(&self, digest: &Digest) -> Option<TokenRow> {
        let tokens = lock(&self.tokens);
        let known = tokens.get(digest)?;
        (known.read.elapsed() < BELIEVED).then(|| known.row.clone())
    }

    fn remember(&self, digest: Digest, row: &TokenRow) {
        let mut tokens = lock(&self.tokens);
        if tokens.len() >= REMEMBERED && !tokens.contains_key(&digest) {
            tokens.clear();
        }
        let now = Instant::now();
        let long_ago = now.checked_sub(NOTED_EVERY).unwrap_or(now);
        let noted = tokens.get(&digest).map_or(long_ago, |known| known.noted);
        let (row, read) = (row.clone(), now);
        tokens.insert(digest, Remembered { row, read, noted });
    }

    fn is_to_be_noted(&self, digest: &Digest) -> bool {
        let mut tokens = lock(&self.tokens);
        let known = tokens.get_mut(digest);
        known.is_some_and(|known| {
            let is_due = known.noted.elapsed() >= NOTED_EVERY;
            if is_due {
                known.noted = Instant::now();
            }
            is_due
        })
    }

    /// Who a trusted proxy says that asks.
    fn person(&self, peer: Option<IpAddr>, headers: &HeaderMap, address: String) -> Answer<Client> {
        let is_trusted = |peer: IpAddr| self.settings.proxies.iter().any(|net| net.contains(&peer));
        let one = |name: &HeaderName| {
            let mut values = headers.get_all(name).iter();
            let value = values.next()?.to_str().ok()?.trim();
            (values.next().is_none() && !value.is_empty()).then_some(value)
        };
        let user = peer.filter(|peer| is_trusted(*peer));
        let user = user.and_then(|_| one(&self.settings.user_header));
        let user = user.ok_or_else(|| refused("nothing that says who asks"))?;
        let groups = one(&self.settings.groups_header).unwrap_or_default();
        let role = self.settings.roles.of(groups).ok_or_else(|| {
            let detail = "no group of this person has a role here";
            Problem::new(Kind::Forbidden, detail)
        })?;
        let user: String = user.chars().filter(|c| !c.is_control()).take(80).collect();
        Ok(Client {
            address,
            who: format!("person {user}"),
            project: role.project.clone(),
            scope: role.scope,
            is_known: true,
        })
    }
}

fn lock<T>(what: &Mutex<T>) -> MutexGuard<'_, T> {
    what.lock().unwrap_or_else(PoisonError::into_inner)
}

fn refused(what: &str) -> Problem {
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
    } else if !below("/v1") {
        None
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
    let counted = client.is_known.then(|| state.0.rates.count(&client.who));
    let mut response = match counted.transpose() {
        Err(problem) => problem.into_response(),
        Ok(_) if client.scope < needed => {
            let detail = format!(
                "this takes the scope `{needed}`; yours is `{}`",
                client.scope
            );
            Problem::new(Kind::Forbidden, detail).into_response()
        }
        Ok(counted) => {
            request.extensions_mut().insert(client.clone());
            let response = next.run(request).await;
            match counted {
                Some(under_way) => under_way.until_the_end_of(response),
                None => response,
            }
        }
    };
    response.extensions_mut().insert(client);
    response
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
            (Method::GET, "/v1/webhooks/x/deliveries", Some(Scope::Admin)),
        ] {
            assert_eq!(needed(&method, path), expected, "{method} {path}");
        }
    }
}
