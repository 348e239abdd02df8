//! The secret of a token, or of a session that one began: 256 random bits, shown once. What is kept is a digest of it; of so many
//! random bits a plain one is enough, for nobody can try them.

use std::fmt;
use std::str::FromStr;

use sha2::{Digest as _, Sha256};

/// What a secret begins with, so that it is known for what it is wherever it turns up.
const PREFIX: &str = "gbx_";
/// Random bytes.
const BYTES: usize = 32;

/// A secret. Neither logs nor errors show it.
#[derive(Clone)]
pub struct Secret(String);

/// SHA-256 of a secret, in hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Digest(String);

impl Secret {
    /// A new one, from the system's source of randomness.
    ///
    /// # Errors
    /// The system gives no random bytes.
    pub fn new() -> Result<Self, getrandom::Error> {
        Ok(Self(format!("{PREFIX}{}", hex::encode(random_bytes()?))))
    }

    /// The text that a client sends; to be shown once.
    #[must_use]
    pub fn expose(&self) -> &str {
        &self.0
    }

    /// What is kept of it.
    #[must_use]
    pub fn digest(&self) -> Digest {
        Digest(hex::encode(Sha256::digest(&self.0)))
    }

    /// What is kept of a session's secret: never the digest of a token's, so that neither stands for
    /// the other.
    #[must_use]
    pub fn session_digest(&self) -> Digest {
        Digest(hex::encode(Sha256::digest(format!("session {}", self.0))))
    }

    /// What a page of this server sends beside a session's cookie. Pages of other sites cannot know
    /// it: they see neither the cookie nor an answer.
    #[must_use]
    pub fn csrf_token(&self) -> String {
        hex::encode(Sha256::digest(format!("csrf {}", self.0)))
    }
}

impl FromStr for Secret {
    type Err = ();

    /// A text that has the form of a secret.
    fn from_str(text: &str) -> Result<Self, ()> {
        let digits = text.strip_prefix(PREFIX).ok_or(())?;
        let is_digit = |b: u8| b.is_ascii_digit() || (b'a'..=b'f').contains(&b);
        (digits.len() == 2 * BYTES && digits.bytes().all(is_digit))
            .then(|| Self(text.to_owned()))
            .ok_or(())
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(…)")
    }
}

impl Digest {
    /// The digits.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// Bytes from the system's source of randomness, which nobody can guess.
///
/// # Errors
/// The system gives none.
pub fn random_bytes() -> Result<[u8; BYTES], getrandom::Error> {
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_secret_is_new_each_time_and_reads_back() {
        let secret = Secret::new().expect("random bytes");
        let other = Secret::new().expect("random bytes");
        assert_ne!(secret.expose(), other.expose());
        let read: Secret = secret.expose().parse().expect("its form");
        assert_eq!(read.digest(), secret.digest());
        assert_ne!(read.session_digest(), secret.digest());
        assert_ne!(read.csrf_token(), read.session_digest().as_str());
        assert!(!format!("{secret:?}").contains(&secret.expose()[4..]));
        for text in [
            "",
            "gbx_",
            "gbx_00",
            &secret.expose()[4..],
            &secret.expose().to_uppercase(),
        ] {
            assert!(text.parse::<Secret>().is_err(), "{text}");
        }
    }
}
