//! One thing that is wrong with what was submitted, said so that its author can mend it.
//!
//! A reader that finds faults reports all of them at once, each with its place: in a document, a
//! text, the options of a request or its headers.

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;

/// One fault, with its place.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Fault {
    /// The place in a JSON document: a JSON pointer (RFC 6901), empty for the whole of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = String, example = "/parameters/mass/estimate/lower")]
    pub pointer: Option<Box<str>>,
    /// The query parameter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = String)]
    pub parameter: Option<Box<str>>,
    /// The request header.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = String)]
    pub header: Option<Box<str>>,
    /// The line, from 1, in a text: a table, a document that is no JSON, an expression.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub line: Option<u64>,
    /// The column: its name in a table, the number of the character within the line of another text.
    #[serde(
        default,
        skip_serializing_if = "Option::is_none",
        deserialize_with = "name_or_number"
    )]
    #[schema(value_type = String)]
    pub column: Option<Box<str>>,
    /// What kind of fault, for programs: stable snake_case.
    #[schema(value_type = String, example = "bounds_reversed")]
    pub code: Cow<'static, str>,
    /// What is wrong, for people, with the numbers in it.
    #[schema(value_type = String, example = "lower 120 is not below upper 20")]
    pub detail: Box<str>,
}

impl Fault {
    /// A fault at `pointer`, a JSON pointer.
    pub fn new(
        pointer: impl Into<String>,
        code: impl Into<Cow<'static, str>>,
        detail: impl Into<String>,
    ) -> Self {
        Self {
            pointer: Some(pointer.into().into()),
            ..Self::of_whole(code, detail)
        }
    }

    /// A fault that has no place of its own: of the whole, or of what `detail` names.
    pub fn of_whole(code: impl Into<Cow<'static, str>>, detail: impl Into<String>) -> Self {
        Self {
            code: code.into(),
            detail: detail.into().into(),
            ..Self::default()
        }
    }

    /// A fault of a query parameter.
    pub fn of_parameter(
        parameter: &str,
        code: impl Into<Cow<'static, str>>,
        detail: impl Into<String>,
    ) -> Self {
        Self {
            parameter: Some(parameter.into()),
            ..Self::of_whole(code, detail)
        }
    }

    /// The fault at a line and the number of a character of the text.
    #[must_use]
    pub fn within(self, (line, character): (u64, u64)) -> Self {
        Self {
            line: Some(line),
            column: Some(character.to_string().into()),
            ..self
        }
    }

    /// The fault in a larger document, where the document of the fault stands at `parent`.
    #[must_use]
    pub fn below(self, parent: &str) -> Self {
        Self {
            pointer: Some(format!("{parent}{}", self.pointer()).into()),
            ..self
        }
    }

    /// The JSON pointer, empty for the whole and for a place outside a document.
    #[must_use]
    pub fn pointer(&self) -> &str {
        self.pointer.as_deref().unwrap_or_default()
    }
}

impl fmt::Display for Fault {
    /// Where and what. The `detail` of a fault in a text that is no expression names the line itself.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let places = [&self.pointer, &self.parameter, &self.header];
        let mut named = places.into_iter().flatten().filter(|name| !name.is_empty());
        if let Some(name) = named.next() {
            write!(f, "{name}: ")?;
        }
        if let (Some(_), Some(line), Some(column)) = (&self.pointer, self.line, &self.column) {
            write!(f, "line {line}, column {column}: ")?;
        }
        f.write_str(&self.detail)
    }
}

impl std::error::Error for Fault {}

/// A column that is written as a text or, in what earlier versions stored, as a number.
fn name_or_number<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Box<str>>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum StoredColumn {
        Name(Box<str>),
        Number(u64),
    }
    let column = Option::<StoredColumn>::deserialize(from)?;
    Ok(column.map(|column| match column {
        StoredColumn::Name(name) => name,
        StoredColumn::Number(number) => number.to_string().into(),
    }))
}

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
        let fault = Fault::of_parameter("tz", "invalid_parameter", "`Mars` is no zone");
        assert_eq!(fault.to_string(), "tz: `Mars` is no zone");
    }

    #[test]
    fn a_column_that_was_stored_as_a_number_is_read_as_one_that_is_stored_now() {
        let fault = Fault::new("/model", "unknown_name", "`y`?").within((2, 4));
        let mut stored = serde_json::to_value(&fault).unwrap();
        assert_eq!(stored["column"], "4");
        stored["column"] = serde_json::json!(4);
        assert_eq!(serde_json::from_value::<Fault>(stored).unwrap(), fault);
    }
}
