//! Text and numbers as HTML, and how they are written to a page.

use greybox_numerics::digits::significant;
use std::fmt::Write as _;

/// Text with the characters that HTML reads as its own replaced.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            other => escaped.push(other),
        }
    }
    escaped
}

/// Words in which names stand between back-ticks.
pub fn with_code(words: &str) -> String {
    let mut html = String::new();
    for (place, part) in words.split('`').enumerate() {
        let part = escape(part);
        if place % 2 == 1 {
            html.push_str("<code>");
            html.push_str(&part);
            html.push_str("</code>");
        } else {
            html.push_str(&part);
        }
    }
    html
}

/// What a number is, with its unit in brackets; quantities of models that opted out of units have none.
pub fn labelled(name: &str, unit: &str) -> String {
    match unit {
        "" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    }
}

/// A number with its unit, as HTML; numbers of the unit 1 and of models that opted out of units have none.
pub fn in_unit(number: &str, unit: &str) -> String {
    match unit {
        "" | "1" => number.to_owned(),
        unit => format!("{number} {}", escape(unit)),
    }
}

/// Writes to a page.
pub fn push(page: &mut String, words: std::fmt::Arguments<'_>) {
    page.write_fmt(words)
        .expect("writing to a string does not fail");
}

/// A number to five digits.
pub fn number(value: f64) -> String {
    significant(value, 5)
}

/// A number to five digits, or to as many more as a spread far smaller than the number needs.
pub fn to_spread(value: f64, spread: Option<f64>) -> String {
    let decades = spread.map_or(0.0, |spread| (value / spread).abs().log10().floor());
    let digits = match decades.is_finite() {
        true => (decades + 3.0).clamp(5.0, 15.0) as usize,
        false => 5,
    };
    significant(value, digits)
}

/// The unit in a cell of a table.
pub fn unit_cell(unit: &str) -> &str {
    match unit {
        "" => "–",
        unit => unit,
    }
}

/// A number that may be absent.
pub fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_has_the_digits_that_its_spread_needs() {
        assert_eq!(to_spread(3000.023, Some(0.035)), "3000.023");
        assert_eq!(to_spread(57.962_18, Some(0.3)), "57.962");
        assert_eq!(to_spread(57.962_18, None), "57.962");
        assert_eq!(to_spread(0.0, Some(0.3)), "0");
        assert_eq!(to_spread(1.5, Some(0.0)), "1.5000");
    }

    #[test]
    fn a_number_of_the_unit_1_stands_alone() {
        assert_eq!(in_unit("0.25", "1"), "0.25");
        assert_eq!(in_unit("0.25", ""), "0.25");
        assert_eq!(in_unit("0.25", "N*s/m"), "0.25 N*s/m");
    }

    #[test]
    fn a_name_cannot_become_markup() {
        assert_eq!(
            with_code("`<b>` & \"c\""),
            "<code>&lt;b&gt;</code> &amp; &quot;c&quot;"
        );
    }
}
