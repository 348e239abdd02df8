//! Recordings from files that are no text: workbooks of Excel and Apache Parquet.
//!
//! Their rows are turned into rows of CSV, one after the other, and read like any other CSV: with a
//! column for each signal, or with a row for each sample. Line numbers are those of the rows.

mod converted;
#[cfg(feature = "excel")]
mod excel;
#[cfg(feature = "excel")]
mod markup;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(feature = "excel")]
mod workbook;

use super::error::malformed;
use super::format::{HEAD_BYTES, whole_lines};
use super::memory::Memory;
use super::options::Options;
use super::{Format, ReadError};
use crate::{NewScratch, ReceivedRecording, Warning};
use bytes::Bytes;
use converted::{ConvertedRows, Worksheets, damaged, receive_rows};
use greybox_numerics::parsing::Fault;
use std::io::Read;
use std::panic::{self, AssertUnwindSafe};

/// The bytes of a file that is no text, at the most: these formats begin at their end, so that the
/// whole is held in memory.
const MAX_BYTES: usize = 256 << 20;

/// Reads a file of one of these formats.
pub(super) fn receive(
    format: Format,
    source: impl Read,
    options: &Options,
    scratch: Option<NewScratch>,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let take = |rows: ConvertedRows<'_>| receive_rows(format, rows, options, scratch, memory);
    with_rows(format, source, options, memory, take)
}

/// The first rows of a file as text.
pub(super) struct FileBeginning {
    pub(super) head: Vec<u8>,
    pub(super) notes: Vec<Warning>,
    pub(super) sheets: Worksheets,
}

/// Reads the first rows of a file of one of these formats.
pub(super) fn beginning(
    format: Format,
    source: impl Read,
    options: &Options,
    memory: &Memory,
) -> Result<FileBeginning, ReadError> {
    let take = |mut rows: ConvertedRows<'_>| {
        let head = rows.head()?;
        let head = match head.len() as u64 >= HEAD_BYTES {
            true => whole_lines(&head).to_vec(),
            false => head,
        };
        Ok(FileBeginning {
            head,
            notes: rows.notes,
            sheets: rows.sheets,
        })
    };
    with_rows(format, source, options, memory, take)
}

/// Opens a file of one of these formats and hands its rows over.
fn with_rows<T>(
    format: Format,
    source: impl Read,
    options: &Options,
    memory: &Memory,
    take: impl FnOnce(ConvertedRows<'_>) -> Result<T, ReadError>,
) -> Result<T, ReadError> {
    options.refuse(&["encoding", "decimal"], format.name())?;
    let mut bytes = Vec::new();
    source.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > MAX_BYTES {
        let detail = format!(
            "{} holds its file in memory, {} MiB at the most; send less at once, or CSV",
            format.name(),
            MAX_BYTES >> 20
        );
        return Err(malformed(Fault::of_whole("too_large", detail)));
    }
    memory.take(bytes.len() as u64);
    let bytes = Bytes::from(bytes);
    let read = || match format {
        #[cfg(feature = "excel")]
        Format::Excel => excel::with_rows(bytes, options, memory, take),
        #[cfg(feature = "parquet")]
        Format::Parquet => take(parquet::rows(bytes, options, memory)?),
        _ => Err(ReadError::Unsupported(format.name().to_owned())),
    };
    unless_it_panics(format, read)
}

/// The libraries that read these formats panic on some files that are damaged: they become a fault.
/// What they were given is dropped with them.
fn unless_it_panics<T>(
    format: Format,
    read: impl FnOnce() -> Result<T, ReadError>,
) -> Result<T, ReadError> {
    panic::catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|_| Err(damaged(format)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reader_that_panics_is_a_fault() {
        let read = unless_it_panics::<()>(Format::Parquet, || panic!("index out of bounds"));
        let Err(error) = read else {
            panic!("what panicked was read");
        };
        assert!(error.to_string().contains("damaged"), "{error}");
    }
}
