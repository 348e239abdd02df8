//! Why a file is not written or not opened.

use std::io;

/// Why a file is not written or not opened.
#[derive(Debug, thiserror::Error)]
pub enum EncryptedFileError {
    /// The file is no encrypted one.
    #[error("it is no file of age-encryption.org/v1")]
    NotEncrypted,
    /// There is no key.
    #[error("it is encrypted: the key of one of its recipients is needed")]
    KeyNeeded,
    /// None of the keys is a recipient's.
    #[error("it is encrypted for none of these keys")]
    NoKey,
    /// The file is not what was written.
    #[error("it is damaged: {0}")]
    Damaged(&'static str),
    /// The file cannot be read or written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The system gives no random numbers.
    #[error("the system gives no random numbers: {0}")]
    Random(#[from] getrandom::Error),
}
