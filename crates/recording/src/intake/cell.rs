//! What stands at one place of a source, before anyone knows what it means.

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
