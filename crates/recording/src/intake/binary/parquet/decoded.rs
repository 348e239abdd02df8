//! The values of a column, some rows at a time.

use super::super::converted::push_number;
use super::meaning::ColumnMeaning;
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{
    BoolType, ByteArrayType, DataType, DoubleType, FixedLenByteArrayType, FloatType, Int32Type,
    Int64Type, Int96Type,
};
use ::parquet::errors::ParquetError;
use std::io::{self, Write};

/// Rows of a column that have been decoded, and where reading goes on.
pub(super) enum Decoded {
    Bool(DecodedRows<BoolType>),
    Int32(DecodedRows<Int32Type>),
    Int64(DecodedRows<Int64Type>),
    Int96(DecodedRows<Int96Type>),
    Float(DecodedRows<FloatType>),
    Double(DecodedRows<DoubleType>),
    Bytes(DecodedRows<ByteArrayType>),
    Fixed(DecodedRows<FixedLenByteArrayType>),
}

impl Decoded {
    pub(super) fn new(reader: ColumnReader, most: i16) -> Self {
        match reader {
            ColumnReader::BoolColumnReader(reader) => Self::Bool(DecodedRows::new(reader, most)),
            ColumnReader::Int32ColumnReader(reader) => Self::Int32(DecodedRows::new(reader, most)),
            ColumnReader::Int64ColumnReader(reader) => Self::Int64(DecodedRows::new(reader, most)),
            ColumnReader::Int96ColumnReader(reader) => Self::Int96(DecodedRows::new(reader, most)),
            ColumnReader::FloatColumnReader(reader) => Self::Float(DecodedRows::new(reader, most)),
            ColumnReader::DoubleColumnReader(reader) => {
                Self::Double(DecodedRows::new(reader, most))
            }
            ColumnReader::ByteArrayColumnReader(reader) => {
                Self::Bytes(DecodedRows::new(reader, most))
            }
            ColumnReader::FixedLenByteArrayColumnReader(reader) => {
                Self::Fixed(DecodedRows::new(reader, most))
            }
        }
    }

    /// Decodes so many rows at the most; says how many.
    pub(super) fn fill(&mut self, rows: usize) -> Result<usize, ParquetError> {
        match self {
            Self::Bool(column) => column.fill(rows),
            Self::Int32(column) => column.fill(rows),
            Self::Int64(column) => column.fill(rows),
            Self::Int96(column) => column.fill(rows),
            Self::Float(column) => column.fill(rows),
            Self::Double(column) => column.fill(rows),
            Self::Bytes(column) => column.fill(rows),
            Self::Fixed(column) => column.fill(rows),
        }
    }

    /// Writes the next row's value, where it has one.
    pub(super) fn write(&mut self, meaning: ColumnMeaning, text: &mut Vec<u8>) -> io::Result<()> {
        match self {
            Self::Bool(rows) => match rows.next() {
                Some(true) => text.extend_from_slice(b"TRUE"),
                Some(false) => text.extend_from_slice(b"FALSE"),
                None => {}
            },
            Self::Int32(rows) => match (rows.next(), meaning) {
                (Some(number), ColumnMeaning::Unsigned) => {
                    write!(text, "{}", number.cast_unsigned())?
                }
                (Some(number), _) => meaning.write_integer(text, i64::from(*number))?,
                (None, _) => {}
            },
            Self::Int64(rows) => {
                if let Some(number) = rows.next() {
                    meaning.write_integer(text, *number)?;
                }
            }
            Self::Int96(rows) => {
                if let Some(time) = rows.next() {
                    meaning.write_integer(text, time.to_nanos())?;
                }
            }
            Self::Float(rows) => {
                if let Some(number) = rows.next() {
                    push_number(text, *number);
                }
            }
            Self::Double(rows) => {
                if let Some(number) = rows.next() {
                    push_number(text, *number);
                }
            }
            Self::Bytes(rows) => {
                if let Some(bytes) = rows.next() {
                    meaning.write_bytes(text, bytes.data())?;
                }
            }
            Self::Fixed(rows) => {
                if let Some(bytes) = rows.next() {
                    meaning.write_bytes(text, bytes.data())?;
                }
            }
        }
        Ok(())
    }
}

/// Some rows of one type.
pub(super) struct DecodedRows<T: DataType> {
    reader: ColumnReaderImpl<T>,
    /// The level of a row that has a value.
    most: i16,
    levels: Vec<i16>,
    values: Vec<T::T>,
    row: usize,
    value: usize,
}

impl<T: DataType> DecodedRows<T> {
    fn new(reader: ColumnReaderImpl<T>, most: i16) -> Self {
        Self {
            reader,
            most,
            levels: Vec::new(),
            values: Vec::new(),
            row: 0,
            value: 0,
        }
    }

    fn fill(&mut self, most_rows: usize) -> Result<usize, ParquetError> {
        self.levels.clear();
        self.values.clear();
        (self.row, self.value) = (0, 0);
        let mut rows = 0;
        // A call may end early, with a page.
        while rows < most_rows {
            let levels = (self.most > 0).then_some(&mut self.levels);
            let wanted = most_rows - rows;
            let read = self
                .reader
                .read_records(wanted, levels, None, &mut self.values);
            match read? {
                (0, ..) => break,
                (records, ..) => rows += records,
            }
        }
        Ok(rows)
    }

    fn next(&mut self) -> Option<&T::T> {
        self.row += 1;
        if self.most > 0 && self.levels.get(self.row - 1) != Some(&self.most) {
            return None;
        }
        self.value += 1;
        self.values.get(self.value - 1)
    }
}
