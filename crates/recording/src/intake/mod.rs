//! Reading recordings: a file for each format that plants write.
//!
//! A source, which gzip may have packed (`gzip`), is text (`encoding`) in one of several formats
//! ([`format`]), told by its media type and its first lines or named by an option (`options`). Cells
//! (`cell`) become times (`clock`), SI values ([`column`], [`units`]) and classes of quality (`quality`).
//!
//! A CSV with a column for each signal goes straight into a recording, however long it is; so do the
//! rows of workbooks and of Parquet (`binary`, by the features `excel` and `parquet`), which are
//! turned into CSV. All other formats become tags (`tags`), each with its own instants, which are
//! held in memory, up to [`MAX_HELD_SAMPLES`], and then put on common instants. The rest of the
//! program sees [`Recording`]s only.

#[cfg(any(feature = "excel", feature = "parquet"))]
mod binary;
mod cell;
mod clock;
mod column;
mod csv;
mod encoding;
mod epochs;
mod error;
mod fixed_width;
mod format;
mod gzip;
mod historian;
pub mod json;
mod layout;
pub mod lines;
mod memory;
mod offset;
pub mod omf;
mod options;
mod order;
mod quality;
mod skipped_lines;
pub mod spread;
mod stamp;
mod table_options;
mod tags;
mod title;
pub mod units;
mod value;

use crate::intake::error::at_line;
pub use error::{MAX_FAULTS, ReadError};
pub use format::{Format, MediaKind};
pub use layout::{ColumnRole, Layout, LayoutColumn, LayoutRow};
pub use memory::{MEMORY_ALWAYS, MEMORY_PER_BYTE, MOST_RATIO, may_unpack};
pub use options::{Options, ReadingPurpose};
pub use quality::quality_schemes;
pub use tags::MAX_HELD_SAMPLES;

use crate::{Conversion, NewScratch, ReceivedRecording, Recording};
use encoding::DecodedText;
use error::{malformed, told};
use format::{HEAD_BYTES, whole_lines};
use gzip::Unpacked;
use memory::Memory;
use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, Cursor, Read};

/// Reads a recording into memory.
///
/// # Errors
/// When the source fails, when its format is not read here, or with everything that is wrong with
/// it.
pub fn read(source: impl Read, kind: MediaKind, options: &Options) -> Result<Recording, ReadError> {
    let received = receive(source, kind, options, None)?;
    received.into_recording().map_err(ReadError::Scratch)
}

/// Reads a recording; of a CSV with a column for each signal, memory holds a few MiB, and what is
/// more goes to the scratch, where there is one.
///
/// # Errors
/// Those of [`read`], and when the scratch fails.
pub fn receive(
    source: impl Read,
    kind: MediaKind,
    options: &Options,
    scratch: Option<NewScratch>,
) -> Result<ReceivedRecording, ReadError> {
    let (memory, source) = Memory::counting(source);
    let mut source = BufReader::with_capacity(HEAD_BYTES as usize, source);
    if !source.fill_buf()?.starts_with(gzip::MAGIC) {
        return receive_plain(source, kind, options, scratch, &memory);
    }
    let kind = match kind {
        MediaKind::Binary => MediaKind::Text,
        kind => kind,
    };
    let unpacked = BufReader::with_capacity(HEAD_BYTES as usize, Unpacked::of(source, &memory));
    receive_plain(unpacked, kind, options, scratch, &memory).map_err(told)
}

/// Receives a recording that is not packed.
fn receive_plain(
    mut source: impl BufRead,
    kind: MediaKind,
    options: &Options,
    scratch: Option<NewScratch>,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    let format = options.format.or(Format::of_magic(source.fill_buf()?));
    if let Some(instead) = format.and_then(Format::instead) {
        return Err(ReadError::Unsupported(instead.to_owned()));
    }
    if format != Some(Format::Excel) {
        options.refuse(&["sheet"], format.map_or("this format", Format::name))?;
    }
    #[cfg(any(feature = "excel", feature = "parquet"))]
    if let Some(format @ (Format::Excel | Format::Parquet)) = format {
        return binary::receive(format, source, options, scratch, memory);
    }
    if format.is_none() && kind == MediaKind::Binary {
        return Err(ReadError::Unsupported(
            "bytes that are no text of a known format; say what they are with `format`".to_owned(),
        ));
    }
    let text = DecodedText::new(source, options.encoding.as_deref())?;
    let mut text = options.skip.left_out_of(text);
    let mut head = Vec::new();
    text.by_ref().take(HEAD_BYTES).read_to_end(&mut head)?;
    if head.trim_ascii().is_empty() {
        let fault = at_line(
            1,
            None,
            "empty",
            "there is no header row: the text is empty",
        );
        return Err(malformed(fault));
    }
    let whole = Cursor::new(head.clone()).chain(text);
    let (head, whole) = fixed_width::apart(head, whole)?;
    let format = match format {
        Some(format) => format,
        None => recognised(kind, &head, options),
    };
    options.refuse(&format.without(), format.name())?;
    match format {
        Format::InfluxLines => lines::read(whole, options, memory),
        json if json == Format::Json || json.is_json() => {
            receive_json(whole, json, options, memory)
        }
        csv => {
            let text = csv::SniffedText { head: &head, whole };
            csv::receive_as(csv, text, options, scratch, memory)
        }
    }
}

/// Receives a recording from a text of JSON, in which numbers may be none.
fn receive_json(
    text: impl Read,
    format: Format,
    options: &Options,
    memory: &Memory,
) -> Result<ReceivedRecording, ReadError> {
    if format != Format::Json {
        return historian::read(text, format, options, memory);
    }
    let (text, replaced) = json::PlainNumbers::of(text);
    let mut recording = json::read(text, options.purpose)?;
    recording.source = options.source("json");
    if options.name.is_some() {
        recording.name.clone_from(&options.name);
    }
    let mut received = ReceivedRecording::from(recording);
    received.header.notes.extend(replaced.note());
    Ok(received)
}

/// Says how a text is read that begins so, or how the rows of a workbook or of a Parquet file are read, of which all
/// bytes are needed. Of a text that is no table only the format is told.
///
/// # Errors
/// When the source fails, or is nothing of a format that is read here.
pub fn layout(source: impl Read, kind: MediaKind, options: &Options) -> Result<Layout, ReadError> {
    let (memory, source) = Memory::counting(source);
    let mut source = BufReader::with_capacity(HEAD_BYTES as usize, source);
    let format = options.format.or(Format::of_magic(source.fill_buf()?));
    if let Some(instead) = format.and_then(Format::instead) {
        return Err(ReadError::Unsupported(instead.to_owned()));
    }
    #[cfg(any(feature = "excel", feature = "parquet"))]
    if let Some(file @ (Format::Excel | Format::Parquet)) = format {
        let beginning = binary::beginning(file, source, options, &memory)?;
        let options = options.of_rows();
        let format = csv::recognised(&options.skip.left_out(&beginning.head)?, &options);
        let mut layout = layout_of_text(format, &beginning.head, &options)?;
        layout.warnings.splice(0..0, beginning.notes);
        layout.file = Some(file.name());
        layout.sheet = beginning.sheets.shown;
        layout.sheets = beginning.sheets.seen;
        layout.delimiter = None;
        return Ok(layout);
    }
    let mut text = DecodedText::new(source.take(HEAD_BYTES), options.encoding.as_deref())?;
    let mut head = Vec::new();
    text.read_to_end(&mut head)?;
    if memory.read() >= HEAD_BYTES {
        head.truncate(whole_lines(&head).len());
    }
    let (head, _) = fixed_width::apart(head, io::empty())?;
    let format = match format {
        Some(format) => format,
        None => recognised(kind, &options.skip.left_out(&head)?, options),
    };
    layout_of_text(format, &head, options)
}

/// Says how a text is read that begins so, which is UTF-8.
fn layout_of_text(format: Format, head: &[u8], options: &Options) -> Result<Layout, ReadError> {
    let mut layout = match format.is_table() {
        true => csv::layout(format, head, options)?,
        false => Layout::default(),
    };
    if format.is_table() {
        let options = Options {
            format: Some(format),
            encoding: None,
            ..options.clone()
        };
        match receive(head, MediaKind::Csv, &options, None) {
            Ok(received) => layout.warnings = received.header.notes,
            Err(error) => layout.faults = error.faults().to_vec(),
        }
    }
    layout.format = format.name();
    Ok(layout)
}

/// The SI unit of values in a recorded unit; nothing where the unit is not known.
#[must_use]
pub fn si_unit(unit: &str) -> Option<Cow<'static, str>> {
    units::parse(unit).map(|unit| unit.si)
}

/// How values in a recorded unit become SI; nothing where none was said, or the unit is not known.
#[must_use]
pub fn conversion(unit: &str) -> Option<Conversion> {
    let unit = units::parse(unit).filter(|_| !unit.is_empty())?;
    Some(Conversion {
        factor: unit.factor,
        offset: unit.offset,
    })
}

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
        read(reader, MediaKind::Csv, &Options::default())
    }
}

fn recognised(kind: MediaKind, head: &[u8], options: &Options) -> Format {
    let first = head.trim_ascii_start().first().copied();
    match kind {
        MediaKind::Json => historian::recognised(head),
        MediaKind::Text if matches!(first, Some(b'{' | b'[')) => historian::recognised(head),
        MediaKind::Text if lines::looks_like(head) => Format::InfluxLines,
        _ => csv::recognised(head, options),
    }
}

#[cfg(test)]
mod round_trip {
    //! What one part writes the other reads back.

    use crate::{Recording, Signal, TimeAxis};
    use proptest::prelude::*;

    fn value() -> impl Strategy<Value = f64> {
        prop_oneof![9 => -1e12..1e12, 1 => Just(f64::NAN), 1 => prop::num::f64::NORMAL]
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        let canonical = |v: &f64| {
            if v.is_nan() {
                f64::NAN.to_bits()
            } else {
                v.to_bits()
            }
        };
        values.iter().map(canonical).collect()
    }

    proptest! {
        #[test]
        fn a_recording_written_as_csv_reads_back_to_the_same_bits(
            rows in prop::collection::vec((value(), value()), 2..60),
            milliseconds in 1_u32..10_000,
        ) {
            let (a, b): (Vec<f64>, Vec<f64>) = rows.into_iter().unzip();
            let time =
                TimeAxis::Uniform { sample_time: f64::from(milliseconds) / 1e3, samples: a.len() };
            let signals =
                vec![Signal::new("spool, \"left\" [raw]", "", a), Signal::new("position", "m", b)];
            let written = Recording::new(time, signals);
            let mut text = Vec::new();
            written.write_csv(&mut text).unwrap();
            let read = Recording::from_csv(text.as_slice()).unwrap();
            prop_assert_eq!(&read.time, &written.time);
            for (read, written) in read.signals.iter().zip(&written.signals) {
                prop_assert_eq!(&read.name, &written.name);
                prop_assert_eq!(&read.unit, &written.unit);
                prop_assert_eq!(bits(&read.values), bits(&written.values));
            }
        }
    }
}
