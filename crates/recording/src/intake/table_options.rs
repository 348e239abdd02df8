//! What a text does not say of its table: which lines have the titles and the units, and what its columns are.

/// The options about the layout of a table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TableOptions {
    /// Where the titles of the columns stand.
    pub(super) header_row: Option<NamedRow>,
    /// Where the units of the columns stand.
    pub(super) unit_row: Option<NamedRow>,
    /// The column that names the signal of a row.
    pub(super) tag: Option<String>,
    /// The columns of values, where a row names its signal.
    pub(super) values: Vec<String>,
    /// The column of the quality, where a row names its signal.
    pub(super) quality: Option<String>,
}

/// Where what an option speaks of stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NamedRow {
    /// In no row of its own.
    None,
    /// In this line, from 1.
    Line(u64),
}

impl TableOptions {
    /// Whether options say that each row names its signal.
    pub(super) fn has_signals_in_rows(&self) -> bool {
        self.tag.is_some() || !self.values.is_empty()
    }
}

/// `none`, or a line by its number.
pub(super) fn named_row(text: &str) -> Result<NamedRow, String> {
    if text == "none" {
        return Ok(NamedRow::None);
    }
    let line = text.parse().ok().filter(|line| *line > 0);
    line.map(NamedRow::Line)
        .ok_or_else(|| format!("`{text}` is neither `none` nor the number of a line, from 1"))
}
