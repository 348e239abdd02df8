//! What a cell is where a value is looked for.

use super::cell::Cell;
use super::options::{Decimal, Missing, Options};
use std::borrow::Cow;

/// What a cell is where a value is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum CellValue {
    Number(f64),
    /// There is nothing.
    Empty,
    /// A word for a value that is missing.
    Word,
    /// What an option says stands for a missing value.
    Said,
    Bool(bool),
    /// Something else.
    Text,
}

/// Words with which historians and spreadsheets say that there is no value.
const WORDS: [&str; 13] = [
    "bad",
    "bad input",
    "no data",
    "nodata",
    "no value",
    "null",
    "#n/a",
    "i/o timeout",
    "pt created",
    "comm fail",
    "scan off",
    "shutdown",
    "not connect",
];

impl CellValue {
    /// The value in a cell.
    pub(super) fn of(cell: &Cell<'_>, options: &Options) -> Self {
        match cell {
            Cell::Empty => Self::Empty,
            Cell::Integer(number) => Self::checked(*number as f64, &options.missing),
            Cell::Number(number) => Self::checked(*number, &options.missing),
            Cell::Bool(value) => Self::Bool(*value),
            Cell::Text(text) => Self::of_text(text, options),
            Cell::Other(_) => Self::Text,
        }
    }

    fn of_text(text: &str, options: &Options) -> Self {
        let text = text.trim_ascii();
        if text.is_empty() {
            return Self::Empty;
        }
        if let Some(number) = number(text, options.decimal) {
            return match number.is_nan() {
                true => Self::Empty,
                false => Self::checked(number, &options.missing),
            };
        }
        let lower = text.to_lowercase();
        if options.missing.words.contains(&lower) {
            return Self::Said;
        }
        match lower.as_str() {
            "true" => Self::Bool(true),
            "false" => Self::Bool(false),
            word if WORDS.contains(&word) => Self::Word,
            _ => Self::Text,
        }
    }

    fn checked(number: f64, missing: &Missing) -> Self {
        if missing.numbers.contains(&number) {
            Self::Said
        } else {
            Self::Number(number)
        }
    }
}

/// The number that a text is.
pub(super) fn number(text: &str, decimal: Option<Decimal>) -> Option<f64> {
    if decimal != Some(Decimal::Comma) {
        return text.parse().ok();
    }
    let plain: Cow<'_, str> = match text.contains(['.', ',']) {
        true => text.replace('.', "").replace(',', ".").into(),
        false => text.into(),
    };
    plain.parse().ok()
}
