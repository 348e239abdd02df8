//! What the values of a column are, and how they are written as text.

use super::super::converted::push_field;
use ::parquet::basic::{ConvertedType, LogicalType, TimeUnit, Type};
use ::parquet::schema::types::ColumnDescriptor;
use jiff::tz::TimeZone;
use jiff::{SignedDuration, Timestamp};
use std::io::{self, Write};

/// What the values of a column are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum ColumnMeaning {
    Number,
    Unsigned,
    /// Divided by a power of ten.
    Decimal(i32),
    Words,
    /// A count of units of `nanoseconds` since 1970: in UTC, or in a local time that nobody names.
    Instant {
        nanoseconds: i64,
        is_utc: bool,
    },
    /// Days since 1970.
    Date,
    /// A count of units of `nanoseconds`: a duration, or a time of day since midnight.
    Duration {
        nanoseconds: i64,
    },
}

impl ColumnMeaning {
    /// What a column's values are; none where they are nothing that a recording has.
    pub(super) fn of(column: &ColumnDescriptor) -> Option<Self> {
        // A list in a row has no one value.
        if column.max_rep_level() > 0 {
            return None;
        }
        let is_annotated = column.logical_type_ref().is_some();
        let annotated = match column.logical_type_ref() {
            Some(logical) => Self::of_logical(logical),
            None => Self::of_converted(column),
        };
        match (column.physical_type(), annotated) {
            (Type::INT32 | Type::INT64, Some(Self::Words)) => None,
            (Type::INT32 | Type::INT64, Some(annotated)) => Some(annotated),
            (Type::INT32 | Type::INT64, None) if is_annotated => None,
            (Type::BYTE_ARRAY, Some(Self::Words)) => Some(Self::Words),
            (Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY, Some(annotated @ Self::Decimal(_))) => {
                Some(annotated)
            }
            // What wrote words before types were named left nothing but their bytes.
            (Type::BYTE_ARRAY, None) if !is_annotated => Some(Self::Words),
            // Nobody says in which zone these count.
            (Type::INT96, _) => Some(Self::Instant {
                nanoseconds: 1,
                is_utc: false,
            }),
            (Type::INT32 | Type::INT64 | Type::FLOAT | Type::DOUBLE | Type::BOOLEAN, _) => {
                Some(Self::Number)
            }
            (Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY, _) => None,
        }
    }

    fn of_logical(logical: &LogicalType) -> Option<Self> {
        let unit = |unit: &TimeUnit| match unit {
            TimeUnit::MILLIS => 1_000_000,
            TimeUnit::MICROS => 1_000,
            TimeUnit::NANOS => 1,
        };
        match logical {
            LogicalType::Timestamp(timestamp) => Some(Self::Instant {
                nanoseconds: unit(&timestamp.unit),
                is_utc: timestamp.is_adjusted_to_u_t_c,
            }),
            LogicalType::Time(time) => Some(Self::Duration {
                nanoseconds: unit(&time.unit),
            }),
            LogicalType::Date => Some(Self::Date),
            LogicalType::Integer(integer) if !integer.is_signed => Some(Self::Unsigned),
            LogicalType::Integer(_) => Some(Self::Number),
            LogicalType::Decimal(decimal) => Some(Self::Decimal(decimal.scale)),
            LogicalType::String | LogicalType::Enum => Some(Self::Words),
            _ => None,
        }
    }

    fn of_converted(column: &ColumnDescriptor) -> Option<Self> {
        let utc = |nanoseconds| Self::Instant {
            nanoseconds,
            is_utc: true,
        };
        match column.converted_type() {
            ConvertedType::TIMESTAMP_MILLIS => Some(utc(1_000_000)),
            ConvertedType::TIMESTAMP_MICROS => Some(utc(1_000)),
            ConvertedType::DATE => Some(Self::Date),
            ConvertedType::UTF8 | ConvertedType::ENUM => Some(Self::Words),
            ConvertedType::UINT_8
            | ConvertedType::UINT_16
            | ConvertedType::UINT_32
            | ConvertedType::UINT_64 => Some(Self::Unsigned),
            ConvertedType::DECIMAL => Some(Self::Decimal(column.type_scale())),
            _ => None,
        }
    }

    /// Writes a whole number as what it means.
    pub(super) fn write_integer(self, text: &mut Vec<u8>, number: i64) -> io::Result<()> {
        match self {
            Self::Number | Self::Words => write!(text, "{number}"),
            Self::Unsigned => write!(text, "{}", number.cast_unsigned()),
            Self::Decimal(scale) => write!(text, "{number}e{}", -i64::from(scale)),
            Self::Date => {
                let day = SignedDuration::from_hours(number.clamp(-1_000_000, 1_000_000) * 24);
                write_instant(text, day, false)
            }
            Self::Instant {
                nanoseconds,
                is_utc,
            } => {
                let each = 1_000_000_000 / nanoseconds;
                let (seconds, rest) = (number.div_euclid(each), number.rem_euclid(each));
                let since = SignedDuration::new(seconds, (rest * nanoseconds) as i32);
                write_instant(text, since, is_utc)
            }
            Self::Duration { nanoseconds } => {
                write!(text, "{}", number as f64 * nanoseconds as f64 / 1e9)
            }
        }
    }

    /// Writes words, or a decimal number: a whole number in two's complement, its first byte the highest.
    pub(super) fn write_bytes(self, text: &mut Vec<u8>, bytes: &[u8]) -> io::Result<()> {
        let Self::Decimal(scale) = self else {
            push_field(text, &String::from_utf8_lossy(bytes));
            return Ok(());
        };
        let is_negative = bytes.first().is_some_and(|byte| *byte >= 0x80);
        let begin: i128 = if is_negative { -1 } else { 0 };
        let number = bytes.iter().try_fold(begin, |number, byte| {
            let higher = number.checked_mul(256)?;
            higher.checked_add(i128::from(*byte))
        });
        match number {
            Some(number) => write!(text, "{number}e{}", -i64::from(scale)),
            // Left for the reader of values to refuse at its row.
            None => write!(text, "a decimal number of {} bytes", bytes.len()),
        }
    }
}

fn write_instant(text: &mut Vec<u8>, since: SignedDuration, is_utc: bool) -> io::Result<()> {
    let Ok(instant) = Timestamp::from_duration(since) else {
        // Left for the reader of times to refuse at its row.
        let (seconds, rest) = (since.as_secs(), since.subsec_nanos());
        return write!(text, "{seconds}.{rest:09} s since 1970");
    };
    match is_utc {
        true => write!(text, "{instant}"),
        false => write!(text, "{}", TimeZone::UTC.to_datetime(instant)),
    }
}
