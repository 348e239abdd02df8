//! What a cell is where a value is looked for.

use super::cell::Cell;
use super::options::{Decimal, Missing, Options};
use super::units;

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
const WORDS: [&str; 30] = [
    "bad",
    "bad input",
    "no data",
    "nodata",
    "no value",
    "null",
    "#n/a",
    "na",
    "n/a",
    "nil",
    "none",
    "<na>",
    "#na",
    "\\n",
    "undefined",
    "novalue",
    "unavailable",
    "1.#qnan",
    "-1.#qnan",
    "1.#ind",
    "-1.#ind",
    "#div/0!",
    "#value!",
    "#ref!",
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

/// The number that a text is. Points and commas that are not those of fractions stand between thousands.
pub(super) fn number(text: &str, decimal: Option<Decimal>) -> Option<f64> {
    let (fraction, thousands, is_plain) = match decimal {
        Some(Decimal::Comma) => (',', '.', !text.contains(['.', ','])),
        _ => ('.', ',', !text.contains(',')),
    };
    if is_plain {
        return text.parse().ok();
    }
    let (whole, behind) = text.split_once(fraction).unwrap_or((text, ""));
    let has_thousands = whole.contains(thousands);
    // `1,052` is clear where it was said what its comma is, and `1,052.3` always.
    let is_clear = decimal.is_some() || text.contains(fraction);
    let is_sound = !behind.contains([fraction, thousands])
        && (!has_thousands || is_clear && is_in_thousands(whole, thousands));
    let plain = || format!("{}.{behind}", whole.replace(thousands, ""));
    is_sound.then(plain)?.parse().ok()
}

/// Whether separators stand between the thousands of a whole number: `1.052`, `12.345.678`.
pub(super) fn is_in_thousands(text: &str, separator: char) -> bool {
    let mut groups = text.trim_start_matches(['-', '+']).split(separator);
    let is_of_digits = |group: &str| group.bytes().all(|digit| digit.is_ascii_digit());
    let first = groups.next().unwrap_or_default();
    let begins = (1..=3).contains(&first.len()) && !first.starts_with('0') && is_of_digits(first);
    let mut rest = groups.peekable();
    begins && rest.peek().is_some() && rest.all(|group| group.len() == 3 && is_of_digits(group))
}

/// A number and the unit behind it, as in `5.2 bar`, `45%` and `20°C`.
pub(super) fn with_unit(text: &str) -> Option<(&str, &str)> {
    let (number, unit) = text.split_at(text.find([' ', '%', '°'])?);
    let unit = unit.trim();
    let is_digit = |c: char| c.is_ascii_digit();
    let is_number = number.trim_start_matches(['-', '+']).starts_with(is_digit)
        && number.trim_end_matches(['.', ',']).ends_with(is_digit);
    (is_number && !unit.is_empty() && units::parse(unit).is_some()).then_some((number, unit))
}
