//! Rows below the data that are no rows of the table: sums, a count of the rows, who exported them, a row that was cut.

use super::super::error::{ReadingFaults, excerpt};
use super::top_rows::fields_of;
use crate::Warning;
use ::csv::ByteRecord;

/// Rows below the data of one text; more of them are faults.
const MOST: usize = 20;

/// Rows that are no rows of the table, unless one of the table follows.
#[derive(Default)]
pub(super) struct RowsBelow {
    faults: ReadingFaults,
    count: usize,
    first: String,
}

impl RowsBelow {
    /// Keeps a row with its faults.
    pub(super) fn take(&mut self, record: &ByteRecord, faults: ReadingFaults) {
        if self.count == 0 {
            self.first = fields_of(record).join(" ");
        }
        self.count += 1;
        self.faults.extend(faults);
    }

    /// Whether there are more rows than a text has below its data.
    pub(super) fn is_long(&self) -> bool {
        self.count > MOST
    }

    /// The faults of the rows, where they prove to stand among the data.
    pub(super) fn take_faults(&mut self) -> ReadingFaults {
        std::mem::take(self).faults
    }

    /// Tells that rows were left out.
    pub(super) fn note(&self) -> Option<Warning> {
        let (count, first) = (self.count, excerpt(&self.first));
        let detail =
            format!("{count} lines below the data are no rows of the table, the first `{first}`");
        (count > 0).then(|| Warning::of_recording("lines_left_out", detail))
    }
}
