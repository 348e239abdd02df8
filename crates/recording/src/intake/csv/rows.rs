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
    rows: TextRows<R>,
    shape: &'s Shape,
    has_begun: bool,
    /// How many rows with anything in them came below the titles.
    count: u64,
    repeated: Rc<Cell<usize>>,
}

impl<'s, R: Read> TableRows<'s, R> {
    pub(super) fn of(text: R, delimiter: u8, shape: &'s Shape) -> Self {
        Self {
            rows: TextRows::of(text, delimiter),
            shape,
            has_begun: false,
            count: 0,
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
            is_one &= self.rows.read(record)?;
        }
        *record = self.shape.table_titles();
        Ok(is_one)
    }
}

/// The rows of a text, whatever they are.
pub(super) struct TextRows<R> {
    rows: Reader<BoundedRows<R>>,
    /// Any number of blanks stand between two fields.
    are_of_blanks: bool,
}

impl<R: Read> TextRows<R> {
    pub(super) fn of(text: R, delimiter: u8) -> Self {
        let rows = ReaderBuilder::new()
            .delimiter(delimiter)
            .flexible(true)
            .has_headers(false)
            .from_reader(BoundedRows::of(text));
        Self {
            rows,
            are_of_blanks: delimiter == b' ',
        }
    }

    /// The next row; false at the end.
    pub(super) fn read(&mut self, record: &mut ByteRecord) -> Result<bool, ReadError> {
        self.rows.get_mut().begin();
        let is_one = self.rows.read_byte_record(record).map_err(from_csv)?;
        // The reader counts from where it began to look, which may be empty lines before the row.
        if let Some(mut position) = record.position().cloned() {
            let within = record
                .as_slice()
                .iter()
                .filter(|byte| **byte == b'\n')
                .count();
            let end = self.rows.position().line();
            position.set_line(end.saturating_sub(1 + within as u64).max(position.line()));
            record.set_position(Some(position));
        }
        if self.are_of_blanks {
            let position = record.position().cloned();
            // The sign of a comment is no field.
            let mut fields = record.iter().filter(|field| !field.is_empty()).peekable();
            fields.next_if(|field| [&b"#"[..], b"%"].contains(field));
            *record = fields.collect();
            record.set_position(position);
        }
        Ok(is_one)
    }
}

/// The next row of a table, first that of its titles; false at the end.
pub(super) fn read_row(
    rows: &mut TableRows<'_, impl Read>,
    record: &mut ByteRecord,
) -> Result<bool, ReadError> {
    if !rows.has_begun {
        return rows.titles(record);
    }
    while rows.rows.read(record)? {
        if is_empty(record) {
            return Ok(true);
        }
        if !rows.shape.repeats_top(record) {
            rows.shape.fit(record, rows.count);
            rows.count += 1;
            return Ok(true);
        }
        rows.repeated.set(rows.repeated.get() + 1);
    }
    Ok(false)
}

fn from_csv(error: Error) -> ReadError {
    let line = error.position().map_or(1, Position::line);
    match error.into_kind() {
        ErrorKind::Io(error) => told(ReadError::Io(error)),
        kind => ReadError::Io(io::Error::other(format!("line {line}: {kind:?}"))),
    }
}

/// Whether a row has nothing in it. A file that was not closed may end with bytes of 0.
pub(super) fn is_empty(record: &ByteRecord) -> bool {
    let is_nothing = |byte: &u8| byte.is_ascii_whitespace() || *byte == 0;
    record.as_slice().iter().all(is_nothing)
}
