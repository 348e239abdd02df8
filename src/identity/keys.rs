//! The keys of the provider (RFC 7517), and whether one of them signed a text (RFC 7518).

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use ring::signature::{
    self, EcdsaVerificationAlgorithm, RsaParameters, RsaPublicKeyComponents, UnparsedPublicKey,
};
use serde::Deserialize;

/// How a text is signed. The provider's signatures are those of public keys: a text "signed" by nobody (`none`), or
/// by a secret that both know (`HS256`), proves nothing here.
#[derive(Clone, Copy)]
pub(super) enum Algorithm {
    Rsa(&'static RsaParameters),
    /// With the name of the curve.
    Ecdsa(&'static str, &'static EcdsaVerificationAlgorithm),
    Ed25519,
}

impl Algorithm {
    /// The algorithm of a name in RFC 7518 or RFC 8037.
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name {
            "RS256" => Self::Rsa(&signature::RSA_PKCS1_2048_8192_SHA256),
            "RS384" => Self::Rsa(&signature::RSA_PKCS1_2048_8192_SHA384),
            "RS512" => Self::Rsa(&signature::RSA_PKCS1_2048_8192_SHA512),
            "PS256" => Self::Rsa(&signature::RSA_PSS_2048_8192_SHA256),
            "PS384" => Self::Rsa(&signature::RSA_PSS_2048_8192_SHA384),
            "PS512" => Self::Rsa(&signature::RSA_PSS_2048_8192_SHA512),
            "ES256" => Self::Ecdsa("P-256", &signature::ECDSA_P256_SHA256_FIXED),
            "ES384" => Self::Ecdsa("P-384", &signature::ECDSA_P384_SHA384_FIXED),
            "EdDSA" => Self::Ed25519,
            _ => return None,
        })
    }
}

/// A public key, as the provider publishes it. What a field holds depends on the type of the key.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct PublicKey {
    kty: String,
    kid: Option<String>,
    #[serde(rename = "use")]
    purpose: Option<String>,
    alg: Option<String>,
    crv: Option<String>,
    n: Option<String>,
    e: Option<String>,
    x: Option<String>,
    y: Option<String>,
}

/// The public keys of the provider.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct PublicKeys {
    keys: Vec<PublicKey>,
}

impl PublicKeys {
    /// Whether one of the keys signed a text. Where the signature names a key, a key of another name does not count.
    pub(super) fn have_signed(&self, signed: &Signed<'_>) -> bool {
        let is_meant = |key: &&PublicKey| match signed.key_id {
            Some(id) => key.kid.as_deref().is_none_or(|name| name == id),
            None => true,
        };
        let mut meant = self.keys.iter().filter(is_meant);
        meant.any(|key| key.has_signed(signed))
    }
}

/// A text with a signature.
pub(super) struct Signed<'a> {
    /// The name of the algorithm.
    pub(super) algorithm: &'a str,
    /// The name of the key.
    pub(super) key_id: Option<&'a str>,
    pub(super) text: &'a [u8],
    pub(super) signature: &'a [u8],
}

impl PublicKey {
    fn has_signed(&self, signed: &Signed<'_>) -> bool {
        let is_for_this = self
            .purpose
            .as_deref()
            .is_none_or(|purpose| purpose == "sig")
            && self
                .alg
                .as_deref()
                .is_none_or(|name| name == signed.algorithm);
        is_for_this && self.verifies(signed) == Some(true)
    }

    /// Whether the key signed a text; nothing where the key is for no such signature.
    fn verifies(&self, signed: &Signed<'_>) -> Option<bool> {
        let part = |part: &Option<String>| URL_SAFE_NO_PAD.decode(part.as_ref()?).ok();
        let (text, signature) = (signed.text, signed.signature);
        let curve = self.crv.as_deref();
        Some(match (Algorithm::named(signed.algorithm)?, &*self.kty) {
            (Algorithm::Rsa(parameters), "RSA") => {
                let (n, e) = (part(&self.n)?, part(&self.e)?);
                let key = RsaPublicKeyComponents { n, e };
                key.verify(parameters, text, signature).is_ok()
            }
            (Algorithm::Ecdsa(name, algorithm), "EC") if curve == Some(name) => {
                // An uncompressed point (SEC 1, section 2.3.3).
                let point = [vec![4], part(&self.x)?, part(&self.y)?].concat();
                let key = UnparsedPublicKey::new(algorithm, point);
                key.verify(text, signature).is_ok()
            }
            (Algorithm::Ed25519, "OKP") if curve == Some("Ed25519") => {
                let key = UnparsedPublicKey::new(&signature::ED25519, part(&self.x)?);
                key.verify(text, signature).is_ok()
            }
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether a key of RFC 7515 signed an example of RFC 7515.
    fn have_signed(keys: &str, token: &str, algorithm: &str) -> bool {
        let keys: PublicKeys = serde_json::from_str(keys).expect("keys");
        let (text, signature) = token.rsplit_once('.').expect("three parts");
        let signature = URL_SAFE_NO_PAD.decode(signature).expect("base64");
        keys.have_signed(&Signed {
            algorithm,
            key_id: None,
            text: text.as_bytes(),
            signature: &signature,
        })
    }

    /// RFC 7515, appendix A.3.
    const P256: &str = r#"{"keys": [{"kty": "EC", "crv": "P-256",
        "x": "f83OJ3D2xF1Bg8vub9tLe1gHMzV76e8Tus9uPHvRVEU",
        "y": "x_FEzRu9m36HLN_tue659LNpXW6pCyStikYjKIWI5a0"}]}"#;
    const P256_TOKEN: &str = "eyJhbGciOiJFUzI1NiJ9.eyJpc3MiOiJqb2UiLA0KICJleHAiOjEzMDA4MTkzODAsDQogImh0dHA6Ly9leGFtcGxlLmNvbS9pc19yb290Ijp0cnVlfQ.DtEhU3ljbEg8L38VWAfUAqOyKAM6-Xx-F4GawxaepmXFCgfTjDxw5djxLa8ISlSApmWQxfKTUJqPP3-Kg6NU1Q";
    /// RFC 8037, appendix A.4.
    const ED25519: &str = r#"{"keys": [{"kty": "OKP", "crv": "Ed25519",
        "x": "11qYAYKxCrfVS_7TyWQHOg7hcvPapiMlrwIaaPcHURo"}]}"#;
    const ED25519_TOKEN: &str = "eyJhbGciOiJFZERTQSJ9.RXhhbXBsZSBvZiBFZDI1NTE5IHNpZ25pbmc.hgyY0il_MGCjP0JzlnLWG1PPOt7-09PGcvMg3AIbQR6dWbhijcNR4ki4iylGjg5BhVsPt9g7sVvpAr_MuM0KAg";

    #[test]
    fn the_examples_of_the_standards_are_verified_and_changed_ones_are_not() {
        for (keys, token, algorithm) in [
            (P256, P256_TOKEN, "ES256"),
            (ED25519, ED25519_TOKEN, "EdDSA"),
        ] {
            assert!(have_signed(keys, token, algorithm), "{algorithm}");
            let changed = token.replacen("ey", "ez", 1);
            assert!(!have_signed(keys, &changed, algorithm), "{algorithm}");
            for other in ["none", "HS256", "RS256", "ES384", ""] {
                assert!(!have_signed(keys, token, other), "{other}");
            }
            let for_encryption = keys.replace("\"crv\"", "\"use\": \"enc\", \"crv\"");
            assert!(!have_signed(&for_encryption, token, algorithm));
        }
    }

    #[test]
    fn a_key_of_another_name_does_not_count() {
        let named = P256.replace("\"crv\"", "\"kid\": \"old\", \"crv\"");
        let keys: PublicKeys = serde_json::from_str(&named).expect("keys");
        let (text, signature) = P256_TOKEN.rsplit_once('.').expect("three parts");
        let signature = URL_SAFE_NO_PAD.decode(signature).expect("base64");
        let mut signed = Signed {
            algorithm: "ES256",
            key_id: Some("old"),
            text: text.as_bytes(),
            signature: &signature,
        };
        assert!(keys.have_signed(&signed));
        signed.key_id = Some("new");
        assert!(!keys.have_signed(&signed));
    }
}
