//! The values of a column, some rows at a time.

use super::super::push_number;
use super::meaning::Meaning;
use ::parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use ::parquet::data_type::{
    BoolType, ByteArrayType, DataType, DoubleType, FixedLenByteArrayType, FloatType, Int32Type,
    Int64Type, Int96Type,
};
use ::parquet::errors::ParquetError;
use std::io::{self, Write};

/// Rows of a column that have been decoded, and where reading goes on.
pub(super) enum Decoded {
    Bool(Batch<BoolType>),
    Int32(Batch<Int32Type>),
    Int64(Batch<Int64Type>),
    Int96(Batch<Int96Type>),
    Float(Batch<FloatType>),
    Double(Batch<DoubleType>),
    Bytes(Batch<ByteArrayType>),
    Fixed(Batch<FixedLenByteArrayType>),
}

impl Decoded {
    pub(super) fn new(reader: ColumnReader, most: i16) -> Self {
        match reader {
            ColumnReader::BoolColumnReader(own) => Self::Bool(Batch::new(own, most)),
            ColumnReader::Int32ColumnReader(own) => Self::Int32(Batch::new(own, most)),
            ColumnReader::Int64ColumnReader(own) => Self::Int64(Batch::new(own, most)),
            ColumnReader::Int96ColumnReader(own) => Self::Int96(Batch::new(own, most)),
            ColumnReader::FloatColumnReader(own) => Self::Float(Batch::new(own, most)),
            ColumnReader::DoubleColumnReader(own) => Self::Double(Batch::new(own, most)),
            ColumnReader::ByteArrayColumnReader(own) => Self::Bytes(Batch::new(own, most)),
            ColumnReader::FixedLenByteArrayColumnReader(own) => Self::Fixed(Batch::new(own, most)),
        }
    }

    /// Decodes so many rows at the most; says how many.
    pub(super) fn fill(&mut self, rows: usize) -> Result<usize, ParquetError> {
        match self {
            Self::Bool(own) => own.fill(rows),
            Self::Int32(own) => own.fill(rows),
            Self::Int64(own) => own.fill(rows),
            Self::Int96(own) => own.fill(rows),
            Self::Float(own) => own.fill(rows),
            Self::Double(own) => own.fill(rows),
            Self::Bytes(own) => own.fill(rows),
            Self::Fixed(own) => own.fill(rows),
        }
    }

    /// Writes the next row's value, where it has one.
    pub(super) fn write(&mut self, meaning: Meaning, text: &mut Vec<u8>) -> io::Result<()> {
        match self {
            Self::Bool(own) => match own.next() {
                Some(true) => text.extend_from_slice(b"TRUE"),
                Some(false) => text.extend_from_slice(b"FALSE"),
                None => {}
            },
            Self::Int32(own) => match (own.next(), meaning) {
                (Some(number), Meaning::Unsigned) => write!(text, "{}", number.cast_unsigned())?,
                (Some(number), _) => meaning.write_integer(text, i64::from(*number))?,
                (None, _) => {}
            },
            Self::Int64(own) => {
                if let Some(number) = own.next() {
                    meaning.write_integer(text, *number)?;
                }
            }
            Self::Int96(own) => {
                if let Some(time) = own.next() {
                    meaning.write_integer(text, time.to_nanos())?;
                }
            }
            Self::Float(own) => {
                if let Some(number) = own.next() {
                    push_number(text, *number);
                }
            }
            Self::Double(own) => {
                if let Some(number) = own.next() {
                    push_number(text, *number);
                }
            }
            Self::Bytes(own) => {
                if let Some(bytes) = own.next() {
                    meaning.write_bytes(text, bytes.data())?;
                }
            }
            Self::Fixed(own) => {
                if let Some(bytes) = own.next() {
                    meaning.write_bytes(text, bytes.data())?;
                }
            }
        }
        Ok(())
    }
}

/// Some rows of one type.
pub(super) struct Batch<T: DataType> {
    reader: ColumnReaderImpl<T>,
    /// The level of a row that has a value.
    most: i16,
    levels: Vec<i16>,
    values: Vec<T::T>,
    row: usize,
    value: usize,
}

impl<T: DataType> Batch<T> {
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
