//! Signatures of deliveries, as Standard Webhooks 1.0 says: HMAC-SHA256 of identifier, time and body,
//! joined by dots, so that a receiver knows who sent it and that it is no old one sent again.

use std::fmt;
use std::str::FromStr;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use crate::access::random_bytes;

/// What a secret begins with.
const PREFIX: &str = "whsec_";
/// What a signature of this kind begins with.
const VERSION: &str = "v1,";

/// What both ends know. Neither logs nor errors show it.
pub struct SigningSecret(Vec<u8>);

impl SigningSecret {
    /// A new one, of 32 random bytes.
    ///
    /// # Errors
    /// The system gives no random bytes.
    pub fn new() -> Result<Self, getrandom::Error> {
        Ok(Self(random_bytes()?.to_vec()))
    }

    /// The text that the receiver is told, once.
    #[must_use]
    pub fn expose(&self) -> String {
        format!("{PREFIX}{}", STANDARD.encode(&self.0))
    }

    /// The signature of a body that is sent at a time `[s since 1970]`.
    pub(super) fn sign(&self, id: &str, at: i64, body: &str) -> String {
        let mut mac = Hmac::<Sha256>::new_from_slice(&self.0).expect("a key may have any length");
        mac.update(format!("{id}.{at}.{body}").as_bytes());
        format!("{VERSION}{}", STANDARD.encode(mac.finalize().into_bytes()))
    }
}

impl FromStr for SigningSecret {
    type Err = base64::DecodeError;

    fn from_str(text: &str) -> Result<Self, base64::DecodeError> {
        let text = text.strip_prefix(PREFIX).unwrap_or(text);
        STANDARD.decode(text).map(Self)
    }
}

impl fmt::Debug for SigningSecret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SigningSecret(…)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_signature_is_that_of_the_specification() {
        // The example of the reference implementations.
        let secret: SigningSecret = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"
            .parse()
            .expect("one");
        let id = "msg_p5jXN8AQM9LWM0D4loKWxJek";
        let body = r#"{"test": 2432232314}"#;
        let signature = secret.sign(id, 1_614_265_330, body);
        assert_eq!(signature, "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
    }

    #[test]
    fn a_secret_reads_back() {
        let secret = SigningSecret::new().expect("random bytes");
        let read: SigningSecret = secret.expose().parse().expect("its form");
        assert_eq!(read.0, secret.0);
        assert_eq!(format!("{secret:?}"), "SigningSecret(…)");
    }
}
