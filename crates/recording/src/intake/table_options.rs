//! What a text does not say of its table: which lines have the titles and the units, and what its columns are.

/// The options about the layout of a table of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct TableOptions {
    /// The line of the titles, from 1.
    pub(super) header_row: Option<u64>,
    pub(super) unit_row: Option<UnitRow>,
    /// The column that names the signal of a row.
    pub(super) tag: Option<String>,
    /// The columns of values, where a row names its signal.
    pub(super) values: Vec<String>,
    /// The column of the quality, where a row names its signal.
    pub(super) quality: Option<String>,
}

/// Where the units of the columns stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum UnitRow {
    /// In no row of their own.
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

/// A line by its number, from 1.
pub(super) fn line(text: &str) -> Result<u64, String> {
    let number = text.parse().ok().filter(|line| *line > 0);
    number.ok_or_else(|| format!("`{text}` is no number of a line, which counts from 1"))
}

/// `none`, or a line by its number.
pub(super) fn unit_row(text: &str) -> Result<UnitRow, String> {
    match text {
        "none" => Ok(UnitRow::None),
        text => line(text)
            .map(UnitRow::Line)
            .map_err(|_| format!("`{text}` is neither `none` nor the number of a line, from 1")),
    }
}
