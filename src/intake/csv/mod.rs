//! Recordings from CSV, in one pass over the text.
//!
//! A header row names the columns and their units in brackets: `time [s],reference [m],position
//! [mm]`. One column, the first unless [`Options::time`] names another, is the time: numbers in a
//! unit of time, or RFC 3339 timestamps with an explicit offset. An empty field and `NaN` are
//! missing samples. Comma, semicolon or tab is told from the header; a byte order mark, CRLF, empty
//! rows and empty fields at the ends of lines are understood.
//!
//! Memory holds the values (eight bytes each) or, where there is a scratch, a few MiB of them;
//! never the text.

mod clock;
mod header;
mod table;

use super::error::Faults;
use super::{Fault, ReadError};
use crate::recording::{NewScratch, Received, Recording};
use ::csv::{ByteRecord, ErrorKind, ReaderBuilder};
use header::Header;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use table::Table;

/// How much of the text is looked at to tell the delimiter `[bytes]`.
const HEAD_BYTES: u64 = 64 * 1024;

/// What the text itself does not say.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// The name of the time column; the first column when absent.
    pub time: Option<String>,
    /// The name for the recording.
    pub name: Option<String>,
}

/// Reads a recording into memory.
///
/// # Errors
/// When the source fails, when the text is not CSV, or with everything that is wrong with the
/// columns and values.
pub fn read(reader: impl Read, options: &Options) -> Result<Recording, ReadError> {
    let received = take_in(reader, options, None)?;
    received.into_recording().map_err(ReadError::Scratch)
}

/// Reads a recording of which memory holds a few MiB; what is more goes to the scratch.
///
/// # Errors
/// Those of [`read`], and when the scratch fails.
pub fn receive(
    reader: impl Read,
    options: &Options,
    scratch: NewScratch,
) -> Result<Received, ReadError> {
    take_in(reader, options, Some(scratch))
}

fn take_in(
    reader: impl Read,
    options: &Options,
    scratch: Option<NewScratch>,
) -> Result<Received, ReadError> {
    let mut reader = BufReader::with_capacity(HEAD_BYTES as usize, reader);
    let head = read_head(&mut reader)?;
    let delimiter = header::delimiter(&head);
    let mut rows = ReaderBuilder::new()
        .delimiter(delimiter)
        .flexible(true)
        .from_reader(Cursor::new(head).chain(reader));
    let header = Header::parse(rows.byte_headers().map_err(from_csv)?, options)?;
    let mut table = Table::new(header, delimiter, scratch);
    let mut record = ByteRecord::new();
    while !table.is_full() && rows.read_byte_record(&mut record).map_err(from_csv)? {
        table.push(&record).map_err(ReadError::Scratch)?;
    }
    table.into_received(options.name.clone())
}

/// The text up to the end of the first line that is not blank, without a byte order mark.
fn read_head(reader: &mut impl BufRead) -> Result<Vec<u8>, ReadError> {
    let mut head = Vec::new();
    let mut limited = reader.take(HEAD_BYTES);
    while limited.read_until(b'\n', &mut head)? > 0 && head.trim_ascii().is_empty() {}
    if let Some(rest) = head.strip_prefix(b"\xEF\xBB\xBF") {
        head = rest.to_vec();
    }
    if head.starts_with(b"\xFF\xFE") || head.starts_with(b"\xFE\xFF") {
        return Err(malformed(
            "not_utf8",
            1,
            "the text is UTF-16; send it as UTF-8",
        ));
    }
    if head.trim_ascii().is_empty() {
        return Err(malformed(
            "empty",
            1,
            "there is no header row: the text is empty",
        ));
    }
    Ok(head)
}

fn malformed(code: &'static str, line: u64, detail: &str) -> ReadError {
    let mut faults = Faults::default();
    faults.malformed(fault(code, line, None, detail.to_owned()));
    faults.result().expect_err("a fault was just kept")
}

fn from_csv(error: ::csv::Error) -> ReadError {
    let line = error.position().map_or(1, ::csv::Position::line);
    match error.into_kind() {
        ErrorKind::Io(error) => ReadError::Io(error),
        kind => ReadError::Io(io::Error::other(format!("line {line}: {kind:?}"))),
    }
}

/// A fault at a line and, in the end, a column.
fn fault(code: &'static str, line: u64, column: Option<&str>, detail: String) -> Fault {
    let place = match column {
        Some(column) => format!("line {line}, column `{column}`"),
        None => format!("line {line}"),
    };
    Fault {
        pointer: None,
        line: Some(line),
        column: column.map(str::to_owned),
        code,
        detail: format!("{place}: {detail}"),
    }
}

#[cfg(test)]
mod tests;
