//! The column of a table that says when a row was taken, as PostgreSQL compares and writes it.

use jiff::Timestamp;

use crate::collect::cursors::nanoseconds;
use crate::collect::error::CollectError;
use crate::collect::query::value;
use crate::collect::series::{SourceSeries, TIME_UNITS};

/// What a column of times holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TimeColumn {
    /// Instants.
    Instant,
    /// Times of day of a zone.
    Local(String),
    /// Numbers of a unit since 1970.
    Count {
        /// The type of the column.
        column: String,
        /// The unit, as the option names it.
        unit: &'static str,
        /// Nanoseconds of the unit.
        nanoseconds: i64,
    },
}

impl TimeColumn {
    /// The column of a type, with what the sources file says of it.
    pub(super) fn of(column: &str, series: &SourceSeries) -> Result<Self, CollectError> {
        let refusal = |detail: String| Err(CollectError::SourceRefuses(detail));
        let time = &series.time;
        match column {
            "timestamp with time zone" => Ok(Self::Instant),
            "timestamp without time zone" => match &series.zone {
                Some(zone) => Ok(Self::Local(zone.clone())),
                None => refusal(format!(
                    "`{time}` is a time without a zone: say `zone = \"Europe/Berlin\"`, the zone of the clock"
                )),
            },
            "bigint" | "integer" | "numeric" | "double precision" => match &series.time_unit {
                Some(unit) => Self::count(column, unit),
                None => refusal(format!(
                    "`{time}` is a number: say `time_unit = \"ms\"`, the unit since 1970 (s, ms, us or ns)"
                )),
            },
            _ => refusal(format!(
                "`{time}` is of the type {column}, which is no time"
            )),
        }
    }

    /// Numbers of a unit since 1970 in a column of a type.
    pub(super) fn count(column: &str, unit: &str) -> Result<Self, CollectError> {
        let entry = TIME_UNITS.iter().find(|(name, _)| *name == unit);
        let entry = entry.ok_or_else(|| {
            CollectError::SourceRefuses(format!("`{unit}` is none of the units s, ms, us and ns"))
        });
        entry.map(|(unit, nanoseconds)| Self::Count {
            column: column.to_owned(),
            unit,
            nanoseconds: *nanoseconds,
        })
    }

    /// The option by which the server understands the column.
    pub(super) fn option(&self) -> Option<(&'static str, &str)> {
        match self {
            Self::Instant => None,
            Self::Local(zone) => Some(("tz", zone)),
            Self::Count { unit, .. } => Some(("time_unit", unit)),
        }
    }

    /// An instant as a value of the column. Values of whole numbers are rounded down.
    pub(super) fn value(&self, instant: Timestamp) -> String {
        let written = value(&instant.to_string());
        match self {
            Self::Instant => format!("TIMESTAMPTZ {written}"),
            Self::Local(zone) => format!("(TIMESTAMPTZ {written} AT TIME ZONE {})", value(zone)),
            Self::Count {
                column,
                nanoseconds: unit,
                ..
            } => {
                let count = nanoseconds(instant);
                match &**column {
                    "bigint" | "integer" => format!("{}", count.div_euclid(*unit)),
                    _ => format!("({count}::numeric / {unit})::{column}"),
                }
            }
        }
    }

    /// An expression of the column's type in nanoseconds since 1970.
    pub(super) fn nanoseconds(&self, expression: &str) -> String {
        match self {
            Self::Instant => format!("(extract(epoch FROM {expression}) * 1000000000)::bigint"),
            Self::Local(zone) => {
                let zone = value(zone);
                format!(
                    "(extract(epoch FROM {expression} AT TIME ZONE {zone}) * 1000000000)::bigint"
                )
            }
            Self::Count { nanoseconds, .. } => {
                // The text of a double has all of its digits, its cast to a numeric 15 of them.
                format!("({expression}::text::numeric * {nanoseconds})::bigint")
            }
        }
    }
}
