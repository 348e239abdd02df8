//! An identity provider as far as a server that asks it can tell, whose answers a test may change.

use std::collections::HashMap;
use std::net::Ipv4Addr;
use std::sync::{Arc, Mutex, MutexGuard};

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::routing::{get, post};
use axum::{Json, Router};
use base64::Engine as _;
use base64::engine::general_purpose::{STANDARD, URL_SAFE_NO_PAD};
use jiff::Timestamp;
use reqwest::Url;
use ring::rand::SystemRandom;
use ring::signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair, KeyPair};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

/// The name of greybox at the provider.
pub const CLIENT: &str = "greybox";
/// The secret of greybox at the provider.
pub const SECRET: &str = "s3cret/+ of: greybox";

/// A provider that answers on a port of its own.
#[derive(Clone)]
pub struct Provider {
    pub issuer: String,
    inner: Arc<Mutex<Inner>>,
}

struct Inner {
    issuer: String,
    key: SigningKey,
    /// What a code stands for.
    codes: HashMap<String, Grant>,
    /// What `userinfo` says.
    info: Value,
    /// What is done to an ID token before it is given away.
    forged: fn(String) -> String,
    /// How often a code was brought.
    codes_brought: usize,
}

struct Grant {
    challenge: String,
    claims: Value,
}

struct SigningKey {
    name: String,
    pair: EcdsaKeyPair,
}

impl SigningKey {
    fn new(name: &str) -> Self {
        let random = SystemRandom::new();
        let algorithm = &ECDSA_P256_SHA256_FIXED_SIGNING;
        let document = EcdsaKeyPair::generate_pkcs8(algorithm, &random).unwrap();
        Self {
            name: name.to_owned(),
            pair: EcdsaKeyPair::from_pkcs8(algorithm, document.as_ref(), &random).unwrap(),
        }
    }

    fn public(&self) -> Value {
        let point = self.pair.public_key().as_ref();
        let coordinate = |bytes: &[u8]| URL_SAFE_NO_PAD.encode(bytes);
        json!({"kty": "EC", "crv": "P-256", "use": "sig", "alg": "ES256", "kid": self.name,
               "x": coordinate(&point[1..33]), "y": coordinate(&point[33..])})
    }

    fn token(&self, claims: &Value) -> String {
        let header = json!({"alg": "ES256", "typ": "JWT", "kid": self.name});
        let encode = |part: &Value| URL_SAFE_NO_PAD.encode(part.to_string());
        let signed = format!("{}.{}", encode(&header), encode(claims));
        let signature = self.pair.sign(&SystemRandom::new(), signed.as_bytes());
        format!("{signed}.{}", URL_SAFE_NO_PAD.encode(signature.unwrap()))
    }
}

impl Provider {
    /// A provider at a free port.
    pub async fn start() -> Self {
        let listener = tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
        let listener = listener.unwrap();
        let issuer = format!("http://{}/realms/plant", listener.local_addr().unwrap());
        let provider = Self {
            issuer: issuer.clone(),
            inner: Arc::new(Mutex::new(Inner {
                issuer,
                key: SigningKey::new("first"),
                codes: HashMap::new(),
                info: Value::Null,
                forged: |token| token,
                codes_brought: 0,
            })),
        };
        let routes = Router::new()
            .route(
                "/realms/plant/.well-known/openid-configuration",
                get(discovery),
            )
            .route("/realms/plant/keys", get(keys))
            .route("/realms/plant/token", post(token))
            .route("/realms/plant/userinfo", get(user_info))
            .with_state(provider.clone());
        tokio::spawn(async move { axum::serve(listener, routes).await });
        provider
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap()
    }

    /// What happens at the provider when a person signs in who was sent to an address: the provider checks the
    /// address, and sends the browser back to the path that this answers. The claims are added to those that every
    /// token has, or take their place.
    pub fn sign_in(&self, address: &str, claims: &Value) -> String {
        let url = Url::parse(address).unwrap();
        assert_eq!(url.path(), "/realms/plant/authorize");
        let asked: HashMap<String, String> = url.query_pairs().into_owned().collect();
        assert_eq!(asked["response_type"], "code");
        assert_eq!(asked["client_id"], CLIENT);
        assert_eq!(asked["code_challenge_method"], "S256");
        assert_eq!(asked["scope"], "openid profile");
        let mut inner = self.inner();
        let now = Timestamp::now().as_second();
        let mut all = json!({"iss": inner.issuer, "aud": CLIENT, "sub": "7", "iat": now,
                             "exp": now + 300, "nonce": asked["nonce"]});
        for (name, value) in claims.as_object().unwrap() {
            all[name] = value.clone();
        }
        let code = format!("code-{}", inner.codes.len());
        let grant = Grant {
            challenge: asked["code_challenge"].clone(),
            claims: all,
        };
        inner.codes.insert(code.clone(), grant);
        let mut back = Url::parse(&asked["redirect_uri"]).unwrap();
        back.query_pairs_mut()
            .append_pair("code", &code)
            .append_pair("state", &asked["state"])
            // As Keycloak has it.
            .append_pair("session_state", "5")
            .append_pair("iss", &inner.issuer);
        format!("{}?{}", back.path(), back.query().unwrap())
    }

    /// Signs with another key from now on, and publishes that alone.
    pub fn change_keys(&self) {
        self.inner().key = SigningKey::new("second");
    }

    /// Changes ID tokens before they are given away.
    pub fn forge(&self, forged: fn(String) -> String) {
        self.inner().forged = forged;
    }

    /// What is said of a person beside the ID token.
    pub fn say(&self, info: Value) {
        self.inner().info = info;
    }

    /// How often a code was brought.
    pub fn codes_brought(&self) -> usize {
        self.inner().codes_brought
    }
}

async fn discovery(State(provider): State<Provider>) -> Json<Value> {
    let issuer = &provider.issuer;
    Json(json!({
        "issuer": issuer,
        "authorization_endpoint": format!("{issuer}/authorize"),
        "token_endpoint": format!("{issuer}/token"),
        "userinfo_endpoint": format!("{issuer}/userinfo"),
        "jwks_uri": format!("{issuer}/keys"),
        "code_challenge_methods_supported": ["S256"],
    }))
}

async fn keys(State(provider): State<Provider>) -> Json<Value> {
    Json(json!({"keys": [provider.inner().key.public()]}))
}

async fn token(
    State(provider): State<Provider>,
    headers: HeaderMap,
    body: String,
) -> (StatusCode, Json<Value>) {
    let form = Url::parse(&format!("http://form/?{body}")).unwrap();
    let form: HashMap<String, String> = form.query_pairs().into_owned().collect();
    let mut inner = provider.inner();
    inner.codes_brought += 1;
    let refused = |error: &str| (StatusCode::BAD_REQUEST, Json(json!({"error": error})));
    let basic = headers["authorization"].to_str().unwrap();
    let basic = STANDARD.decode(basic.strip_prefix("Basic ").unwrap());
    // A form's encoding of the name and of the secret (RFC 6749, section 2.3.1).
    let expected = format!("{CLIENT}:s3cret%2F%2B+of%3A+greybox");
    if basic.unwrap() != expected.as_bytes() {
        return refused("invalid_client");
    }
    // A code counts once.
    let Some(grant) = inner.codes.remove(&form["code"]) else {
        return refused("invalid_grant");
    };
    let challenge = URL_SAFE_NO_PAD.encode(Sha256::digest(&form["code_verifier"]));
    if form["grant_type"] != "authorization_code" || challenge != grant.challenge {
        return refused("invalid_grant");
    }
    let id_token = (inner.forged)(inner.key.token(&grant.claims));
    let tokens = json!({"id_token": id_token, "access_token": "a-1", "token_type": "Bearer"});
    (StatusCode::OK, Json(tokens))
}

async fn user_info(State(provider): State<Provider>, headers: HeaderMap) -> Json<Value> {
    assert_eq!(headers["authorization"], "Bearer a-1");
    Json(provider.inner().info.clone())
}
