//! Values of a document of JSON, as far as they are held.

use super::super::cell::Cell;
use std::rc::Rc;

/// A value of the document, without what was handed over already.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum JsonLeaf {
    Null,
    Bool(bool),
    Integer(i64),
    Number(f64),
    Text(String),
    List(Vec<JsonLeaf>),
    Object(Fields),
    /// It was handed over.
    Taken,
}

/// The fields of an object.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Fields(pub(super) Vec<(Rc<str>, JsonLeaf)>);

impl Fields {
    /// The value of a field; none where it is `null`.
    pub(super) fn get(&self, name: &str) -> Option<&JsonLeaf> {
        let entry = self.0.iter().find(|(key, _)| &**key == name);
        entry
            .map(|(_, leaf)| leaf)
            .filter(|leaf| **leaf != JsonLeaf::Null)
    }

    /// Whether there is a field of that name, even if it is `null`.
    pub(super) fn has(&self, name: &str) -> bool {
        self.0.iter().any(|(key, _)| &**key == name)
    }
}

impl JsonLeaf {
    /// The cell that the leaf is where a value is looked for.
    pub(super) fn cell(&self) -> Cell<'_> {
        match self {
            Self::Null => Cell::Empty,
            Self::Bool(value) => Cell::Bool(*value),
            Self::Integer(value) => Cell::Integer(*value),
            Self::Number(value) => Cell::Number(*value),
            Self::Text(text) => Cell::Text(text),
            Self::List(_) | Self::Taken => Cell::Other("an array"),
            Self::Object(_) => Cell::Other("an object"),
        }
    }

    /// The text that the leaf is.
    pub(super) fn as_text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => Some(text),
            _ => None,
        }
    }

    /// A text, or a number as one.
    pub(super) fn text(&self) -> Option<String> {
        match self {
            Self::Text(text) => Some(text.clone()),
            Self::Integer(number) => Some(number.to_string()),
            _ => None,
        }
    }

    /// Whether the leaf holds no others.
    pub(super) fn is_scalar(&self) -> bool {
        !matches!(self, Self::List(_) | Self::Object(_) | Self::Taken)
    }

    /// Whether the leaf is the boolean `true`.
    pub(super) fn is_true(&self) -> bool {
        *self == Self::Bool(true)
    }
}
