//! The provider: discovered by its issuer (OpenID Connect Discovery 1.0), sent people to, and asked who came back.

use std::sync::Arc;
use std::time::{Duration, Instant};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hyper::body::Bytes;
use hyper::header::{ACCEPT, AUTHORIZATION, CONTENT_TYPE};
use hyper::{Method, Request};
use jiff::Timestamp;
use rustls::ClientConfig;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use tokio::sync::Mutex;
use url::{Url, form_urlencoded};

use super::attempt::SignInAttempt;
use super::claims::{Claims, Person};
use super::id_token::{Expected, IdToken, IdTokenError};
use super::keys::PublicKeys;
use super::settings::{InvalidProvider, ProviderSettings, secure_address};
use crate::outbound::{self, OutboundError, trust};

/// How long the provider may take for one answer.
const LONGEST_ANSWER: Duration = Duration::from_secs(10);
/// The bytes of an answer of the provider at the most.
const LARGEST_ANSWER: usize = 1 << 20;
/// For how long the documents of the provider are believed.
const BELIEVED: Duration = Duration::from_secs(3600);
/// How often the keys are read again at the most, where a token is signed by none of those that the server has read.
const READ_AGAIN: Duration = Duration::from_secs(10);

/// Why nobody signs in at a provider.
#[derive(Debug, thiserror::Error)]
pub enum ProviderError {
    /// There is no answer.
    #[error("{url} does not answer: {why}")]
    Silent {
        /// The address that was asked.
        url: String,
        /// Why.
        why: String,
    },
    /// The provider refuses.
    #[error("{url} answered {status}: {says}")]
    Refused {
        /// The address that was asked.
        url: String,
        /// The status of the answer.
        status: u16,
        /// The reason, in the words of the provider.
        says: String,
    },
    /// The answer of the provider cannot be used.
    #[error("{url} does not answer as OpenID Connect says: {why}")]
    Unusable {
        /// The address that was asked.
        url: String,
        /// Why.
        why: String,
    },
    /// The ID token is not believed.
    #[error("the ID token is not believed: {0}")]
    IdToken(#[from] IdTokenError),
}

/// The metadata of a provider, as OpenID Connect Discovery has them.
#[derive(Clone, Deserialize)]
struct Discovery {
    issuer: String,
    authorization_endpoint: String,
    token_endpoint: String,
    userinfo_endpoint: Option<String>,
    jwks_uri: String,
    token_endpoint_auth_methods_supported: Option<Vec<String>>,
}

/// The documents in which the provider says where it is asked and with which keys it signs.
#[derive(Clone)]
struct ProviderDocuments {
    discovery: Discovery,
    keys: PublicKeys,
    read: Instant,
    /// When all was read again because none of the keys had signed a token.
    read_again: Option<Instant>,
}

/// The answer of the provider to a code.
#[derive(Deserialize)]
struct TokenAnswer {
    id_token: String,
    access_token: Option<String>,
}

/// The reason that a provider gives for a refusal (RFC 6749, section 5.2).
#[derive(Default, Deserialize)]
struct RefusalDocument {
    #[serde(default)]
    error: String,
    #[serde(default)]
    error_description: String,
}

/// A provider that knows people.
pub struct Provider {
    settings: ProviderSettings,
    tls: Arc<ClientConfig>,
    documents: Mutex<Option<ProviderDocuments>>,
}

impl Provider {
    /// The provider of the settings. The provider is asked for the first time when somebody signs in.
    #[must_use]
    pub fn new(settings: ProviderSettings) -> Self {
        let tls = trust::client(settings.authorities.clone()).with_no_client_auth();
        Self {
            settings,
            tls: Arc::new(tls),
            documents: Mutex::default(),
        }
    }

    /// Where the browser of somebody who signs in is sent to.
    ///
    /// # Errors
    /// The provider does not answer, or not as it should.
    pub async fn authorization_url(&self, attempt: &SignInAttempt) -> Result<Url, ProviderError> {
        let documents = self.documents().await?;
        let mut url = endpoint(&documents.discovery.authorization_endpoint)?;
        let scope = ["openid"]
            .into_iter()
            .chain(self.settings.scopes.iter().map(String::as_str));
        let scope: Vec<&str> = scope.collect();
        url.query_pairs_mut()
            .append_pair("response_type", "code")
            .append_pair("client_id", &self.settings.client_id)
            .append_pair("redirect_uri", self.settings.callback.as_str())
            .append_pair("scope", &scope.join(" "))
            .append_pair("state", &attempt.state())
            .append_pair("nonce", &attempt.nonce())
            .append_pair("code_challenge", &attempt.challenge())
            .append_pair("code_challenge_method", "S256");
        Ok(url)
    }

    /// Whether browsers come back over TLS.
    #[must_use]
    pub fn returns_over_tls(&self) -> bool {
        self.settings.callback.scheme() == "https"
    }

    /// Whether an issuer that came back beside a code is this one (RFC 9207).
    #[must_use]
    pub fn is_issuer(&self, issuer: &str) -> bool {
        issuer == self.settings.issuer
    }

    /// The person to whom the provider gave a code.
    ///
    /// # Errors
    /// The provider does not answer, does not know the code, or its ID token is not believed.
    pub async fn person(
        &self,
        code: &str,
        attempt: &SignInAttempt,
    ) -> Result<Person, ProviderError> {
        let documents = self.documents().await?;
        let tokens = self.tokens(&documents.discovery, code, attempt).await?;
        let token = IdToken::read(&tokens.id_token)?;
        let keys = match token.is_signed_by(&documents.keys) {
            true => documents.keys,
            // A provider changes its keys now and then.
            false => self.documents_anew().await?.keys,
        };
        let nonce = attempt.nonce();
        let mut claims = token.believed(
            &keys,
            Expected {
                issuer: &self.settings.issuer,
                client_id: &self.settings.client_id,
                nonce: &nonce,
                now: Timestamp::now().as_second(),
            },
        )?;
        let (name, groups) = (&self.settings.name_claim, &self.settings.groups_claim);
        if !(claims.have(name) && claims.have(groups))
            && let (Some(endpoint), Some(access)) =
                (&documents.discovery.userinfo_endpoint, &tokens.access_token)
        {
            claims.complete(self.user_info(endpoint, access, &claims).await?);
        }
        let url = &documents.discovery.token_endpoint;
        let nobody = || unusable(url, "the ID token has no `sub`");
        claims.person(name, groups).ok_or_else(nobody)
    }

    /// The documents of the provider, read anew when they are old.
    async fn documents(&self) -> Result<ProviderDocuments, ProviderError> {
        let mut documents = self.documents.lock().await;
        if let Some(documents) = documents
            .as_ref()
            .filter(|documents| documents.read.elapsed() < BELIEVED)
        {
            return Ok(documents.clone());
        }
        let read = self.discover().await?;
        Ok(documents.insert(read).clone())
    }

    /// The documents of the provider, read anew because none of the known keys has signed a token.
    async fn documents_anew(&self) -> Result<ProviderDocuments, ProviderError> {
        let mut documents = self.documents.lock().await;
        let is_anew = |at: Option<Instant>| at.is_some_and(|at| at.elapsed() < READ_AGAIN);
        if let Some(documents) = documents
            .as_ref()
            .filter(|documents| is_anew(documents.read_again))
        {
            return Ok(documents.clone());
        }
        let mut read = self.discover().await?;
        read.read_again = Some(read.read);
        Ok(documents.insert(read).clone())
    }

    /// Reads the documents of the provider.
    async fn discover(&self) -> Result<ProviderDocuments, ProviderError> {
        let issuer = &self.settings.issuer;
        let place = format!(
            "{}/.well-known/openid-configuration",
            issuer.trim_end_matches('/')
        );
        let discovery: Discovery = self.read(&place).await?;
        if discovery.issuer != *issuer {
            let why = format!("its issuer is `{}` and not `{issuer}`", discovery.issuer);
            return Err(unusable(&place, why));
        }
        Ok(ProviderDocuments {
            keys: self.read(&discovery.jwks_uri).await?,
            discovery,
            read: Instant::now(),
            read_again: None,
        })
    }

    /// The document at an address.
    async fn read<T: DeserializeOwned>(&self, place: &str) -> Result<T, ProviderError> {
        let url = endpoint(place)?;
        let request = outbound::request(Method::GET, &url).header(ACCEPT, "application/json");
        let request = request.body(Bytes::new());
        let body = self.ask(&url, request).await?;
        document(place, &body)
    }

    /// Turns a code into tokens.
    async fn tokens(
        &self,
        discovery: &Discovery,
        code: &str,
        attempt: &SignInAttempt,
    ) -> Result<TokenAnswer, ProviderError> {
        let url = endpoint(&discovery.token_endpoint)?;
        let request = self.token_request(&url, discovery, code, attempt);
        let body = self.ask(&url, request).await?;
        document(&discovery.token_endpoint, &body)
    }

    /// The request that turns a code into tokens.
    fn token_request(
        &self,
        url: &Url,
        discovery: &Discovery,
        code: &str,
        attempt: &SignInAttempt,
    ) -> hyper::http::Result<Request<Bytes>> {
        let settings = &self.settings;
        let mut form = form_urlencoded::Serializer::new(String::new());
        form.append_pair("grant_type", "authorization_code")
            .append_pair("code", code)
            .append_pair("redirect_uri", settings.callback.as_str())
            .append_pair("code_verifier", &attempt.verifier());
        let mut request = outbound::request(Method::POST, url)
            .header(ACCEPT, "application/json")
            .header(CONTENT_TYPE, "application/x-www-form-urlencoded");
        match &settings.client_secret {
            Some(secret) if discovery.takes_basic() => {
                request = request.header(AUTHORIZATION, basic(&settings.client_id, secret));
            }
            secret => {
                form.append_pair("client_id", &settings.client_id);
                form.extend_pairs(secret.iter().map(|secret| ("client_secret", secret)));
            }
        }
        request.body(form.finish().into())
    }

    /// The claims that `userinfo` has of the person beside the ID token.
    async fn user_info(
        &self,
        place: &str,
        access_token: &str,
        claims: &Claims,
    ) -> Result<Claims, ProviderError> {
        let url = endpoint(place)?;
        let request = outbound::request(Method::GET, &url)
            .header(ACCEPT, "application/json")
            .header(AUTHORIZATION, format!("Bearer {access_token}"));
        let body = self.ask(&url, request.body(Bytes::new())).await?;
        let info = Claims::read(&body);
        let info = info.ok_or_else(|| unusable(place, "it is no JSON object"))?;
        // Section 5.3.2: an answer for another subject must not be used.
        match info.text("sub") == claims.text("sub") {
            true => Ok(info),
            false => Err(unusable(place, "its `sub` is another one")),
        }
    }

    /// Asks the provider; gives the body of an answer that is a success.
    async fn ask(
        &self,
        url: &Url,
        request: hyper::http::Result<Request<Bytes>>,
    ) -> Result<Bytes, ProviderError> {
        let request = request.map_err(|error| unusable(url.as_str(), error))?;
        let silent = |why: String| ProviderError::Silent {
            url: url.to_string(),
            why,
        };
        let asking = outbound::ask(url, &self.tls, request, LARGEST_ANSWER);
        let answer: Result<_, OutboundError> =
            tokio::time::timeout(LONGEST_ANSWER, asking)
                .await
                .map_err(|_| silent(format!("nothing came in {} s", LONGEST_ANSWER.as_secs())))?;
        let answer = answer.map_err(|error| silent(error.to_string()))?;
        if answer.status().is_success() {
            return Ok(answer.into_body());
        }
        let refusal: RefusalDocument = serde_json::from_slice(answer.body()).unwrap_or_default();
        let says = format!("{} {}", refusal.error, refusal.error_description);
        Err(ProviderError::Refused {
            url: url.to_string(),
            status: answer.status().as_u16(),
            says: says.chars().filter(|c| !c.is_control()).take(200).collect(),
        })
    }
}

impl Discovery {
    /// Whether the secret of a client comes as HTTP Basic, which is what a provider takes that does not say.
    fn takes_basic(&self) -> bool {
        let methods = self.token_endpoint_auth_methods_supported.as_ref();
        methods.is_none_or(|methods| methods.iter().any(|name| name == "client_secret_basic"))
    }
}

/// The name and the secret of a client (RFC 6749, section 2.3.1).
fn basic(client_id: &str, secret: &str) -> String {
    let encode = |text: &str| form_urlencoded::byte_serialize(text.as_bytes()).collect::<String>();
    let both = format!("{}:{}", encode(client_id), encode(secret));
    format!("Basic {}", STANDARD.encode(both))
}

/// An address that the provider names.
fn endpoint(place: &str) -> Result<Url, ProviderError> {
    secure_address(place).map_err(|error: InvalidProvider| unusable(place, error))
}

fn document<T: DeserializeOwned>(place: &str, body: &Bytes) -> Result<T, ProviderError> {
    serde_json::from_slice(body).map_err(|error| unusable(place, error))
}

fn unusable(place: &str, why: impl ToString) -> ProviderError {
    ProviderError::Unusable {
        url: place.to_owned(),
        why: why.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_and_the_secret_of_a_client_are_encoded_each() {
        // "a%3Ab:c+d%2F" in base64.
        assert_eq!(basic("a:b", "c d/"), "Basic YSUzQWI6YytkJTJG");
    }
}
