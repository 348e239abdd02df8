//! Projects: the name spaces that tokens are bound to.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// The characters of a name at the most.
const MAX_CHARS: usize = 40;

/// The name of a project: words of lower-case letters and digits with `-` or `_` between them. Cheap to
/// clone.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Project(Arc<str>);

/// A text that names no project.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "`{0}` is no project's name: words of lower-case letters and digits with `-` or `_` between \
     them, {MAX_CHARS} characters at the most"
)]
pub struct InvalidProject(String);

impl Project {
    /// The name.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl Default for Project {
    /// `default`: that of a server without accounts, and of all that an earlier version stored.
    fn default() -> Self {
        Self("default".into())
    }
}

impl FromStr for Project {
    type Err = InvalidProject;

    fn from_str(text: &str) -> Result<Self, InvalidProject> {
        let is_letter = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit();
        let mut words = text.split(['-', '_']);
        let is_word = |word: &str| !word.is_empty() && word.bytes().all(is_letter);
        if text.len() <= MAX_CHARS && words.all(is_word) {
            Ok(Self(text.into()))
        } else {
            Err(InvalidProject(text.chars().take(2 * MAX_CHARS).collect()))
        }
    }
}

impl TryFrom<String> for Project {
    type Error = InvalidProject;

    fn try_from(text: String) -> Result<Self, InvalidProject> {
        text.parse()
    }
}

impl From<Project> for String {
    fn from(project: Project) -> Self {
        project.as_str().to_owned()
    }
}

impl fmt::Display for Project {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_project_has_a_plain_name() {
        for name in ["default", "hall-2", "4", "a_b"] {
            assert_eq!(name.parse::<Project>().expect("a name").as_str(), name);
        }
        let long = "x".repeat(41);
        for text in ["", "-a", "a-", "a--b", "Hall", "a b", "a:b", "ä", &long] {
            assert!(text.parse::<Project>().is_err(), "{text}");
        }
    }
}
