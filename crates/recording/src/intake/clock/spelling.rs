//! How instants are written.

use crate::intake::cell::Cell;
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

/// The nanoseconds since 1970 of Unix seconds with all nine digits behind the point, which no double holds.
pub(super) fn unix_with_nanoseconds(cell: &Cell<'_>) -> Option<i64> {
    let Cell::Text(text) = cell else {
        return None;
    };
    let (seconds, fraction) = text.trim().split_once('.')?;
    let is_of_digits = |text: &str| text.bytes().all(|digit| digit.is_ascii_digit());
    if fraction.len() != 9 || !is_of_digits(seconds) || !is_of_digits(fraction) {
        return None;
    }
    format!("{seconds}{fraction}").parse().ok()
}
