//! The header row: column names, their units, and which column is the time.

use super::super::ReadError;
use super::super::error::Faults;
use super::super::units::{self, Unit};
use super::{Options, fault, malformed};
use crate::recording::{MAX_SIGNALS, name_fault};
use ::csv::ByteRecord;
use std::collections::HashSet;

/// What the columns are.
#[derive(Debug)]
pub(super) struct Header {
    /// The columns in their order, without empty ones at the end of the line.
    pub(super) columns: Vec<Column>,
    /// The index of the time column.
    pub(super) time: usize,
    /// The faults of the header, to be reported with those of the rows.
    pub(super) faults: Faults,
}

/// A column of the table.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) name: String,
    pub(super) recorded_unit: String,
    pub(super) unit: Unit,
}

impl Header {
    /// Reads the header row.
    ///
    /// # Errors
    /// When the rows cannot be understood without it: it is not UTF-8, has no signals or too many,
    /// or lacks the time column.
    pub(super) fn parse(record: &ByteRecord, options: &Options) -> Result<Self, ReadError> {
        let line = record.position().map_or(1, ::csv::Position::line);
        let mut titles = Vec::with_capacity(record.len());
        for field in record {
            let title = std::str::from_utf8(field)
                .map_err(|_| malformed("not_utf8", line, "the header row is not UTF-8"))?;
            titles.push(title.trim());
        }
        while titles.last().is_some_and(|title| title.is_empty()) {
            titles.pop();
        }
        let mut faults = Faults::default();
        let time = time_column(&titles, options.time.as_deref());
        if titles.len() < 2 {
            let detail = "a time column and at least one signal column are needed, separated by \
                          comma, semicolon or tab";
            faults.malformed(fault("no_signals", line, None, detail.to_owned()));
        } else if titles.len() > MAX_SIGNALS + 1 {
            let detail = format!("{} columns; at most {MAX_SIGNALS} are read", titles.len());
            faults.invalid(fault("too_many_signals", line, None, detail));
        } else if time.is_none() {
            let wanted = options.time.as_deref().unwrap_or_default();
            let detail = format!("there is no time column `{wanted}`");
            faults.invalid(fault("no_time_column", line, None, detail));
        }
        let Some(time) = time.filter(|_| faults.is_empty()) else {
            return Err(faults.result().expect_err("only a fault leads here"));
        };
        let columns = columns(&titles, time, line, &mut faults);
        Ok(Self {
            columns,
            time,
            faults,
        })
    }
}

fn time_column(titles: &[&str], wanted: Option<&str>) -> Option<usize> {
    match wanted {
        None => Some(0),
        Some(wanted) => titles
            .iter()
            .position(|title| *title == wanted || name_and_unit(title).0 == wanted),
    }
}

fn columns(titles: &[&str], time: usize, line: u64, faults: &mut Faults) -> Vec<Column> {
    let mut seen = HashSet::new();
    let mut columns = Vec::with_capacity(titles.len());
    for (k, title) in titles.iter().enumerate() {
        let (name, recorded_unit) = name_and_unit(title);
        if let Some((code, detail)) = name_fault(name) {
            faults.invalid(fault(
                code,
                line,
                None,
                format!("column {}: {detail}", k + 1),
            ));
        } else if !seen.insert(name) {
            let detail = format!(
                "column {} has a name that stands further left already",
                k + 1
            );
            faults.invalid(fault("duplicate_name", line, Some(name), detail));
        }
        let unit = if k == time {
            Some(Unit::NONE)
        } else {
            units::parse(recorded_unit)
        };
        if unit.is_none() {
            let detail = format!(
                "unit `{recorded_unit}` is not known; known: {}",
                units::known()
            );
            faults.invalid(fault("unknown_unit", line, Some(name), detail));
        }
        columns.push(Column {
            name: name.to_owned(),
            recorded_unit: recorded_unit.to_owned(),
            unit: unit.unwrap_or(Unit::NONE),
        });
    }
    columns
}

/// Parts `position [mm]` into `position` and `mm`.
fn name_and_unit(title: &str) -> (&str, &str) {
    title
        .strip_suffix(']')
        .and_then(|open| open.rsplit_once('['))
        .map_or((title, ""), |(name, unit)| (name.trim(), unit.trim()))
}

/// The delimiter that stands most often in the header row, outside quotes.
pub(super) fn delimiter(head: &[u8]) -> u8 {
    let mut counts = [(b',', 0_usize), (b';', 0), (b'\t', 0)];
    let mut quoted = false;
    for byte in head.trim_ascii() {
        quoted ^= *byte == b'"';
        for (delimiter, count) in &mut counts {
            *count += usize::from(!quoted && byte == delimiter);
        }
    }
    counts
        .into_iter()
        .rev()
        .max_by_key(|(_, count)| *count)
        .map_or(b',', |(delimiter, _)| delimiter)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_stands_in_the_last_brackets() {
        assert_eq!(name_and_unit("position [mm]"), ("position", "mm"));
        assert_eq!(name_and_unit("spool [left] [ V ]"), ("spool [left]", "V"));
        assert_eq!(name_and_unit("spool [left] []"), ("spool [left]", ""));
        assert_eq!(name_and_unit("position"), ("position", ""));
        assert_eq!(name_and_unit("position]"), ("position]", ""));
    }

    #[test]
    fn the_delimiter_is_told_from_the_header() {
        assert_eq!(delimiter(b"time [s],a,b\r\n"), b',');
        assert_eq!(delimiter(b"time [s];\"a, b, c, d\";b\n"), b';');
        assert_eq!(delimiter(b"time [s]\ta\tb\n"), b'\t');
        assert_eq!(delimiter(b"time"), b',');
    }
}
