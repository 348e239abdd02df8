//! What a source holds of one stream: columns of a table, fields of a measurement, or a tag.

use std::collections::BTreeMap;

/// Units of numbers of time, as sources files and options of batches name them, and their nanoseconds.
pub(super) const TIME_UNITS: [(&str, i64); 4] = [
    ("s", 1_000_000_000),
    ("ms", 1_000_000),
    ("us", 1_000),
    ("ns", 1),
];

/// A signal, and where the source has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceColumn {
    /// The column or the field in the source.
    pub field: String,
    /// The signal in the stream.
    pub signal: String,
    /// The unit of the values; SI, or the source's where it knows it, when absent.
    pub unit: Option<String>,
    /// The column with the quality of the values.
    pub quality: Option<String>,
}

/// Samples of a source that are read together, in the order of their instants.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceSeries {
    /// The stream to which the samples go.
    pub stream: String,
    /// The table, the measurement or the tag.
    pub table: String,
    /// The column with the instants, or their place in a row; empty where the source has one clock.
    pub time: String,
    /// What numbers of time count since 1970: `s`, `ms`, `us` or `ns`.
    pub time_unit: Option<String>,
    /// The zone of times without an offset, by its IANA name.
    pub zone: Option<String>,
    /// The place of the list of rows in an answer; empty for the answer itself.
    pub rows: String,
    /// The values that columns or tags have in the rows of the series.
    pub filter: BTreeMap<String, String>,
    /// The signals.
    pub columns: Vec<SourceColumn>,
    /// How the server is to read the pages: options of the stream's batches by their names.
    pub options: BTreeMap<&'static str, String>,
}

impl SourceSeries {
    /// How logs and errors call the series.
    #[must_use]
    pub fn label(&self) -> String {
        let filter = self.filter.iter();
        let filter: Vec<String> = filter
            .map(|(name, value)| format!("{name}={value}"))
            .collect();
        match filter.is_empty() {
            true => self.table.clone(),
            false => format!("{} ({})", self.table, filter.join(", ")),
        }
    }

    /// All that says which samples the series has and where they go: the name of its cursor. A series that is
    /// changed has another name, so that its history is read anew.
    pub(super) fn key(&self) -> String {
        format!("{self:?}")
    }
}
