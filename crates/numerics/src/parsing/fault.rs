//! One thing that is wrong with a document, said so that its author can mend it.
//!
//! A reader that finds faults reports all of them at once, each with the place in the document.

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One fault in a submitted document.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Fault {
    /// Where: a JSON pointer (RFC 6901) into the document, empty for the whole of it.
    #[schema(example = "/parameters/mass/estimate/lower")]
    pub pointer: String,
    /// What kind of fault, for programs: stable snake_case.
    #[schema(value_type = String, example = "bounds_reversed")]
    pub code: Cow<'static, str>,
    /// What is wrong, for people, with the numbers in it.
    #[schema(example = "lower 120 is not below upper 20")]
    pub detail: String,
    /// The line within the text at that place, from 1, where the text is an expression.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub line: Option<u64>,
    /// The character within that line, from 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub column: Option<u64>,
}

impl Fault {
    /// A fault at `pointer`.
    pub fn new(
        pointer: impl Into<String>,
        code: impl Into<Cow<'static, str>>,
        detail: impl Into<String>,
    ) -> Self {
        Self {
            pointer: pointer.into(),
            code: code.into(),
            detail: detail.into(),
            line: None,
            column: None,
        }
    }

    /// The fault at a line and a column of the text at `pointer`.
    #[must_use]
    pub fn within(self, (line, column): (u64, u64)) -> Self {
        Self {
            line: Some(line),
            column: Some(column),
            ..self
        }
    }

    /// The fault in a larger document, where the document of the fault stands at `parent`.
    #[must_use]
    pub fn below(self, parent: &str) -> Self {
        Self {
            pointer: format!("{parent}{}", self.pointer),
            ..self
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.pointer.is_empty() {
            write!(f, "{}: ", self.pointer)?;
        }
        if let (Some(line), Some(column)) = (self.line, self.column) {
            write!(f, "line {line}, column {column}: ")?;
        }
        write!(f, "{}", self.detail)
    }
}

impl std::error::Error for Fault {}

/// Appends one reference token to a JSON pointer, escaped as RFC 6901 section 3 asks.
pub fn pointer_to(parent: &str, token: &str) -> String {
    format!("{parent}/{}", token.replace('~', "~0").replace('/', "~1"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pointer_escapes_tilde_and_slash_so_that_serde_json_finds_the_place_again() {
        let document = serde_json::json!({"labels": {"a/b~c": 7}});
        let pointer = pointer_to("/labels", "a/b~c");
        assert_eq!(pointer, "/labels/a~1b~0c");
        assert_eq!(document.pointer(&pointer), Some(&serde_json::json!(7)));
    }

    #[test]
    fn a_fault_reads_as_place_and_sentence() {
        let fault = Fault::new("/seed", "out_of_range", "-1 is below 0");
        assert_eq!(fault.to_string(), "/seed: -1 is below 0");
        let fault = Fault::new("/states/x/derivative", "unknown_name", "`y`?").within((1, 4));
        let text = "/states/x/derivative: line 1, column 4: `y`?";
        assert_eq!(fault.to_string(), text);
    }
}
