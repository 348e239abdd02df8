//! Rows of CSV and their fields; none is so long that memory would not hold its fields.

use super::super::error::{ReadError, broken, told};
use super::super::memory::LONGEST_ROW;
use super::shape::Shape;
use ::csv::{ByteRecord, Error, ErrorKind, Position, Reader, ReaderBuilder};
use greybox_numerics::parsing::Fault;
use std::cell::Cell;
use std::io::{self, Read};
use std::rc::Rc;

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
            return Err(broken(Fault::of_whole("row_too_long", detail)));
        }
        let length = target.len().min(PIECE_BYTES);
        let count = self.text.read(&mut target[..length])?;
        self.handed += count as u64;
        Ok(count)
    }
}

/// The rows of a table, from its titles on.
pub(super) struct TableRows<'s, R> {
    rows: Reader<BoundedRows<R>>,
    shape: &'s Shape,
    has_begun: bool,
    repeated: Rc<Cell<usize>>,
}

impl<'s, R: Read> TableRows<'s, R> {
    pub(super) fn of(text: R, delimiter: u8, shape: &'s Shape) -> Self {
        Self {
            rows: rows_of(text, delimiter),
            shape,
            has_begun: false,
            repeated: Rc::default(),
        }
    }

    /// A count of the rows that are left out because they stand above the data too, while it goes on.
    pub(super) fn repeated(&self) -> Rc<Cell<usize>> {
        Rc::clone(&self.repeated)
    }

    /// The first row, which has the titles.
    fn titles(&mut self, record: &mut ByteRecord) -> Result<bool, ReadError> {
        self.has_begun = true;
        let mut is_one = true;
        for _ in 0..self.shape.rows_above() {
            is_one &= read_text_row(&mut self.rows, record)?;
        }
        *record = self.shape.table_titles();
        Ok(is_one)
    }
}

/// The rows of a text, whatever they are.
pub(super) fn rows_of<R: Read>(text: R, delimiter: u8) -> Reader<BoundedRows<R>> {
    ReaderBuilder::new()
        .delimiter(delimiter)
        .flexible(true)
        .has_headers(false)
        .from_reader(BoundedRows::of(text))
}

/// The next row of a table, first that of its titles; false at the end.
pub(super) fn read_row(
    rows: &mut TableRows<'_, impl Read>,
    record: &mut ByteRecord,
) -> Result<bool, ReadError> {
    if !rows.has_begun {
        return rows.titles(record);
    }
    while read_text_row(&mut rows.rows, record)? {
        if !rows.shape.repeats_top(record) || is_empty(record) {
            rows.shape.fit(record);
            return Ok(true);
        }
        rows.repeated.set(rows.repeated.get() + 1);
    }
    Ok(false)
}

/// The next row of a text; false at the end.
pub(super) fn read_text_row(
    rows: &mut Reader<BoundedRows<impl Read>>,
    record: &mut ByteRecord,
) -> Result<bool, ReadError> {
    rows.get_mut().begin();
    let is_one = rows.read_byte_record(record).map_err(from_csv)?;
    // The reader counts from where it began to look, which may be empty lines before the row.
    if let Some(mut position) = record.position().cloned() {
        let within = record
            .as_slice()
            .iter()
            .filter(|byte| **byte == b'\n')
            .count();
        let end = rows.position().line();
        position.set_line(end.saturating_sub(1 + within as u64).max(position.line()));
        record.set_position(Some(position));
    }
    Ok(is_one)
}

fn from_csv(error: Error) -> ReadError {
    let line = error.position().map_or(1, Position::line);
    match error.into_kind() {
        ErrorKind::Io(error) => told(ReadError::Io(error)),
        kind => ReadError::Io(io::Error::other(format!("line {line}: {kind:?}"))),
    }
}

/// Whether a row has nothing in it.
pub(super) fn is_empty(record: &ByteRecord) -> bool {
    record.iter().all(|field| field.trim_ascii().is_empty())
}
