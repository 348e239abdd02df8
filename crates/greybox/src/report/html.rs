//! Text and numbers as HTML.

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

/// A number to five digits.
pub fn number(value: f64) -> String {
    significant(value, 5)
}

/// A number to so many significant digits, with an exponent where it is very large or small.
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{value:.*e}", digits - 1);
    }
    let decimals = (digits as f64 - 1.0 - magnitude).max(0.0) as usize;
    format!("{value:.decimals$}")
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

    #[test]
    fn numbers_keep_their_digits_and_not_more() {
        for (value, words) in [
            (57.962_18, "57.962"),
            (1.600_9e9, "1.6009e9"),
            (-0.012_345_678, "-0.012346"),
            (123_456.7, "123457"),
            (0.0, "0"),
            (4.8e-5, "4.8000e-5"),
        ] {
            assert_eq!(number(value), words);
        }
    }
}
