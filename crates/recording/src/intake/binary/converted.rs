//! Rows of a file that is no text, turned into CSV as they are read.

use super::super::csv;
use super::super::error::{at_line, malformed, told};
use super::super::format::HEAD_BYTES;
use super::super::memory::Memory;
use super::super::options::Options;
use super::super::{Format, ReadError};
use crate::{NewScratch, ReceivedRecording, Warning};
use greybox_numerics::parsing::Fault;
use std::io::{self, Cursor, Read};

/// The text of rows that is made before it is read, beside the last row `[bytes]`.
pub(super) const TEXT_AT_ONCE: usize = 64 << 10;

pub(super) fn damaged(format: Format) -> ReadError {
    let name = format.name();
    let detail = format!("the file is damaged: no reader of {name} reads it");
    malformed(Fault::of_whole("damaged", detail))
}

/// The rows of a file, turned into CSV, with notes on what the text leaves out.
pub(super) struct ConvertedRows<'r> {
    pub text: Box<dyn Read + 'r>,
    pub notes: Vec<Warning>,
    /// The worksheets of a workbook.
    pub sheets: Worksheets,
}

/// The worksheets of a workbook; none of another file.
#[derive(Clone, Debug, Default)]
pub(in crate::intake) struct Worksheets {
    /// The name of the worksheet whose rows are read.
    pub(in crate::intake) shown: Option<String>,
    /// The names of the worksheets that can be seen.
    pub(in crate::intake) seen: Vec<String>,
}

impl ConvertedRows<'_> {
    /// The beginning of the text.
    pub fn head(&mut self) -> Result<Vec<u8>, ReadError> {
        let mut head = Vec::new();
        let read = self.text.by_ref().take(HEAD_BYTES).read_to_end(&mut head);
        read.map_err(|error| told(ReadError::Io(error)))?;
        Ok(head)
    }
}

/// Reads rows that have been turned into text.
pub(super) fn receive_rows(
    format: Format,
    rows: ConvertedRows<'_>,
    options: &Options,
    scratch: Option<NewScratch>,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let text = Box::new(options.skip.left_out_of(rows.text));
    let mut rows = ConvertedRows { text, ..rows };
    let head = rows.head()?;
    if head.trim_ascii().is_empty() {
        let fault = at_line(1, None, "empty", "there is no header row: there is no row");
        return Err(malformed(fault));
    }
    let layout = csv::recognised(&head, options);
    options.refuse(&layout.without(), layout.name())?;
    let whole = Cursor::new(head.clone()).chain(rows.text);
    let text = csv::SniffedText { head: &head, whole };
    let received = csv::receive_as(layout, text, options, scratch, memory);
    let mut received = received.map_err(told)?;
    received.header.source.format = format.name().to_owned();
    received.header.notes.splice(0..0, rows.notes);
    Ok(received)
}

/// Rows as text, made as they are read.
pub(super) struct RowText<R> {
    rows: R,
    buffer: Vec<u8>,
    read: usize,
}

/// What makes rows of CSV.
pub(super) trait WriteRows {
    /// Adds some rows to the text; says whether there were any.
    fn write(&mut self, text: &mut Vec<u8>) -> io::Result<bool>;
}

impl<R: WriteRows> RowText<R> {
    pub fn new(rows: R) -> Self {
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
pub(super) fn push_number(text: &mut Vec<u8>, number: impl zmij::Float) {
    text.extend_from_slice(zmij::Buffer::new().format(number).as_bytes());
}

/// Adds a field, in quotes where it needs them.
pub(super) fn push_field(text: &mut Vec<u8>, field: &str) {
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
