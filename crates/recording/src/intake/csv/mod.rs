//! Recordings from CSV, in one pass over the text.
//!
//! A header row names the columns and their units: `time [s],reference [m],position [mm]`. One
//! column, the first unless [`Options::time`] names another, is the time (`clock`). An
//! empty field and `NaN` are missing samples. Comma, semicolon or tab is told from the header; empty
//! rows and empty fields at the ends of lines are understood.
//!
//! Of a text with a column for each signal (`table`) memory holds the values (eight bytes each)
//! or, where there is a scratch, a few MiB of them; never the text. Those with a row for each sample
//! (`long`), of Simulink (`simulink`) and of InfluxDB (`influx`) are held as tags.

mod header;
mod influx;
mod long;
mod rows;
mod simulink;
mod sniff;
mod table;

pub use super::options::Options;

use super::error::{malformed, told};
use super::memory::Memory;
use super::options::Decimal;
use super::{Format, MediaKind, ReadError, ReadingFault};
use crate::{NewScratch, ReceivedRecording, Recording, Warning};
use ::csv::{ByteRecord, ErrorKind, Reader, ReaderBuilder};
use header::Header;
pub(super) use header::time_name_and_unit;
use rows::BoundedRows;
use sniff::Sniff;
use std::io::{self, Read};
use table::CsvTable;

impl Recording {
    /// A recording from CSV: a header row that names the columns with their units in brackets,
    /// the time in the first column.
    ///
    /// # Errors
    /// When the text cannot be read, with everything that is wrong with it.
    ///
    /// ```
    /// let text = "time [s],force [N],position [mm]\n0,0,0\n0.01,1,0\n0.02,1,0.02\n";
    /// let recording = greybox_recording::Recording::from_csv(text.as_bytes())?;
    /// assert_eq!(recording.signals[1].values[2], 2e-5);
    /// # Ok::<(), greybox_recording::intake::ReadError>(())
    /// ```
    pub fn from_csv(reader: impl Read) -> Result<Recording, ReadError> {
        read(reader, &Options::default())
    }
}

/// Reads a recording into memory.
///
/// # Errors
/// When the source fails, when the text is not CSV, or with everything that is wrong with the
/// columns and values.
pub fn read(reader: impl Read, options: &Options) -> Result<Recording, ReadError> {
    super::read(reader, MediaKind::Csv, options)
}

/// Reads a recording of which memory holds a few MiB; what is more goes to the scratch.
///
/// # Errors
/// Those of [`read`], and when the scratch fails.
pub fn receive(
    reader: impl Read,
    options: &Options,
    scratch: NewScratch,
) -> Result<ReceivedRecording, ReadError> {
    super::receive(reader, MediaKind::Csv, options, Some(scratch))
}

/// What kind of CSV begins so.
pub(super) fn recognised(head: &[u8]) -> Format {
    Sniff::new(head).format()
}

/// A text whose beginning has been read to see what it is: the `whole` begins with the `head`.
pub(super) struct SniffedText<'h, R> {
    pub(super) head: &'h [u8],
    pub(super) whole: R,
}

/// Reads a text as one of the formats that are CSV.
pub(super) fn receive_as(
    format: Format,
    text: SniffedText<'_, impl Read>,
    options: &Options,
    scratch: Option<NewScratch>,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let sniff = Sniff::new(text.head);
    let mut notes = Vec::new();
    let mut options = options.clone();
    if options.decimal.is_none() && sniff.has_decimal_commas() {
        options.decimal = Some(Decimal::Comma);
        let detail = "numbers have a decimal comma; `decimal` says otherwise".to_owned();
        notes.push(Warning::of_recording("decimal_comma", detail));
    }
    let rows = ReaderBuilder::new()
        .delimiter(sniff.delimiter)
        .flexible(true)
        .has_headers(false)
        // Every row ends with its line, the last one too.
        .from_reader(BoundedRows::of(text.whole.chain(&b"\n"[..])));
    let mut received = match format {
        Format::LongCsv => long::read(rows, &options, memory),
        Format::SimulinkCsv => simulink::read(rows, &options, memory),
        Format::InfluxCsv => influx::read(rows, &options, memory),
        _ => wide(rows, &sniff, &options, scratch),
    }?;
    received.notes.splice(0..0, notes);
    Ok(received)
}

fn wide(
    mut rows: Reader<BoundedRows<impl Read>>,
    sniff: &Sniff,
    options: &Options,
    scratch: Option<NewScratch>,
) -> Result<ReceivedRecording, ReadError> {
    let mut record = ByteRecord::new();
    read_row(&mut rows, &mut record)?;
    let header = Header::parse(&record, options)?;
    let times = sniff.column(header.time);
    let mut table = CsvTable::new(header, options, scratch);
    table.look_ahead(times.iter().map(String::as_str));
    while !table.is_full() && read_row(&mut rows, &mut record)? {
        table.push(&record).map_err(ReadError::Scratch)?;
    }
    table.into_received()
}

/// The next row; false at the end.
fn read_row(
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

/// The line at which a row begins.
fn line_of(record: &ByteRecord) -> u64 {
    record.position().map_or(1, ::csv::Position::line)
}

/// The fields of a row as text; a fault where it is none.
fn texts(record: &ByteRecord) -> Result<Vec<&str>, ReadError> {
    let text = |field| std::str::from_utf8(field).map(str::trim);
    let fields: Result<Vec<&str>, _> = record.iter().map(text).collect();
    fields.map_err(|_| malformed(not_utf8(line_of(record))))
}

fn not_utf8(line: u64) -> ReadingFault {
    let detail = "the text is not UTF-8; say its encoding, such as encoding=windows-1252";
    ReadingFault::at_line("not_utf8", line, None, detail)
}

fn from_csv(error: ::csv::Error) -> ReadError {
    let line = error.position().map_or(1, ::csv::Position::line);
    match error.into_kind() {
        ErrorKind::Io(error) => told(ReadError::Io(error)),
        kind => ReadError::Io(io::Error::other(format!("line {line}: {kind:?}"))),
    }
}

/// Whether a row has nothing in it.
fn is_empty(record: &ByteRecord) -> bool {
    record.iter().all(|field| field.trim_ascii().is_empty())
}

#[cfg(test)]
mod tests;
