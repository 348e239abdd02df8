//! The time column: numbers in a unit of time, or timestamps. Its first entry decides which.

use super::super::units::{self, Unit};
use jiff::Timestamp;

/// What the time column turned out to be.
#[derive(Debug)]
pub(super) enum Clock {
    /// Nothing was read yet.
    Unread {
        /// The unit in the header.
        recorded_unit: String,
    },
    /// Numbers in a unit of time.
    Numbers {
        unit: Unit,
        first: f64,
        largest: f64,
    },
    /// RFC 3339 timestamps.
    Stamps { first: Timestamp },
}

/// A code and a sentence.
pub(super) type Fault = (&'static str, String);

impl Clock {
    pub(super) fn new(recorded_unit: &str) -> Self {
        Self::Unread {
            recorded_unit: recorded_unit.to_owned(),
        }
    }

    /// The time of a row in seconds from the first row.
    ///
    /// # Errors
    /// A sentence on what is wrong with `text`.
    pub(super) fn read(&mut self, text: &[u8]) -> Result<f64, Fault> {
        let text = std::str::from_utf8(text)
            .map_err(|_| ("not_a_time", "the time is not UTF-8 text".to_owned()))?
            .trim();
        if text.is_empty() {
            return Err(("missing_time", "the row has values but no time".to_owned()));
        }
        match self {
            Self::Unread { recorded_unit } => {
                *self = first(text, recorded_unit)?;
                Ok(0.0)
            }
            Self::Numbers {
                unit,
                first,
                largest,
            } => {
                let value = number(text)?;
                *largest = largest.max(value.abs());
                let time = (value - *first) * unit.factor;
                if time.is_finite() {
                    Ok(time)
                } else {
                    Err(not_a_time(text))
                }
            }
            Self::Stamps { first } => Ok(seconds_between(*first, stamp(text)?)),
        }
    }

    /// The instant of the first row.
    pub(super) fn start(&self) -> Option<Timestamp> {
        match self {
            Self::Stamps { first } => Some(*first),
            _ => None,
        }
    }

    /// The largest number that was read `[s]`.
    pub(super) fn scale(&self) -> f64 {
        match self {
            Self::Numbers { unit, largest, .. } => largest * unit.factor,
            _ => 0.0,
        }
    }
}

fn first(text: &str, recorded_unit: &str) -> Result<Clock, Fault> {
    let looks_like_a_stamp = text
        .bytes()
        .skip(1)
        .any(|byte| matches!(byte, b'-' | b':' | b'/'))
        && !text.contains(['e', 'E']);
    if !looks_like_a_stamp {
        let unit = units::parse_time(recorded_unit).ok_or_else(|| {
            let known = units::known_times();
            let detail = format!("unit `{recorded_unit}` is not a time; known: {known}");
            ("unknown_unit", detail)
        })?;
        let first = number(text)?;
        return Ok(Clock::Numbers {
            unit,
            first,
            largest: first.abs(),
        });
    }
    let first = stamp(text)?;
    let named = recorded_unit.to_ascii_lowercase().replace(' ', "");
    if !matches!(named.as_str(), "" | "rfc3339" | "iso8601" | "utc") {
        let detail = format!("`{text}` is a timestamp, but the column's unit is `{recorded_unit}`");
        return Err(("unknown_unit", detail));
    }
    Ok(Clock::Stamps { first })
}

fn number(text: &str) -> Result<f64, Fault> {
    let value: Option<f64> = text.parse().ok();
    value
        .filter(|value| value.is_finite())
        .ok_or_else(|| not_a_time(text))
}

fn not_a_time(text: &str) -> Fault {
    (
        "not_a_time",
        format!("`{text}` is not a finite number, as a time in seconds is"),
    )
}

fn stamp(text: &str) -> Result<Timestamp, Fault> {
    text.parse::<Timestamp>().map_err(|_| {
        if text.parse::<jiff::civil::DateTime>().is_ok() {
            let detail = format!(
                "timestamp `{text}` has no time zone offset; write it as \
                 2026-03-02T08:15:00Z or 2026-03-02T09:15:00+01:00"
            );
            ("no_offset", detail)
        } else {
            let detail = format!(
                "`{text}` is neither a number nor an RFC 3339 timestamp such as \
                 2026-03-02T08:15:00Z"
            );
            ("not_a_time", detail)
        }
    })
}

fn seconds_between(first: Timestamp, later: Timestamp) -> f64 {
    (later.as_nanosecond() - first.as_nanosecond()) as f64 / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn code(clock: &mut Clock, text: &str) -> &'static str {
        clock.read(text.as_bytes()).unwrap_err().0
    }

    #[test]
    fn numbers_count_from_the_first_row_in_the_unit_of_the_header() {
        let mut clock = Clock::new("ms");
        assert_eq!(clock.read(b"1500"), Ok(0.0));
        assert_eq!(clock.read(b" 1750 "), Ok(0.25));
        assert_eq!(code(&mut clock, "2026-03-02T08:15:00Z"), "not_a_time");
        assert_eq!(code(&mut clock, ""), "missing_time");
        assert_eq!(code(&mut clock, "inf"), "not_a_time");
    }

    #[test]
    fn negative_and_exponent_notation_are_numbers() {
        let mut clock = Clock::new("s");
        assert_eq!(clock.read(b"-1e-3"), Ok(0.0));
        assert_eq!(clock.read(b"1e-3"), Ok(0.002));
    }

    #[test]
    fn timestamps_with_different_offsets_are_compared_as_instants() {
        let mut clock = Clock::new("");
        assert_eq!(clock.read(b"2026-03-02T08:15:00Z"), Ok(0.0));
        assert_eq!(clock.read(b"2026-03-02T09:15:00.25+01:00"), Ok(0.25));
        assert_eq!(clock.start(), Some("2026-03-02T08:15:00Z".parse().unwrap()));
    }

    #[test]
    fn a_timestamp_that_could_be_anywhere_is_refused() {
        for text in ["2026-03-02T08:15:00", "2026-03-02 08:15:00", "2026-03-02"] {
            assert_eq!(code(&mut Clock::new(""), text), "no_offset", "{text}");
        }
        assert_eq!(code(&mut Clock::new(""), "02/03/2026"), "not_a_time");
    }

    #[test]
    fn a_unit_that_is_no_time_is_refused() {
        assert_eq!(code(&mut Clock::new("mm"), "0.0"), "unknown_unit");
        assert_eq!(
            code(&mut Clock::new("s"), "2026-03-02T08:15:00Z"),
            "unknown_unit"
        );
    }
}
