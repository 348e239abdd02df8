//! The primitives of the format: the key of a file, what is derived from it, and chunks that are sealed.

use ring::aead::{Aad, CHACHA20_POLY1305, LessSafeKey, NONCE_LEN, Nonce, UnboundKey};
use ring::hkdf::{HKDF_SHA256, Prk, Salt};
use ring::hmac;

/// The bytes by which something sealed is longer than what it holds.
pub(super) const TAG_BYTES: usize = 16;
/// The bytes of the key of a file.
pub(super) const FILE_KEY_BYTES: usize = 16;

/// The key of one file.
pub(super) struct FileKey([u8; FILE_KEY_BYTES]);

impl FileKey {
    pub(super) fn random() -> Result<Self, getrandom::Error> {
        Ok(Self(random()?))
    }

    pub(super) fn of(bytes: [u8; FILE_KEY_BYTES]) -> Self {
        Self(bytes)
    }

    pub(super) fn bytes(&self) -> &[u8] {
        &self.0
    }

    /// The key under which the header is authenticated.
    pub(super) fn header_key(&self) -> hmac::Key {
        expand(&derive(&[], &self.0), &[b"header"], hmac::HMAC_SHA256).into()
    }

    /// The key of what comes after the header and a nonce.
    pub(super) fn payload_key(&self, nonce: &[u8]) -> SealingKey {
        SealingKey::expanded(&derive(nonce, &self.0), b"payload")
    }
}

/// A key that seals, each time under another nonce.
pub(super) struct SealingKey(LessSafeKey);

impl SealingKey {
    /// The key that a purpose has from a secret.
    pub(super) fn expanded(secret: &Prk, purpose: &'static [u8]) -> Self {
        let key: UnboundKey = expand(secret, &[purpose], &CHACHA20_POLY1305).into();
        Self(LessSafeKey::new(key))
    }

    /// Seals bytes, which grow by [`TAG_BYTES`].
    pub(super) fn seal(&self, nonce: [u8; NONCE_LEN], bytes: &mut Vec<u8>) {
        let nonce = Nonce::assume_unique_for_key(nonce);
        let sealed = self.0.seal_in_place_append_tag(nonce, Aad::empty(), bytes);
        sealed.expect("a chunk is shorter than 256 GiB");
    }

    /// Opens sealed bytes, which shrink by [`TAG_BYTES`]; nothing where they are not what was sealed.
    pub(super) fn open(&self, nonce: [u8; NONCE_LEN], bytes: &mut Vec<u8>) -> Option<()> {
        let nonce = Nonce::assume_unique_for_key(nonce);
        let length = self.0.open_in_place(nonce, Aad::empty(), bytes).ok()?.len();
        bytes.truncate(length);
        Some(())
    }
}

/// What keys are expanded from: the secret, mixed with a salt.
pub(super) fn derive(salt: &[u8], secret: &[u8]) -> Prk {
    Salt::new(HKDF_SHA256, salt).extract(secret)
}

fn expand<'a, L: ring::hkdf::KeyType>(
    secret: &'a Prk,
    purpose: &'a [&'a [u8]],
    kind: L,
) -> ring::hkdf::Okm<'a, L> {
    let expanded = secret.expand(purpose, kind);
    expanded.expect("a key is shorter than 255 digests")
}

/// Random bytes of the system.
pub(super) fn random<const N: usize>() -> Result<[u8; N], getrandom::Error> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes)?;
    Ok(bytes)
}
