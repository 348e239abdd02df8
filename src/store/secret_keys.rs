//! Keys under which secrets stand in the database, so that whoever has a copy of it alone can act for nobody.
//!
//! Each secret is encrypted with AES-256-GCM under a nonce of its own, and bound to its place: copied into another
//! row it does not open.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use ring::aead::{AES_256_GCM, Aad, LessSafeKey, NONCE_LEN, Nonce, UnboundKey};
use sha2::{Digest, Sha256};

use super::{StoreError, corrupt};
use crate::access::random_bytes;

/// What an encrypted text begins with; no secret and no address does.
const PREFIX: &str = "encrypted:1:";
/// The hexadecimal digits that name a key.
const ID_DIGITS: usize = 16;

/// A file that holds no keys.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the file {} with the keys for secrets: {why}", path.display())]
pub struct InvalidSecretKeys {
    path: PathBuf,
    why: String,
}

/// The keys of a server: the first encrypts, every one decrypts. Without keys secrets are stored as they are.
#[derive(Clone, Default)]
pub struct SecretKeys(Arc<Vec<SecretKey>>);

struct SecretKey {
    /// What names the key beside what it encrypted: a part of its digest.
    id: String,
    key: LessSafeKey,
}

impl fmt::Debug for SecretKeys {
    /// Without the keys.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ids = self.0.iter().map(|key| &key.id);
        formatter.debug_list().entries(ids).finish()
    }
}

impl SecretKeys {
    /// The keys of a file, one on each line, 64 hexadecimal digits each. Empty lines and what comes after `#` count
    /// for nothing.
    ///
    /// # Errors
    /// The file cannot be read, is open to everybody, or holds something else.
    pub fn of_file(path: &Path) -> Result<Self, InvalidSecretKeys> {
        let invalid = |why: String| InvalidSecretKeys {
            path: path.to_owned(),
            why,
        };
        let text = std::fs::read_to_string(path).map_err(|error| invalid(error.to_string()))?;
        if is_open_to_all(path).map_err(|error| invalid(error.to_string()))? {
            let why = "everybody on this machine can read it; `chmod o= FILE` mends that";
            return Err(invalid(why.to_owned()));
        }
        let mut keys = Vec::new();
        for (index, line) in text.lines().enumerate() {
            let digits = line.split('#').next().unwrap_or_default().trim();
            if !digits.is_empty() {
                let key = SecretKey::of_digits(digits);
                let why = || format!("line {} is no key of 64 hexadecimal digits", index + 1);
                keys.push(key.ok_or_else(|| invalid(why()))?);
            }
        }
        match keys.is_empty() {
            true => Err(invalid("it holds no key".to_owned())),
            false => Ok(Self(Arc::new(keys))),
        }
    }

    /// A secret as it is stored at a place.
    pub(super) fn encrypt(&self, place: &str, secret: &str) -> Result<String, StoreError> {
        let Some(SecretKey { id, key }) = self.0.first() else {
            return Ok(secret.to_owned());
        };
        let random = random_bytes().map_err(|error| StoreError::Scratch(error.into()))?;
        let mut nonce = [0; NONCE_LEN];
        nonce.copy_from_slice(&random[..NONCE_LEN]);
        let mut sealed = secret.as_bytes().to_vec();
        let aad = Aad::from(place.as_bytes());
        key.seal_in_place_append_tag(Nonce::assume_unique_for_key(nonce), aad, &mut sealed)
            .expect("a secret is shorter than 64 GiB");
        let text = STANDARD_NO_PAD.encode([&nonce[..], &sealed].concat());
        Ok(format!("{PREFIX}{id}:{text}"))
    }

    /// The secret that is stored at a place.
    ///
    /// # Errors
    /// No key is the one that encrypted the secret, or the text is not what was written there.
    pub(super) fn decrypt(&self, place: &str, stored: &str) -> Result<String, StoreError> {
        let Some(rest) = stored.strip_prefix(PREFIX) else {
            return Ok(stored.to_owned());
        };
        let damaged = || corrupt("secret", place, "it is not what was written there");
        let (id, text) = rest.split_once(':').ok_or_else(damaged)?;
        let key = self.0.iter().find(|key| key.id == id);
        let key = key.ok_or_else(|| StoreError::SecretKey { id: id.to_owned() })?;
        let bytes = STANDARD_NO_PAD.decode(text).map_err(|_| damaged())?;
        let (nonce, sealed) = bytes.split_at_checked(NONCE_LEN).ok_or_else(damaged)?;
        let nonce = Nonce::try_assume_unique_for_key(nonce).map_err(|_| damaged())?;
        let mut sealed = sealed.to_vec();
        let opened = key
            .key
            .open_in_place(nonce, Aad::from(place.as_bytes()), &mut sealed);
        let opened = opened.map_err(|_| damaged())?;
        String::from_utf8(opened.to_vec()).map_err(|_| damaged())
    }

    /// Whether a stored text is as these keys would store it: encrypted with the first, or as it is where there is
    /// none.
    pub(super) fn is_current(&self, stored: &str) -> bool {
        match (self.0.first(), stored.strip_prefix(PREFIX)) {
            (Some(key), Some(rest)) => rest.split(':').next() == Some(&*key.id),
            (None, None) => true,
            _ => false,
        }
    }
}

impl SecretKey {
    fn of_digits(digits: &str) -> Option<Self> {
        let bytes: [u8; 32] = hex::decode(digits).ok()?.try_into().ok()?;
        let id = hex::encode(Sha256::digest(bytes));
        let key = UnboundKey::new(&AES_256_GCM, &bytes).ok()?;
        Some(Self {
            id: id[..ID_DIGITS].to_owned(),
            key: LessSafeKey::new(key),
        })
    }
}

#[cfg(unix)]
fn is_open_to_all(path: &Path) -> io::Result<bool> {
    use std::os::unix::fs::PermissionsExt as _;
    Ok(std::fs::metadata(path)?.permissions().mode() & 0o007 != 0)
}

#[cfg(not(unix))]
fn is_open_to_all(_path: &Path) -> io::Result<bool> {
    Ok(false)
}

#[cfg(test)]
pub(super) mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    /// The keys of a file with some lines.
    pub(in crate::store) fn keys(lines: &str, mode: u32) -> Result<SecretKeys, InvalidSecretKeys> {
        let file = tempfile::NamedTempFile::new().expect("a file");
        fs::write(file.path(), lines).expect("a file");
        fs::set_permissions(file.path(), Permissions::from_mode(mode)).expect("permissions");
        SecretKeys::of_file(file.path())
    }

    fn key(digit: &str) -> String {
        digit.repeat(64)
    }

    #[test]
    fn a_secret_is_read_with_its_key_at_its_place_and_nowhere_else() {
        let first = keys(&key("a"), 0o600).expect("a key");
        let stored = first.encrypt("webhook 1", "whsec_x").expect("a text");
        assert!(!stored.contains("whsec_x") && first.is_current(&stored));
        assert_ne!(
            stored,
            first.encrypt("webhook 1", "whsec_x").expect("a text")
        );
        let read = |keys: &SecretKeys, place: &str| keys.decrypt(place, &stored);
        assert_eq!(read(&first, "webhook 1").expect("a secret"), "whsec_x");
        assert!(matches!(
            read(&first, "webhook 2"),
            Err(StoreError::Corrupt { .. })
        ));

        // The key that encrypts is changed: the old one stands after the new one.
        let both = keys(&format!("{} # of 2026\n\n{}\n", key("b"), key("a")), 0o640);
        let both = both.expect("keys");
        assert_eq!(read(&both, "webhook 1").expect("a secret"), "whsec_x");
        assert!(!both.is_current(&stored));
        let new = both.encrypt("webhook 1", "whsec_x").expect("a text");
        let refused = first.decrypt("webhook 1", &new);
        assert!(matches!(refused, Err(StoreError::SecretKey { .. })));
        let without = read(&SecretKeys::default(), "webhook 1");
        assert!(matches!(without, Err(StoreError::SecretKey { .. })));

        let (named, _) = stored.rsplit_once(':').expect("the name of the key");
        for changed in [format!("{stored}A"), format!("{named}:"), named.to_owned()] {
            let refused = first.decrypt("webhook 1", &changed);
            assert!(
                matches!(refused, Err(StoreError::Corrupt { .. })),
                "{changed}"
            );
        }
    }

    #[test]
    fn what_is_stored_without_keys_is_as_it_is() {
        let none = SecretKeys::default();
        assert_eq!(none.encrypt("x", "whsec_x").expect("a text"), "whsec_x");
        assert!(none.is_current("whsec_x"));
        let keys = keys(&key("a"), 0o600).expect("a key");
        assert_eq!(keys.decrypt("x", "whsec_x").expect("a secret"), "whsec_x");
        assert!(!keys.is_current("whsec_x"));
    }

    #[test]
    fn a_file_that_holds_no_keys_is_named_and_its_text_is_not() {
        for (lines, mode, why) in [
            ("", 0o600, "no key"),
            ("# nothing\n", 0o600, "no key"),
            ("s3cret", 0o600, "line 1"),
            (&*format!("{}\nabc", key("a")), 0o600, "line 2"),
            (&*key("a"), 0o604, "everybody"),
        ] {
            let refused = keys(lines, mode).expect_err("no keys").to_string();
            assert!(
                refused.contains(why) && !refused.contains("s3cret"),
                "{refused}"
            );
        }
        assert!(!format!("{:?}", keys(&key("a"), 0o600)).contains(&key("a")));
    }
}
