//! How instants are written.

use crate::intake::epochs::{Counted, Epoch};

/// How an instant is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Spelling {
    /// Text.
    Stamp { day_first: Option<bool> },
    /// A number of units of so many seconds each, of which so many came before 1970.
    Unix { before: i64, factor: f64 },
    /// Days in local time, of which so many came before 1899-12-30.
    Days { before: f64 },
}

impl From<Epoch> for Spelling {
    fn from(epoch: Epoch) -> Spelling {
        match epoch.counted() {
            Counted::Days { before } => Spelling::Days { before },
            Counted::Units { before, factor } => Spelling::Unix { before, factor },
        }
    }
}
