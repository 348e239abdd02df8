//! Lets a request on that its caller may ask: a token, a session, or a proxy that knows people, says who that is.
//!
//! What a path names is held against the caller's project where the name is read ([`Named`]); lists
//! and what is made go by the [`Client`] that this layer hands on.
//!
//! [`Named`]: super::extract::Named

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::http::{HeaderMap, HeaderName, HeaderValue, header};
use ipnet::IpNet;
use jiff::Timestamp;

use super::client::{Client, PeerAddress};
use super::error::{Answer, Kind, Problem};
use super::limits::Limits;
use super::rates::Rates;
use super::session_cookie::{PROVIDER, SESSION};
use crate::access::{BELIEVED, Digest, Roles, Scope, Secret};
use crate::identity::Provider;
use crate::store::{SessionHolder, Sessions, Store, TokenRow, Tokens};

/// What a request brings that brings another text than the secret of a token.
pub(super) const NO_TOKEN: &str = "no token of this server";
/// What a request brings whose session has ended.
const SESSION_IS_OVER: &str = "a session that is over";
/// Requests of this many seconds may come together from one caller.
const BURST_S: f64 = 2.0;
/// Attempts to sign in from one address, in a second in the long run.
const SIGN_INS_PER_SECOND: f64 = 0.2;
/// Attempts to sign in from one address that may come together.
const SIGN_INS_AT_ONCE: f64 = 10.0;
/// Requests from one address that say who asks and are refused, in a second in the long run, before answers to them
/// are held back.
const GUESSES_PER_SECOND: f64 = 5.0;
/// Refused requests from one address that may come together before answers are held back.
const GUESSES_AT_ONCE: f64 = 20.0;
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
pub struct Callers {
    pub(super) settings: AccessSettings,
    /// The identity provider at which people sign in.
    pub(super) provider: Option<Arc<Provider>>,
    /// The tokens that callers bring are looked up here.
    tokens: Tokens,
    /// Sessions begin, are looked up and end here.
    pub(super) sessions: Sessions,
    /// Whether a session may end at another node.
    is_shared: bool,
    /// How much each caller asks.
    pub(super) requests: Rates,
    /// How often it is tried to sign in.
    pub(super) sign_ins: Rates,
    /// How often somebody asks who may not.
    guesses: Rates,
    /// Whether everybody has to say who they are.
    asks: AtomicBool,
    looked: Mutex<Option<Instant>>,
    recent: Mutex<RecentTokens>,
}

/// The tokens that callers brought lately, and the holders of their sessions.
#[derive(Default)]
struct RecentTokens {
    remembered: HashMap<Digest, Remembered>,
    /// How many sessions have ended here.
    ended: u64,
}

struct Remembered {
    holder: SessionHolder,
    /// When the reading of the holder began.
    read: Instant,
    /// When the use of the token was last written down.
    noted: Instant,
}

/// The instant at which a token begins to be read, and the sessions that had ended by then.
struct TokenReading {
    at: Instant,
    ended: u64,
}

impl Callers {
    /// Callers of a server.
    pub(super) fn new(
        settings: AccessSettings,
        provider: Option<Arc<Provider>>,
        limits: &Limits,
        store: &Store,
    ) -> Self {
        let per_second = limits.requests_per_second;
        Self {
            tokens: store.tokens().clone(),
            sessions: store.sessions().clone(),
            is_shared: store.is_shared(),
            requests: Rates::new(per_second, per_second * BURST_S, limits.requests_at_once),
            sign_ins: Rates::new(SIGN_INS_PER_SECOND, SIGN_INS_AT_ONCE, u32::MAX),
            guesses: Rates::new(GUESSES_PER_SECOND, GUESSES_AT_ONCE, u32::MAX),
            asks: AtomicBool::new(!settings.proxies.is_empty() || provider.is_some()),
            settings,
            provider,
            looked: Mutex::default(),
            recent: Mutex::default(),
        }
    }

    /// Whether callers have to say who they are: a proxy is trusted, there is an identity provider, or a token was made.
    async fn asks(&self) -> Answer<bool> {
        if self.asks.load(Ordering::Relaxed) {
            return Ok(true);
        }
        let is_fresh = |looked: &Option<Instant>| looked.is_some_and(|at| at.elapsed() < BELIEVED);
        if is_fresh(&lock(&self.looked)) {
            return Ok(false);
        }
        let asks = self.tokens.exist().await?;
        *lock(&self.looked) = Some(Instant::now());
        if asks {
            self.asks.store(true, Ordering::Relaxed);
        }
        Ok(asks)
    }

    /// Who asks.
    pub(super) async fn client(
        &self,
        peer: Option<PeerAddress>,
        headers: &HeaderMap,
    ) -> Answer<Client> {
        let address = peer.as_ref().map_or_else(String::new, PeerAddress::to_text);
        let peer = peer.map(|PeerAddress(ip)| ip.to_canonical());
        if !self.asks().await? {
            return Ok(Client::local(address));
        }
        if let Some(given) = headers.get(header::AUTHORIZATION) {
            let secret = bearer(given).ok_or_else(|| refused(NO_TOKEN))?;
            let row = self.token(&secret, &address).await?;
            return Ok(Client::of_token(row, address));
        }
        if let Some(person) = self.person(peer, headers, &address)? {
            return Ok(person);
        }
        let secret = SESSION.of(headers);
        let secret = secret.ok_or_else(|| refused("nothing that says who asks"))?;
        let digest = secret.session_digest();
        let holder = match self.remembered(&digest) {
            // Who signs out at another node is signed out at this one too.
            Some(holder) if !self.is_shared => holder,
            _ => self.session(&digest).await?,
        };
        let client = match holder {
            SessionHolder::Token(row) => {
                let row = self.checked(&digest, row, &address)?;
                Client::of_token(row, address)
            }
            SessionHolder::Person { person, expires_at } => {
                if self.provider.is_none() || expires_at <= Timestamp::now() {
                    return Err(refused(SESSION_IS_OVER));
                }
                self.person_in_groups(&person.name, &person.groups, &address)?
            }
        };
        Ok(Client {
            has_session: true,
            ..client
        })
    }

    /// Counts the refusal of somebody who may not ask. It comes later where many come from the address.
    pub(super) async fn count_guess(&self, peer: Option<PeerAddress>) {
        if let Some(peer) = peer {
            // The answer is the refusal, whether there are many or not.
            let _ = self.guesses.count(&peer.to_text()).await;
        }
    }

    /// The refusal of whoever does not say who asks, with the way to sign in where there is an identity provider.
    pub(super) fn with_way_in(&self, problem: Problem) -> Problem {
        if self.provider.is_none() || problem.kind() != Kind::Unauthorised {
            return problem;
        }
        let link = format!("<{PROVIDER}>; rel=\"sign-in\"");
        let link = HeaderValue::from_str(&link).expect("a path is visible ASCII");
        problem.with_header(header::LINK, link)
    }

    /// The token of a secret that came from an address, where it counts.
    pub(super) async fn token(&self, secret: &Secret, address: &str) -> Answer<TokenRow> {
        let digest = secret.digest();
        let row = match self.remembered(&digest) {
            Some(SessionHolder::Token(row)) => row,
            _ => {
                let reading = self.reading();
                let row = self.tokens.find(&digest).await?;
                let row = row.ok_or_else(|| refused(NO_TOKEN))?;
                self.remember(&digest, SessionHolder::Token(row.clone()), reading);
                row
            }
        };
        self.checked(&digest, row, address)
    }

    /// The holder of a session, from the database.
    async fn session(&self, digest: &Digest) -> Answer<SessionHolder> {
        let reading = self.reading();
        let holder = self.sessions.find(digest).await?;
        let holder = holder.ok_or_else(|| refused(SESSION_IS_OVER))?;
        self.remember(digest, holder.clone(), reading);
        Ok(holder)
    }

    /// What stands for a caller, where it still counts; that it was used is noted. The refusal of a token that
    /// counts no more names the token to the log.
    fn checked(&self, digest: &Digest, row: TokenRow, address: &str) -> Answer<TokenRow> {
        let ended = match row.revoked_at {
            Some(_) => Some("a token that was revoked"),
            None if row.is_valid_at(Timestamp::now()) => None,
            None => Some("a token that has expired"),
        };
        if let Some(ended) = ended {
            let caller = Client::of_token(row, address.to_owned());
            return Err(refused(ended).with_note(caller));
        }
        if self.is_to_be_noted(digest) {
            let (tokens, id) = (self.tokens.clone(), row.id);
            tokio::spawn(async move {
                let noted = tokens.note_use(id).await;
                let warn = |error| tracing::warn!(%error, "it was not noted that a token was used");
                noted.unwrap_or_else(warn);
            });
        }
        Ok(row)
    }

    /// The holder that a digest stands for, as long as the reading is believed.
    fn remembered(&self, digest: &Digest) -> Option<SessionHolder> {
        let tokens = lock(&self.recent);
        let remembered = tokens.remembered.get(digest)?;
        (remembered.read.elapsed() < BELIEVED).then(|| remembered.holder.clone())
    }

    /// Says that a token is now read from the database.
    fn reading(&self) -> TokenReading {
        let ended = lock(&self.recent).ended;
        let at = Instant::now();
        TokenReading { at, ended }
    }

    /// Forgets a session that has ended, and lets nobody remember a row that was read before that.
    pub(super) fn forget(&self, digest: &Digest) {
        let mut tokens = lock(&self.recent);
        tokens.remembered.remove(digest);
        tokens.ended += 1;
    }

    fn remember(&self, digest: &Digest, holder: SessionHolder, reading: TokenReading) {
        let mut tokens = lock(&self.recent);
        if tokens.ended != reading.ended {
            return;
        }
        let all = &mut tokens.remembered;
        if all.len() >= REMEMBERED && !all.contains_key(digest) {
            all.clear();
        }
        let now = Instant::now();
        let long_ago = now.checked_sub(NOTED_EVERY).unwrap_or(now);
        let noted = all
            .get(digest)
            .map_or(long_ago, |remembered| remembered.noted);
        let read = reading.at;
        let remembered = Remembered {
            holder,
            read,
            noted,
        };
        all.insert(digest.clone(), remembered);
    }

    fn is_to_be_noted(&self, digest: &Digest) -> bool {
        let mut tokens = lock(&self.recent);
        let remembered = tokens.remembered.get_mut(digest);
        remembered.is_some_and(|remembered| {
            let is_due = remembered.noted.elapsed() >= NOTED_EVERY;
            if is_due {
                remembered.noted = Instant::now();
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
        let single_value = |name: &HeaderName| {
            let mut values = headers.get_all(name).iter();
            let value = values.next()?.to_str().ok()?.trim();
            (values.next().is_none() && !value.is_empty()).then_some(value)
        };
        let user = peer.filter(|peer| is_trusted(*peer));
        let user = user.and_then(|_| single_value(&self.settings.user_header));
        let Some(user) = user else {
            return Ok(None);
        };
        let groups = single_value(&self.settings.groups_header).unwrap_or_default();
        let groups: Vec<&str> = groups.split(',').collect();
        self.person_in_groups(user, &groups, address).map(Some)
    }

    /// A person who is in these groups. The refusal of one who has no role names the person to the log.
    pub(super) fn person_in_groups<G: AsRef<str>>(
        &self,
        name: &str,
        groups: &[G],
        address: &str,
    ) -> Answer<Client> {
        let role = self.settings.roles.of(groups);
        let name: String = name.chars().filter(|c| !c.is_control()).take(80).collect();
        let person = Client {
            address: address.to_owned(),
            who: format!("person {name}"),
            project: role.map(|role| role.project.clone()).unwrap_or_default(),
            scope: role.map_or(Scope::Read, |role| role.scope),
            streams: None,
            is_known: true,
            has_session: false,
        };
        match role {
            Some(_) => Ok(person),
            None => {
                let detail = "no group of this person has a role here; whoever runs this server gives roles to \
                              groups (--role)";
                Err(Problem::new(Kind::Forbidden, detail).with_note(person))
            }
        }
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
