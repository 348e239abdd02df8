//! How much a caller may do in its project.

use std::fmt;
use std::str::FromStr;

/// How much. `submit` holds `append` and `read`, neither of which holds the other; `admin` holds all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scope {
    /// Append samples to streams, and nothing else.
    Append,
    /// Look at everything.
    Read,
    /// Store, submit, steer and delete.
    Submit,
    /// Say where events are delivered, and read who did what.
    Admin,
}

/// A text that names no scope.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no scope; there are append, read, submit and admin")]
pub struct InvalidScope(String);

impl Scope {
    /// The word for it.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Scope::Append => "append",
            Scope::Read => "read",
            Scope::Submit => "submit",
            Scope::Admin => "admin",
        }
    }

    /// Whether a caller with this scope may do what takes another.
    #[must_use]
    pub fn holds(self, needed: Scope) -> bool {
        match self {
            Scope::Append | Scope::Read => needed == self,
            Scope::Submit => needed != Scope::Admin,
            Scope::Admin => true,
        }
    }
}

impl FromStr for Scope {
    type Err = InvalidScope;

    fn from_str(text: &str) -> Result<Self, InvalidScope> {
        let all = [Scope::Append, Scope::Read, Scope::Submit, Scope::Admin];
        let named = all.into_iter().find(|scope| scope.as_str() == text);
        named.ok_or_else(|| InvalidScope(text.chars().take(40).collect()))
    }
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neither_appending_nor_reading_holds_the_other() {
        use Scope::{Admin, Append, Read, Submit};
        let all = [Append, Read, Submit, Admin];
        let held = |scope: Scope| all.map(|needed| scope.holds(needed));
        assert_eq!(held(Append), [true, false, false, false]);
        assert_eq!(held(Read), [false, true, false, false]);
        assert_eq!(held(Submit), [true, true, true, false]);
        assert_eq!(held(Admin), [true; 4]);
        for scope in all {
            assert_eq!(scope.as_str().parse(), Ok(scope));
        }
    }
}
