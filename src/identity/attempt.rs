//! One attempt to sign in: a secret that binds the way to the provider and the way back to one browser.

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use sha2::{Digest as _, Sha256};

use crate::access::Secret;

/// An attempt to sign in. The browser keeps its secret in a cookie; everything that the provider is told follows
/// from the secret, and the secret from nothing that the provider is told.
pub struct SignInAttempt(Secret);

impl SignInAttempt {
    /// The attempt of a secret.
    #[must_use]
    pub fn new(secret: Secret) -> Self {
        Self(secret)
    }

    fn derived(&self, purpose: &str) -> String {
        let digest = Sha256::digest(format!("{purpose} {}", self.0.expose()));
        URL_SAFE_NO_PAD.encode(digest)
    }

    /// The `state` that comes back beside the code: whoever has another browser follow a code does not know the `state`.
    #[must_use]
    pub fn state(&self) -> String {
        self.derived("state")
    }

    /// The `nonce` that the ID token has to repeat, so that no token of another attempt is taken.
    #[must_use]
    pub fn nonce(&self) -> String {
        self.derived("nonce")
    }

    /// The code verifier of RFC 7636, without which nobody turns the code into a token.
    #[must_use]
    pub fn verifier(&self) -> String {
        self.derived("verifier")
    }

    /// The code challenge of RFC 7636, method `S256`.
    #[must_use]
    pub fn challenge(&self) -> String {
        challenge_of(&self.verifier())
    }
}

fn challenge_of(verifier: &str) -> String {
    URL_SAFE_NO_PAD.encode(Sha256::digest(verifier))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_challenge_is_that_of_the_example_in_rfc_7636() {
        assert_eq!(
            challenge_of("dBjftJeZ4CVP-mB92K27uhbUJU1p1r_wW1gFWFOEjXk"),
            "E9Melhoa2OwvFrEMTJguCHaoeK1t8URWbuGJSstw-cM"
        );
    }

    #[test]
    fn all_that_is_told_differs_and_differs_in_each_attempt() {
        let told = || {
            let attempt = SignInAttempt::new(Secret::new().expect("random bytes"));
            [
                attempt.state(),
                attempt.nonce(),
                attempt.verifier(),
                attempt.challenge(),
            ]
        };
        let mut all = [told(), told()].concat();
        // A verifier has 43 to 128 characters.
        assert!(all.iter().all(|text| text.len() == 43), "{all:?}");
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 8);
    }
}
