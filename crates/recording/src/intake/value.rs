//! What a cell is where a value is looked for.

mod spelling;

use super::cell::Cell;
use super::options::{Decimal, Missing, Options};
use super::quality;
use super::units;
use crate::Class;
use spelling::is_in_lakhs;
pub(super) use spelling::is_in_thousands;

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

/// The number that a text is, in any spelling that has one meaning.
pub(super) fn number(text: &str, decimal: Option<Decimal>) -> Option<f64> {
    plain_number(text, decimal).or_else(|| plain_number(&spelling::plain(text)?, decimal))
}

/// The number that a text of ASCII is. Points and commas that are not those of fractions stand between thousands.
fn plain_number(text: &str, decimal: Option<Decimal>) -> Option<f64> {
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
    let are_thousands =
        || is_in_thousands(whole, thousands) || thousands == ',' && is_in_lakhs(whole);
    let is_sound =
        !behind.contains([fraction, thousands]) && (!has_thousands || is_clear && are_thousands());
    let plain = || format!("{}.{behind}", whole.replace(thousands, ""));
    is_sound.then(plain)?.parse().ok()
}

/// The number in a cell that says behind it in parentheses how good it is: `3.200 (Good NonSpecific)`.
pub(super) fn with_status(cell: &Cell<'_>, decimal: Option<Decimal>) -> Option<(f64, Class)> {
    let Cell::Text(text) = cell else {
        return None;
    };
    let (digits, words) = status_behind(text)?;
    Some((number(digits, decimal)?, quality::word(words)?))
}

/// A number and the words of quality in parentheses behind it.
pub(super) fn status_behind(text: &str) -> Option<(&str, &str)> {
    let (digits, words) = text.trim().strip_suffix(')')?.split_once(" (")?;
    let is_status = !words.trim().is_empty() && quality::word(words).is_some();
    is_status.then_some((digits.trim(), words))
}

/// A number and the unit behind it, as in `5.2 bar`, `45%` and `20°C`.
pub(super) fn with_unit(text: &str) -> Option<(&str, &str)> {
    let is_digit = |c: char| c.is_ascii_digit();
    let is_measured = |(number, unit): &(&str, &str)| {
        let is_number = number.trim_start_matches(['-', '+']).starts_with(is_digit)
            && number.trim_end_matches(['.', ',']).ends_with(is_digit);
        is_number && !unit.is_empty() && units::parse(unit).is_some()
    };
    let ends = text.match_indices([' ', '\u{a0}', '\u{202f}', '%', '°']);
    let mut pairs = ends.map(|(end, _)| text.split_at(end));
    pairs.find_map(|(number, unit)| Some((number, unit.trim())).filter(is_measured))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn both(text: &str) -> (Option<f64>, Option<f64>) {
        let read = |decimal| number(text, Some(decimal));
        (read(Decimal::Point), read(Decimal::Comma))
    }

    #[test]
    fn a_spelling_of_one_meaning_is_the_number() {
        for (text, expected) in [
            ("\u{2212}1.5", -1.5),
            ("+ 61.5", 61.5),
            ("-  60", -60.0),
            ("=\"1.5\"", 1.5),
            ("'1.5", 1.5),
            ("1.452 E+03", 1452.0),
            ("1.452×10^3", 1452.0),
            ("1.5 x 10^-3", 0.0015),
            ("1.5·10⁻³", 0.0015),
            ("1.0D-01", 0.1),
            ("-2.5d+00", -2.5),
            ("1_452", 1452.0),
            ("1 452 000", 1_452_000.0),
            ("1\u{202f}452.5", 1452.5),
            ("1\u{a0}452", 1452.0),
            ("-1'452.25", -1452.25),
            ("1’452", 1452.0),
            ("１．５", 1.5),
            ("－１２", -12.0),
            ("٣.٥", 3.5),
        ] {
            assert_eq!(number(text, None), Some(expected), "{text}");
            assert_eq!(number(text, Some(Decimal::Point)), Some(expected), "{text}");
        }
        assert_eq!(both("1 452,5"), (None, Some(1452.5)));
        assert_eq!(both("1 452,500"), (None, Some(1452.5)));
        assert_eq!(both("−1,0e-03"), (None, Some(-0.001)));
        assert_eq!(both("1 452.500"), (Some(1452.5), None));
        // India counts in thousands, lakhs and crores.
        assert_eq!(both("14,52,000"), (Some(1_452_000.0), None));
        assert_eq!(both("-1,45,20,000.5"), (Some(-14_520_000.5), None));
        assert_eq!(number("1,45,20,000.5", None), Some(14_520_000.5));
        assert_eq!(number("14,52,000", None), None);
        assert_eq!(both("14.52.000"), (None, None));
    }

    #[test]
    fn a_spelling_of_no_meaning_or_of_two_is_no_number() {
        for text in [
            "1 45",
            "0 452",
            "1452 000",
            "1 452'000",
            "1 452.123 456",
            "1__452",
            "_452",
            "0'123",
            "+-1",
            "- -1",
            "1.5e",
            "1.5×103",
            "5²",
            "1D5",
            "0x1D",
            "=\"inf\"",
            "'",
            "",
            "-",
            "1.5 E +03",
            "(1.5)",
            "1.5-",
            "14,52,00",
            "145,20,000",
            "04,52,000",
            "20260302 081500",
            "1 452 rpm",
            "٫",
        ] {
            assert_eq!(both(text), (None, None), "{text}");
        }
    }

    #[test]
    fn a_unit_stands_behind_a_number_in_thousands_too() {
        assert_eq!(with_unit("1 452,5 rpm"), Some(("1 452,5", "rpm")));
        assert_eq!(with_unit("5.2\u{a0}bar"), Some(("5.2", "bar")));
        assert_eq!(with_unit("45%"), Some(("45", "%")));
        assert_eq!(with_unit("5 bars of it"), None);
    }
}
