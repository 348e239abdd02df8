//! What the head of an instrument says of its table.

use crate::{Warning, shown};

/// What the head of an instrument says of the table below it.
pub(in crate::intake::csv) struct InstrumentHead {
    /// The instrument or its program, for people.
    pub(super) source: &'static str,
    /// The titles of the columns as the rows have them.
    pub(in crate::intake::csv) titles: Vec<String>,
    /// How many rows stand above the first of the data.
    pub(in crate::intake::csv) rows: usize,
    /// How many columns before the table hold nothing of it.
    pub(in crate::intake::csv) left_out: usize,
    /// How far the samples of a table without times lie apart, or what the count of the first column counts `[s]`.
    pub(in crate::intake::csv) step: Option<f64>,
    /// Whether the rows have no column for their time.
    pub(super) lacks_time: bool,
    /// When the numbers of the time begin.
    pub(in crate::intake::csv) begin: Option<String>,
}

impl InstrumentHead {
    /// A head of that source with so many rows, which says nothing more.
    pub(super) fn of_source(source: &'static str, rows: usize) -> Self {
        Self {
            source,
            titles: Vec::new(),
            rows,
            left_out: 0,
            step: None,
            lacks_time: false,
            begin: None,
        }
    }

    /// The title of the count that stands in for a time, where the rows have none.
    pub(in crate::intake::csv) fn count_title(&self) -> Option<&'static str> {
        self.lacks_time.then_some("sample")
    }

    /// Tells what was taken from the head.
    pub(in crate::intake::csv) fn note(&self) -> Warning {
        let columns = std::iter::once("the columns and their units".to_owned());
        let step = self
            .step
            .map(|step| format!("the sample time of {} s", shown(step)));
        let begin = self.begin.as_ref();
        let begin = begin.map(|begin| format!("the beginning at {begin}"));
        let parts: Vec<String> = columns.chain(step).chain(begin).collect();
        let detail = format!(
            "the text begins with the head of {}: {} were taken from it",
            self.source,
            parts.join(" and ")
        );
        Warning::of_recording("instrument_head", detail)
    }
}
