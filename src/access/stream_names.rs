//! The streams that a token with the scope `append` is for.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// The characters of a stream's name at the most.
const MAX_CHARS: usize = 100;
/// Streams that one token names at the most.
const MAX_NAMES: usize = 200;

/// Whether a text is the name of a stream: letters, digits, `.`, `_` and `-`.
#[must_use]
pub fn is_stream_name(text: &str) -> bool {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"._-".contains(&byte);
    (1..=MAX_CHARS).contains(&text.len()) && text.bytes().all(is_plain)
}

/// Names of streams, one at the least. Cheap to clone.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct StreamNames(Arc<[String]>);

/// A text that does not name streams.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidStreamNames {
    /// One of the names is none.
    #[error(
        "`{0}` is no stream's name: letters, digits, `.`, `_` and `-`, {MAX_CHARS} of them at the most"
    )]
    Name(String),
    /// No stream or too many streams are named.
    #[error("{0} streams are named; a token is for 1 to {MAX_NAMES} of them")]
    Count(usize),
}

impl StreamNames {
    /// Whether a stream is among them.
    #[must_use]
    pub fn contain(&self, stream: &str) -> bool {
        self.0.iter().any(|name| name == stream)
    }
}

impl TryFrom<Vec<String>> for StreamNames {
    type Error = InvalidStreamNames;

    fn try_from(names: Vec<String>) -> Result<Self, InvalidStreamNames> {
        if let Some(name) = names.iter().find(|name| !is_stream_name(name)) {
            let shown = name.chars().take(2 * MAX_CHARS).collect();
            return Err(InvalidStreamNames::Name(shown));
        }
        if !(1..=MAX_NAMES).contains(&names.len()) {
            return Err(InvalidStreamNames::Count(names.len()));
        }
        Ok(Self(names.into()))
    }
}

impl From<StreamNames> for Vec<String> {
    fn from(names: StreamNames) -> Self {
        names.0.to_vec()
    }
}

impl FromStr for StreamNames {
    type Err = InvalidStreamNames;

    /// `rig-4,rig-5`.
    fn from_str(text: &str) -> Result<Self, InvalidStreamNames> {
        let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
        names.try_into()
    }
}

impl fmt::Display for StreamNames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.join(","))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_are_named_with_commas_between_them() {
        let names: StreamNames = "rig-4, rig-5".parse().expect("two names");
        assert!(names.contain("rig-5") && !names.contain("rig-6"));
        assert_eq!(names.to_string(), "rig-4,rig-5");
        for text in ["", "rig-4,", "a b", "a/b", "ä"] {
            assert!(text.parse::<StreamNames>().is_err(), "{text}");
        }
    }
}
