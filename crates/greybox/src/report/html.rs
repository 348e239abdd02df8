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

/// Writes to a page.
pub fn push(page: &mut String, words: std::fmt::Arguments<'_>) {
    page.write_fmt(words)
        .expect("writing to a string does not fail");
}

/// A number to five digits.
pub fn number(value: f64) -> String {
    significant(value, 5)
}

/// A number that may be absent.
pub fn optional(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_cannot_become_markup() {
        assert_eq!(
            with_code("`<b>` & \"c\""),
            "<code>&lt;b&gt;</code> &amp; &quot;c&quot;"
        );
    }
}
