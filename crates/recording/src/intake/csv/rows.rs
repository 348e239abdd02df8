//! Rows of CSV of which none is so long that memory would not hold its fields.

use super::super::error::{ReadingFault, broken};
use super::super::memory::LONGEST_ROW;
use std::io::{self, Read};

/// Bytes that are handed over at once, so that little of the next row counts as a part of a row.
const PIECE_BYTES: usize = 8 << 10;

/// A text whose rows are bounded.
pub(super) struct BoundedRows<R> {
    text: R,
    /// Bytes that were handed over since the row began.
    handed: u64,
    /// Rows that were begun.
    row: u64,
}

impl<R> BoundedRows<R> {
    pub(super) fn of(text: R) -> Self {
        Self {
            text,
            handed: 0,
            row: 0,
        }
    }

    /// A row ends and the next begins.
    pub(super) fn begin(&mut self) {
        self.handed = 0;
        self.row += 1;
    }
}

impl<R: Read> Read for BoundedRows<R> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        if self.handed > LONGEST_ROW {
            let detail = format!(
                "row {} has more than {LONGEST_ROW} bytes; a quote that is not closed makes one \
                 row of all that follows",
                self.row
            );
            return Err(broken(ReadingFault::anywhere("row_too_long", detail)));
        }
        let length = target.len().min(PIECE_BYTES);
        let count = self.text.read(&mut target[..length])?;
        self.handed += count as u64;
        Ok(count)
    }
}
