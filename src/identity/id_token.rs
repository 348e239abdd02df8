//! ID tokens (OpenID Connect Core 1.0, section 2): JSON Web Tokens in their compact form, and when an ID token is
//! believed (section 3.1.3.7).

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use serde::Deserialize;

use super::claims::Claims;
use super::keys::{PublicKeys, Signed};

/// How far the clocks of the provider and of this server may be apart `[s]`.
const CLOCKS_APART_S: i64 = 60;

/// Why an ID token is not believed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IdTokenError {
    /// The text is no token.
    #[error("it is no JSON Web Token: {0}")]
    Form(&'static str),
    /// No key of the provider signed the token, or in no way that proves anything.
    #[error("none of the provider's keys has signed it (`alg` is {0:?})")]
    Signature(String),
    /// The token is not from this provider, or not for this server or this attempt.
    #[error("its `{0}` is another one")]
    Other(&'static str),
    /// The token has expired.
    #[error(
        "it has expired, or the clocks of the two servers are more than {CLOCKS_APART_S} s apart"
    )]
    Expired,
}

/// The claims that a token has to have.
#[derive(Clone, Copy)]
pub(super) struct Expected<'a> {
    pub(super) issuer: &'a str,
    pub(super) client_id: &'a str,
    pub(super) nonce: &'a str,
    /// The time of this server `[s since 1970]`.
    pub(super) now: i64,
}

#[derive(Deserialize)]
struct TokenHeader {
    alg: String,
    kid: Option<String>,
    /// Extensions that whoever reads the token has to understand; none are understood.
    crit: Option<Vec<String>>,
}

/// A token whose parts are read and whose signature is not looked at yet.
pub(super) struct IdToken<'a> {
    signed: &'a str,
    signature: Vec<u8>,
    header: TokenHeader,
    claims: Claims,
}

impl<'a> IdToken<'a> {
    /// Reads the three parts of a token.
    pub(super) fn read(text: &'a str) -> Result<Self, IdTokenError> {
        let three = IdTokenError::Form("it has three parts");
        let (signed, signature) = text.rsplit_once('.').ok_or_else(|| three.clone())?;
        let (header, claims) = signed.split_once('.').ok_or(three)?;
        let decode = |part: &str| {
            let bytes = URL_SAFE_NO_PAD.decode(part);
            bytes.map_err(|_| IdTokenError::Form("a part is no base64url"))
        };
        let header: TokenHeader = serde_json::from_slice(&decode(header)?)
            .map_err(|_| IdTokenError::Form("its header is none"))?;
        if header.crit.is_some() {
            return Err(IdTokenError::Form("it has extensions that are not known"));
        }
        let claims = Claims::read(&decode(claims)?);
        Ok(Self {
            signed,
            signature: decode(signature)?,
            header,
            claims: claims.ok_or(IdTokenError::Form("its claims are no object"))?,
        })
    }

    /// Whether one of the keys has signed the token.
    pub(super) fn is_signed_by(&self, keys: &PublicKeys) -> bool {
        keys.have_signed(&Signed {
            algorithm: &self.header.alg,
            key_id: self.header.kid.as_deref(),
            text: self.signed.as_bytes(),
            signature: &self.signature,
        })
    }

    /// The claims of a token that one of the keys has signed and that is what was expected.
    pub(super) fn believed(
        self,
        keys: &PublicKeys,
        expected: Expected<'_>,
    ) -> Result<Claims, IdTokenError> {
        if !self.is_signed_by(keys) {
            return Err(IdTokenError::Signature(self.header.alg));
        }
        let claims = self.claims;
        if claims.text("iss") != Some(expected.issuer) {
            return Err(IdTokenError::Other("iss"));
        }
        let audiences = claims.texts("aud");
        if !audiences.contains(&expected.client_id) {
            return Err(IdTokenError::Other("aud"));
        }
        let is_for_this = match claims.text("azp") {
            Some(party) => party == expected.client_id,
            None => audiences.len() == 1,
        };
        if !is_for_this {
            return Err(IdTokenError::Other("azp"));
        }
        if claims.text("nonce") != Some(expected.nonce) {
            return Err(IdTokenError::Other("nonce"));
        }
        let ends = claims.seconds("exp").ok_or(IdTokenError::Expired)?;
        let begins = claims.seconds("nbf").unwrap_or(i64::MIN);
        let is_over = ends.saturating_add(CLOCKS_APART_S) <= expected.now;
        if is_over || begins.saturating_sub(CLOCKS_APART_S) > expected.now {
            return Err(IdTokenError::Expired);
        }
        Ok(claims)
    }
}

#[cfg(test)]
mod tests {
    use ring::rand::SystemRandom;
    use ring::signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair, KeyPair};
    use serde_json::{Value, json};

    use super::*;

    const NOW: i64 = 1_795_000_000;

    /// A provider with one key.
    struct Signer {
        pair: EcdsaKeyPair,
        keys: PublicKeys,
    }

    impl Signer {
        fn new() -> Self {
            let random = SystemRandom::new();
            let algorithm = &ECDSA_P256_SHA256_FIXED_SIGNING;
            let document = EcdsaKeyPair::generate_pkcs8(algorithm, &random).expect("a key");
            let pair = EcdsaKeyPair::from_pkcs8(algorithm, document.as_ref(), &random);
            let pair = pair.expect("a key");
            let point = pair.public_key().as_ref();
            let coordinate = |bytes: &[u8]| URL_SAFE_NO_PAD.encode(bytes);
            let keys = json!({"keys": [{"kty": "EC", "crv": "P-256",
                "x": coordinate(&point[1..33]), "y": coordinate(&point[33..])}]});
            let keys = serde_json::from_value(keys).expect("keys");
            Self { pair, keys }
        }

        fn token(&self, header: &Value, claims: &Value) -> String {
            let encode = |part: &Value| URL_SAFE_NO_PAD.encode(part.to_string());
            let signed = format!("{}.{}", encode(header), encode(claims));
            let signature = self.pair.sign(&SystemRandom::new(), signed.as_bytes());
            let signature = URL_SAFE_NO_PAD.encode(signature.expect("a signature"));
            format!("{signed}.{signature}")
        }

        fn believed(&self, token: &str) -> Result<Claims, IdTokenError> {
            let expected = Expected {
                issuer: "https://login.plant.example",
                client_id: "greybox",
                nonce: "n-1",
                now: NOW,
            };
            IdToken::read(token)?.believed(&self.keys, expected)
        }
    }

    fn claims_with(name: &str, value: Value) -> Value {
        let mut claims = json!({"iss": "https://login.plant.example", "sub": "7", "aud": "greybox",
            "nonce": "n-1", "exp": NOW + 300, "iat": NOW});
        match value {
            Value::Null => drop(claims.as_object_mut().expect("an object").remove(name)),
            value => claims[name] = value,
        }
        claims
    }

    #[test]
    fn a_token_is_believed_where_all_of_it_is_as_expected() {
        let signer = Signer::new();
        let header = json!({"alg": "ES256"});
        let outcome = |name: &str, value: Value| {
            let token = signer.token(&header, &claims_with(name, value));
            signer.believed(&token).map(|_claims| ())
        };
        assert_eq!(outcome("sub", json!("7")), Ok(()));
        assert_eq!(outcome("aud", json!(["greybox"])), Ok(()));
        // Clocks differ by less than a minute.
        assert_eq!(outcome("exp", json!(NOW - 59)), Ok(()));
        assert_eq!(outcome("nbf", json!(NOW + 59)), Ok(()));
        for (name, value, expected) in [
            (
                "iss",
                json!("https://login.plant.example/"),
                IdTokenError::Other("iss"),
            ),
            ("iss", Value::Null, IdTokenError::Other("iss")),
            ("aud", json!("another"), IdTokenError::Other("aud")),
            (
                "aud",
                json!(["greybox", "another"]),
                IdTokenError::Other("azp"),
            ),
            ("azp", json!("another"), IdTokenError::Other("azp")),
            ("nonce", json!("n-2"), IdTokenError::Other("nonce")),
            ("nonce", Value::Null, IdTokenError::Other("nonce")),
            ("exp", json!(NOW - 60), IdTokenError::Expired),
            ("exp", json!("tomorrow"), IdTokenError::Expired),
            ("exp", Value::Null, IdTokenError::Expired),
            ("nbf", json!(NOW + 61), IdTokenError::Expired),
        ] {
            assert_eq!(
                outcome(name, value.clone()),
                Err(expected),
                "{name}: {value}"
            );
        }
    }

    #[test]
    fn a_token_that_no_key_has_signed_is_not_believed() {
        let (signer, stranger) = (Signer::new(), Signer::new());
        let claims = claims_with("sub", json!("7"));
        let good = signer.token(&json!({"alg": "ES256"}), &claims);
        let (signed, _) = good.rsplit_once('.').expect("three parts");
        let unsigned = |alg: &str| IdTokenError::Signature(alg.to_owned());
        let none = signer.token(&json!({"alg": "none"}), &claims);
        let (nobody, _) = none.rsplit_once('.').expect("three parts");
        for (token, expected) in [
            (
                stranger.token(&json!({"alg": "ES256"}), &claims),
                unsigned("ES256"),
            ),
            (format!("{nobody}."), unsigned("none")),
            (none, unsigned("none")),
            (
                signer.token(&json!({"alg": "HS256"}), &claims),
                unsigned("HS256"),
            ),
            (format!("{signed}."), unsigned("ES256")),
            (signed.to_owned(), IdTokenError::Form("it has three parts")),
            (String::new(), IdTokenError::Form("it has three parts")),
            (
                signer.token(&json!({"alg": "ES256", "crit": ["b64"]}), &claims),
                IdTokenError::Form("it has extensions that are not known"),
            ),
        ] {
            let refused = signer.believed(&token).map(|_claims| ());
            assert_eq!(refused, Err(expected), "{token}");
        }
    }
}
