//! Apache Parquet: a column for each signal, or columns for the time, the tag and the value.

mod arrow_schema;
mod decoded;
mod headers;
mod meaning;

use super::super::error::{at_line, broken, malformed};
use super::super::memory::Memory;
use super::converted::{
    ConvertedRows, RowText, TEXT_AT_ONCE, Worksheets, WriteRows, damaged, push_field,
};
use crate::intake::options::Options;
use crate::intake::title::name_and_unit;
use crate::intake::{Format, ReadError};
use crate::{MAX_SIGNALS, Warning};
use ::parquet::basic::Compression;
use ::parquet::errors::ParquetError;
use ::parquet::file::reader::{FileReader, SerializedFileReader};
use bytes::Bytes;
use decoded::Decoded;
use greybox_numerics::parsing::Fault;
use meaning::ColumnMeaning;
use std::borrow::Cow;
use std::{fmt, io};

/// The rows that are decoded at once, where no value may be long though its bytes are few.
const ROWS_AT_ONCE: usize = 4096;

/// What pandas calls an index without a name.
const UNNAMED_INDEX: &str = "__index_level_0__";

/// The rows of a file.
pub(super) fn rows(
    bytes: Bytes,
    options: &Options,
    memory: &Memory,
) -> Result<ConvertedRows<'static>, ReadError> {
    let not_read = |why: &dyn fmt::Display| {
        let detail = format!("this is no Parquet file that can be read: {why}");
        malformed(Fault::of_whole("not_parquet", detail))
    };
    if !headers::footer_is_sound(&bytes) {
        return Err(not_read(&"its footer does not read"));
    }
    let file = SerializedFileReader::new(bytes.clone()).map_err(|error| not_read(&error))?;
    if let Some(name) = unknown_compression(&file) {
        return Err(ReadError::Unsupported(format!(
            "the columns of this Parquet file are compressed with {name}, which is not read here; write the file \
             with zstd, snappy, gzip, lz4 or without compression"
        )));
    }
    let Some(pages) = headers::pages(&bytes, file.metadata()) else {
        return Err(damaged(Format::Parquet));
    };
    memory.hold(pages.unpacked, "pages of this file", "write smaller pages")?;
    let (columns, left_out) = columns(&file, options);
    if columns.len() > MAX_SIGNALS + 1 {
        let detail = format!("more than {MAX_SIGNALS} signals");
        return Err(malformed(Fault::of_whole("too_many_signals", detail)));
    }
    let note = (!left_out.is_empty()).then(|| {
        let detail = format!(
            "left out, being no numbers, times or words: {}",
            left_out.join(", ")
        );
        Warning::of_recording("columns_left_out", detail)
    });
    let table = ParquetTable {
        rows_at_once: if pages.have_prefixes { 1 } else { ROWS_AT_ONCE },
        file,
        columns,
        group: 0,
        left: 0,
        row: None,
    };
    Ok(ConvertedRows {
        text: Box::new(RowText::new(table)),
        notes: note.into_iter().collect(),
        sheets: Worksheets::default(),
    })
}

/// The name of a compression of the file that is not read.
fn unknown_compression(file: &SerializedFileReader<Bytes>) -> Option<&'static str> {
    let groups = file.metadata().row_groups().iter();
    let mut columns = groups.flat_map(|group| group.columns());
    columns.find_map(|column| match column.compression() {
        Compression::BROTLI(_) => Some("Brotli"),
        Compression::LZO => Some("LZO"),
        _ => None,
    })
}

/// A column that is read.
struct ParquetColumn {
    place: usize,
    name: String,
    /// The unit that Arrow's schema says; nothing where there is none.
    unit: String,
    meaning: ColumnMeaning,
    decoded: Option<Decoded>,
}

impl ParquetColumn {
    /// The name, with the unit behind it where the name has none itself.
    fn title(&self) -> Cow<'_, str> {
        let has_unit = !name_and_unit(&self.name).1.is_empty();
        match self.unit.is_empty() || has_unit {
            true => Cow::Borrowed(&self.name),
            false => Cow::Owned(format!("{} [{}]", self.name, self.unit)),
        }
    }
}

/// The columns in the order in which they are written, the time first where there is no doubt which it
/// is; and the names of those that cannot be read.
fn columns(
    file: &SerializedFileReader<Bytes>,
    options: &Options,
) -> (Vec<ParquetColumn>, Vec<String>) {
    let metadata = file.metadata().file_metadata();
    let fields = arrow_schema::fields(metadata);
    let schema = metadata.schema_descr();
    let mut columns = Vec::new();
    let mut left_out = Vec::new();
    for (place, column) in schema.columns().iter().enumerate() {
        let name = column.path().string();
        let described = fields.iter().find(|field| field.name == name);
        let duration = described.and_then(|field| field.duration);
        let duration = duration.map(|nanoseconds| ColumnMeaning::Duration { nanoseconds });
        match duration.or_else(|| ColumnMeaning::of(column)) {
            Some(meaning) => columns.push(ParquetColumn {
                place,
                unit: match duration {
                    Some(_) => "s".to_owned(),
                    None => described.map_or_else(String::new, |field| field.unit.clone()),
                },
                name,
                meaning,
                decoded: None,
            }),
            None => left_out.push(format!("`{name}`")),
        }
    }
    let is_instant =
        |column: &ParquetColumn| matches!(column.meaning, ColumnMeaning::Instant { .. });
    let is_only = columns.iter().filter(|column| is_instant(column)).count() == 1;
    let time = columns
        .iter()
        .position(|column| match is_only && options.time.is_none() {
            true => is_instant(column),
            false => column.name == UNNAMED_INDEX,
        });
    if let Some(time) = time {
        let mut first = columns.remove(time);
        if first.name == UNNAMED_INDEX {
            "time".clone_into(&mut first.name);
        }
        columns.insert(0, first);
    }
    (columns, left_out)
}

/// All rows of a file.
struct ParquetTable {
    /// The rows that are decoded at once.
    rows_at_once: usize,
    file: SerializedFileReader<Bytes>,
    columns: Vec<ParquetColumn>,
    /// The row groups that have been begun.
    group: usize,
    /// The rows that are decoded and not written.
    left: usize,
    /// The rows that have been written; none before the header.
    row: Option<u64>,
}

impl ParquetTable {
    fn fault(&self, error: &ParquetError) -> io::Error {
        let line = self.row.unwrap_or_default() + 2;
        let detail = format!("the file is broken after row {}: {error}", line - 1);
        broken(at_line(line, None, "not_parquet", detail))
    }

    fn begin_group(&mut self) -> Result<(), ParquetError> {
        let group = self.file.get_row_group(self.group)?;
        for column in &mut self.columns {
            let levels = group
                .metadata()
                .column(column.place)
                .column_descr()
                .max_def_level();
            let reader = group.get_column_reader(column.place)?;
            column.decoded = Some(Decoded::new(reader, levels));
        }
        self.group += 1;
        Ok(())
    }

    /// Decodes rows of all columns; says how many, none at the end of a row group.
    fn fill(&mut self) -> Result<usize, ParquetError> {
        let mut rows = None;
        for column in &mut self.columns {
            let column_rows = match &mut column.decoded {
                Some(decoded) => decoded.fill(self.rows_at_once)?,
                None => 0,
            };
            if *rows.get_or_insert(column_rows) != column_rows {
                let detail = format!("`{}` has fewer rows than others", column.name);
                return Err(ParquetError::General(detail));
            }
        }
        Ok(rows.unwrap_or(0))
    }
}

impl ParquetTable {
    /// Adds the next of the rows that are decoded.
    fn write_row(&mut self, text: &mut Vec<u8>) -> io::Result<()> {
        for (place, column) in self.columns.iter_mut().enumerate() {
            if place > 0 {
                text.push(b',');
            }
            if let Some(decoded) = &mut column.decoded {
                decoded.write(column.meaning, text)?;
            }
        }
        text.push(b'\n');
        Ok(())
    }
}

impl WriteRows for ParquetTable {
    fn write(&mut self, text: &mut Vec<u8>) -> io::Result<bool> {
        if self.row.is_none() {
            for column in &self.columns {
                push_field(text, &column.title());
                text.push(b',');
            }
            // In the place of the last comma.
            text.pop();
            text.push(b'\n');
            self.row = Some(0);
            return Ok(true);
        }
        while self.left == 0 {
            match self.fill() {
                Ok(0) if self.group == self.file.metadata().num_row_groups() => return Ok(false),
                Ok(0) => self.begin_group().map_err(|error| self.fault(&error))?,
                Ok(rows) => self.left = rows,
                Err(error) => return Err(self.fault(&error)),
            }
        }
        // A dictionary may say one long word in every row.
        while self.left > 0 && text.len() < TEXT_AT_ONCE {
            self.write_row(text)?;
            self.left -= 1;
            self.row = self.row.map(|row| row + 1);
        }
        Ok(true)
    }
}
