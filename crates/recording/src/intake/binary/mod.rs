//! Recordings from files that are no text: workbooks of Excel and Apache Parquet.
//!
//! Their rows are turned into rows of CSV, one after the other, and read like any other CSV: with a
//! column for each signal, or with a row for each sample. Line numbers are those of the rows.

#[cfg(feature = "excel")]
mod excel;
#[cfg(feature = "excel")]
mod markup;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "excel")]
mod workbook;

use super::error::{malformed, told};
use super::memory::Memory;
use super::options::Options;
use super::{Format, HEAD_BYTES, ReadError, ReadingFault, csv};
use crate::{NewScratch, ReceivedRecording, Warning};
use bytes::Bytes;
use std::io::{self, Cursor, Read};
use std::panic::{self, AssertUnwindSafe};

/// The bytes of a file that is no text, at the most: these formats begin at their end, so that the
/// whole is held in memory.
const MAX_BYTES: usize = 256 << 20;

/// The text of rows that is made before it is read, beside the last row `[bytes]`.
const TEXT_AT_ONCE: usize = 64 << 10;

/// Reads a file of one of these formats.
pub(super) fn receive(
    format: Format,
    source: impl Read,
    options: &Options,
    scratch: Option<NewScratch>,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    options.refuse(&["encoding", "decimal"], format.name())?;
    let mut bytes = Vec::new();
    source.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > MAX_BYTES {
        let detail = format!(
            "{} holds its file in memory, {} MiB at the most; send less at once, or CSV",
            format.name(),
            MAX_BYTES >> 20
        );
        return Err(malformed(ReadingFault::anywhere("too_large", detail)));
    }
    memory.take(bytes.len() as u64);
    let bytes = Bytes::from(bytes);
    let read = || match format {
        #[cfg(feature = "excel")]
        Format::Excel => excel::receive(bytes, options, scratch, memory),
        #[cfg(feature = "parquet")]
        Format::Parquet => parquet::receive(bytes, options, scratch, memory),
        _ => Err(ReadError::Unsupported(format.name().to_owned())),
    };
    unless_it_panics(format, read)
}

/// The libraries that read these formats panic on some files that are damaged: they become a fault.
/// What they were given is dropped with them.
fn unless_it_panics(
    format: Format,
    read: impl FnOnce() -> Result<ReceivedRecording, ReadError>,
) -> Result<ReceivedRecording, ReadError> {
    panic::catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(damaged(format)))
}

fn damaged(format: Format) -> ReadError {
    let name = format.name();
    let detail = format!("the file is damaged: no reader of {name} reads it");
    malformed(ReadingFault::anywhere("damaged", detail))
}

/// The rows of a file, turned into CSV, with notes on what the text leaves out.
struct ConvertedRows<R> {
    text: R,
    notes: Vec<Warning>,
}

/// Reads rows that have been turned into text.
fn receive_rows(
    format: Format,
    mut rows: ConvertedRows<impl Read>,
    options: &Options,
    scratch: Option<NewScratch>,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let mut head = Vec::new();
    let read = rows.text.by_ref().take(HEAD_BYTES).read_to_end(&mut head);
    read.map_err(|error| told(ReadError::Io(error)))?;
    if head.trim_ascii().is_empty() {
        let fault =
            ReadingFault::at_line("empty", 1, None, "there is no header row: there is no row");
        return Err(malformed(fault));
    }
    let layout = csv::recognised(&head);
    options.refuse(layout.without(), layout.name())?;
    let whole = Cursor::new(head.clone()).chain(rows.text);
    let text = csv::SniffedText { head: &head, whole };
    let received = csv::receive_as(layout, text, options, scratch, memory);
    let mut received = received.map_err(told)?;
    received.source.format = format.name().to_owned();
    received.notes.splice(0..0, rows.notes);
    Ok(received)
}

/// Rows as text, made as they are read.
struct RowText<R> {
    rows: R,
    buffer: Vec<u8>,
    read: usize,
}

/// What makes rows of CSV.
trait WriteRows {
    /// Adds some rows to the text; says whether there were any.
    fn write(&mut self, text: &mut Vec<u8>) -> io::Result<bool>;
}

impl<R: WriteRows> RowText<R> {
    fn new(rows: R) -> Self {
        Self {
            rows,
            buffer: Vec::new(),
            read: 0,
        }
    }
}

impl<R: WriteRows> Read for RowText<R> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        while self.read == self.buffer.len() {
            self.buffer.clear();
            self.read = 0;
            if !self.rows.write(&mut self.buffer)? {
                return Ok(0);
            }
        }
        let count = target.len().min(self.buffer.len() - self.read);
        target[..count].copy_from_slice(&self.buffer[self.read..self.read + count]);
        self.read += count;
        Ok(count)
    }
}

/// Adds a number in the fewest digits that mean it alone.
fn push_number(text: &mut Vec<u8>, number: impl zmij::Float) {
    text.extend_from_slice(zmij::Buffer::new().format(number).as_bytes());
}

/// Adds a field, in quotes where it needs them.
fn push_field(text: &mut Vec<u8>, field: &str) {
    let needs_quotes = |byte: &u8| matches!(byte, b',' | b';' | b'\t' | b'"' | b'\n' | b'\r');
    if !field.as_bytes().iter().any(needs_quotes) {
        text.extend_from_slice(field.as_bytes());
        return;
    }
    text.push(b'"');
    for byte in field.bytes() {
        if byte == b'"' {
            text.push(b'"');
        }
        text.push(byte);
    }
    text.push(b'"');
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_panics_is_a_fault() {
        let read = unless_it_panics(Format::Parquet, || panic!("index out of bounds"));
        let Err(error) = read else {
            panic!("what panicked was read");
        };
        assert!(error.to_string().contains("damaged"), "{error}");
    }
}
