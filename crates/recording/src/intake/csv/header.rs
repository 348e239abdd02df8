//! The header row: column names, their units, and which column is the time.

use super::super::column::SignalColumn;
use super::super::error::{ReadingFaults, at_line, invalid};
use super::super::options::Options;
use super::super::{ReadError, title};
use super::fields::{is_data, line_of, texts, time_name_and_unit};
use crate::{MAX_SIGNALS, name_fault};
use ::csv::ByteRecord;
use greybox_numerics::parsing::Fault;
use std::collections::HashSet;

/// What the columns are.
#[derive(Debug)]
pub(super) struct Header {
    /// The columns in their order, without empty ones at the end of the line; the time's is not
    /// used.
    pub(super) columns: Vec<SignalColumn>,
    /// The names as the header has them.
    pub(super) names: Vec<String>,
    /// The index of the time column.
    pub(super) time: usize,
    /// The unit of the time column, as its title has it.
    pub(super) time_unit: String,
    /// The faults of the header, to be reported with those of the rows.
    pub(super) faults: ReadingFaults,
}

impl Header {
    /// Reads the header row.
    ///
    /// # Errors
    /// When the rows cannot be understood without it: it is not UTF-8, has no names, no signals or
    /// too many, or lacks the time column.
    pub(super) fn parse(
        record: &ByteRecord,
        likely_time: usize,
        options: &Options,
    ) -> Result<Self, ReadError> {
        let line = line_of(record);
        let mut titles = texts(record)?;
        while titles.last().is_some_and(|title| title.is_empty()) {
            titles.pop();
        }
        let mut faults = ReadingFaults::default();
        let time = match options.time.as_deref() {
            Some(wanted) => time_column(&titles, wanted),
            None => Some(likely_time.min(titles.len().saturating_sub(1))),
        };
        if titles.len() < 2 {
            let detail = "a time column and at least one signal column are needed, separated by \
                          comma, semicolon, tab, `|` or blanks";
            faults.malformed(at_line(line, None, "no_signals", detail));
        } else if titles.len() > MAX_SIGNALS + 1 {
            let detail = format!("{} columns; at most {MAX_SIGNALS} are read", titles.len());
            faults.invalid(at_line(line, None, "too_many_signals", detail));
        } else if let Some(first) = titles.iter().find(|_| titles.iter().all(|t| is_data(t))) {
            let detail = format!(
                "the first row has `{first}` where a name is expected: put a row of names before it, or say \
                 `header_row=none`, and the columns are called `column_1`, `column_2` and so on"
            );
            faults.invalid(Fault {
                parameter: Some("header_row".into()),
                ..at_line(line, None, "no_header", detail)
            });
        } else if time.is_none() {
            let wanted = options.time.as_deref().unwrap_or_default();
            let detail = format!("there is no time column `{wanted}`");
            faults.invalid(at_line(line, None, "no_time_column", detail));
        }
        let Some(time) = time.filter(|_| faults.is_empty()) else {
            faults.result()?;
            let fault = at_line(line, None, "no_time_column", "there is no time column");
            return Err(invalid(fault));
        };
        let (_, time_unit) = time_name_and_unit(titles[time]);
        let (columns, names) = columns(&titles, time, line, options, &mut faults);
        Ok(Self {
            columns,
            names,
            time,
            time_unit: time_unit.to_owned(),
            faults,
        })
    }
}

/// The column with that title.
pub(super) fn time_column(titles: &[&str], wanted: &str) -> Option<usize> {
    titles
        .iter()
        .position(|title| *title == wanted || time_name_and_unit(title).0 == wanted)
}

fn columns(
    titles: &[&str],
    time: usize,
    line: u64,
    options: &Options,
    faults: &mut ReadingFaults,
) -> (Vec<SignalColumn>, Vec<String>) {
    let mut seen = HashSet::new();
    let mut columns = Vec::with_capacity(titles.len());
    let mut names = Vec::with_capacity(titles.len());
    let signals = titles.iter().enumerate().filter(|(k, _)| *k != time);
    let signals: Vec<&str> = signals.map(|(_, title)| *title).collect();
    let mut units = title::units_behind(&signals)
        .unwrap_or_default()
        .into_iter();
    for (k, title) in titles.iter().enumerate() {
        let (name, _) = title::name_and_unit(title);
        if k == time {
            columns.push(SignalColumn::named(name, &Options::default()));
            names.push(name.to_owned());
            seen.insert(name.to_owned());
            continue;
        }
        let mut column = SignalColumn::titled(title, options).unwrap_or_else(|wrong| {
            let (column, detail) = *wrong;
            faults.invalid(at_line(line, Some(name), "unknown_unit", detail));
            column
        });
        if let Some(unit) = units.next().filter(|_| !options.units.contains_key(*title)) {
            column.set_unit_of_name(unit);
        }
        if let Some((code, detail)) = name_fault(&column.name) {
            let detail = format!("column {}: {detail}", k + 1);
            faults.invalid(at_line(line, None, code, detail));
        } else if !seen.insert(column.name.clone()) {
            let detail = format!(
                "column {} has a name that stands further left already",
                k + 1
            );
            faults.invalid(at_line(line, Some(name), "duplicate_name", detail));
        }
        columns.push(column);
        names.push(name.to_owned());
    }
    (columns, names)
}
