//! Text of strangers in CSV, which spreadsheets open: a cell that begins as a formula does would be run there.

use std::borrow::Cow;

use greybox::recording::Recording;

/// The characters that a formula of a spreadsheet begins with.
const FORMULA_BEGINS: [char; 4] = ['=', '+', '-', '@'];
/// The characters after which a spreadsheet may see a new cell; which ones depends on the country.
const SEPARATORS: [char; 6] = [',', ';', '\t', '\r', '\n', '"'];

/// The text with an apostrophe before each character that would begin a formula, so that a spreadsheet shows
/// the text. Text that begins no formula stays as it is.
pub(super) fn inert(text: &str) -> Cow<'_, str> {
    let mut written = String::new();
    let mut copied = 0;
    let mut cell_begins = true;
    for (place, character) in text.char_indices() {
        if cell_begins && FORMULA_BEGINS.contains(&character) {
            written.push_str(&text[copied..place]);
            written.push('\'');
            copied = place;
        }
        let is_blank = character.is_whitespace() || character.is_control();
        cell_begins = SEPARATORS.contains(&character) || (cell_begins && is_blank);
    }
    if copied == 0 && written.is_empty() {
        return Cow::Borrowed(text);
    }
    written.push_str(&text[copied..]);
    Cow::Owned(written)
}

/// Gives the signals of a recording names that begin no formula.
pub(super) fn inert_names(recording: &mut Recording) {
    for signal in &mut recording.signals {
        if let Cow::Owned(name) = inert(&signal.name) {
            signal.name = name;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_begins_no_formula_wherever_it_begins() {
        for (text, expected) in [
            ("", ""),
            ("pump-1 = on", "pump-1 = on"),
            ("=HYPERLINK(1)", "'=HYPERLINK(1)"),
            (" \t+1", " \t'+1"),
            ("-1", "'-1"),
            ("@SUM(1)", "'@SUM(1)"),
            ("a;=1,=2", "a;'=1,'=2"),
            ("a\"=1", "a\"'=1"),
            ("'=1", "'=1"),
        ] {
            assert_eq!(inert(text), expected, "{text:?}");
        }
    }
}
