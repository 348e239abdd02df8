//! Keys as files and people write them: `age1…` of a recipient, `AGE-SECRET-KEY-1…` of an identity.

use std::fmt;
use std::path::{Path, PathBuf};

use bech32::primitives::decode::CheckedHrpstring;
use bech32::{Bech32, Hrp};
use x25519_dalek::{PublicKey, StaticSecret};

/// The bytes of a key of X25519.
pub(super) const KEY_BYTES: usize = 32;
/// What the key of a recipient begins with.
const RECIPIENT: Hrp = Hrp::parse_unchecked("age");
/// What an identity begins with.
const IDENTITY: Hrp = Hrp::parse_unchecked("age-secret-key-");

/// Keys that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidKeys {
    /// A text is no key of a recipient.
    #[error(
        "`{0}` is no key of a recipient, such as `age-keygen` shows: age1 and 58 letters and digits"
    )]
    Recipient(String),
    /// A file holds none, or something else. The text of an identity is not repeated.
    #[error("{}: {why}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
}

/// For whom a file is encrypted, at least one.
#[derive(Clone, Debug)]
pub struct Recipients(pub(super) Vec<PublicKey>);

impl Recipients {
    /// The recipients of texts and of the lines of files; nothing where there is none.
    ///
    /// # Errors
    /// A text is no key, or a file cannot be read or holds none.
    pub fn read(texts: &[String], files: &[PathBuf]) -> Result<Option<Self>, InvalidKeys> {
        let invalid = |text: &String| InvalidKeys::Recipient(text.clone());
        let keys = texts
            .iter()
            .map(|text| recipient(text).ok_or_else(|| invalid(text)));
        let mut keys = keys.collect::<Result<Vec<_>, _>>()?;
        for file in files {
            keys.extend(lines(file, recipient, "age1…")?);
        }
        Ok((!keys.is_empty()).then_some(Self(keys)))
    }
}

/// The keys with which files are opened, at least one.
pub struct Identities(pub(super) Vec<StaticSecret>);

impl fmt::Debug for Identities {
    /// Without the keys.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} identities", self.0.len())
    }
}

impl Identities {
    /// The identities of the lines of a file, as `age-keygen` writes it.
    ///
    /// # Errors
    /// The file cannot be read or holds none.
    pub fn of_file(path: &Path) -> Result<Self, InvalidKeys> {
        lines(path, identity, "AGE-SECRET-KEY-1…").map(Self)
    }
}

/// The keys of the lines of a file, at least one. Empty lines and lines that begin with `#` count for nothing.
fn lines<K>(path: &Path, read: fn(&str) -> Option<K>, form: &str) -> Result<Vec<K>, InvalidKeys> {
    let invalid = |why: String| InvalidKeys::File {
        path: path.to_owned(),
        why,
    };
    let text = std::fs::read_to_string(path).map_err(|error| invalid(error.to_string()))?;
    let mut keys = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if !line.is_empty() && !line.starts_with('#') {
            let why = || format!("line {} is no key of the form {form}", index + 1);
            keys.push(read(line).ok_or_else(|| invalid(why()))?);
        }
    }
    match keys.is_empty() {
        true => Err(invalid(format!("it holds no key of the form {form}"))),
        false => Ok(keys),
    }
}

fn recipient(text: &str) -> Option<PublicKey> {
    key(text, RECIPIENT).map(PublicKey::from)
}

fn identity(text: &str) -> Option<StaticSecret> {
    key(text, IDENTITY).map(StaticSecret::from)
}

/// The bytes of a key in Bech32 (BIP 173).
fn key(text: &str, kind: Hrp) -> Option<[u8; KEY_BYTES]> {
    let checked = CheckedHrpstring::new::<Bech32>(text).ok()?;
    let bytes: Vec<u8> = checked.byte_iter().collect();
    (checked.hrp() == kind).then(|| bytes.try_into().ok())?
}
