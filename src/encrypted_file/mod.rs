//! Files that only the holders of some keys can read, in the format of
//! [age-encryption.org/v1](https://age-encryption.org/v1): `age` and other programs read and write the same files.
//!
//! A file is encrypted for *recipients*, whose keys everybody may know, and opened with one of their *identities*. Each
//! file has a key of its own, which its header holds once for each recipient (X25519, HKDF-SHA-256,
//! ChaCha20-Poly1305); the rest is in chunks of 64 KiB, each sealed by itself, so that a file of any length is read and
//! written as it comes. A file that was changed, shortened or put together from others does not open.

mod error;
mod header;
mod keys;
mod payload;
mod seal;

use std::io::{self, BufRead, Read, Write};

pub use error::EncryptedFileError;
pub use keys::{Identities, InvalidKeys, Recipients};

use header::FileHeader;
use seal::FileKey;

/// Whether a file begins as an encrypted one does.
///
/// # Errors
/// The file cannot be read.
pub fn is_encrypted(source: &mut impl BufRead) -> io::Result<bool> {
    Ok(source.fill_buf()?.starts_with(header::VERSION.as_bytes()))
}

/// Encrypts all of a source.
///
/// # Errors
/// The source cannot be read, or the file cannot be written.
pub fn encrypt(
    recipients: &Recipients,
    source: &mut impl Read,
    into: &mut impl Write,
) -> Result<(), EncryptedFileError> {
    let file_key = FileKey::random()?;
    FileHeader::new(&file_key, recipients)?.write(into)?;
    payload::encrypt(&file_key, source, into)
}

/// Writes what an encrypted file holds. What was written before an error is no whole content.
///
/// # Errors
/// The file is no encrypted one, is damaged, or opens with none of the keys.
pub fn decrypt(
    identities: &Identities,
    source: &mut impl BufRead,
    into: &mut impl Write,
) -> Result<(), EncryptedFileError> {
    let header = FileHeader::read(source)?;
    let file_key = header.file_key(identities)?;
    payload::decrypt(&file_key, source, into)
}

#[cfg(test)]
mod tests;
