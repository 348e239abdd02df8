//! What stands at one place of a source, before anyone knows what it means.

use super::error::excerpt;
use std::fmt;

/// A value of a source.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Cell<'a> {
    /// Nothing.
    Empty,
    Integer(i64),
    Number(f64),
    Bool(bool),
    Text(&'a str),
    /// An object or an array, by its kind.
    Other(&'static str),
}

impl fmt::Display for Cell<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cell::Text(text) => f.write_str(&excerpt(text.trim())),
            Cell::Integer(number) => write!(f, "{number}"),
            Cell::Number(number) => write!(f, "{number}"),
            Cell::Bool(value) => write!(f, "{value}"),
            Cell::Empty => Ok(()),
            Cell::Other(kind) => f.write_str(kind),
        }
    }
}
