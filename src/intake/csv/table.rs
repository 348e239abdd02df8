//! The rows: fields to SI values, and everything that can be wrong with them.

use super::super::ReadError;
use super::super::error::Faults;
use super::super::units::Unit;
use super::clock::Clock;
use super::fault;
use super::header::{Column, Header};
use crate::recording::columns::Columns;
use crate::recording::{MIN_SAMPLES, Named, NewScratch, Received, TimeAxis, Warning};
use ::csv::ByteRecord;
use std::io;

/// The longest piece of a field that a fault repeats, in characters.
const QUOTED_CHARACTERS: usize = 40;

/// The values read so far.
pub(super) struct Table {
    columns: Vec<Column>,
    /// The samples of each column; the time's are seconds from the first row.
    samples: Columns,
    row: Vec<f64>,
    time: usize,
    clock: Clock,
    /// The time of the last row [s].
    last: Option<f64>,
    /// Fields may be decimal numbers with a comma, which deserves its own advice.
    comma_is_free: bool,
    ran_backwards: bool,
    duplicates: usize,
    empty_rows: usize,
    faults: Faults,
}

impl Table {
    pub(super) fn new(header: Header, delimiter: u8, scratch: Option<NewScratch>) -> Self {
        let Header {
            columns,
            time,
            faults,
        } = header;
        Self {
            samples: Columns::new(columns.len(), scratch),
            row: Vec::with_capacity(columns.len()),
            time,
            clock: Clock::new(&columns[time].recorded_unit),
            columns,
            last: None,
            comma_is_free: delimiter != b',',
            ran_backwards: false,
            duplicates: 0,
            empty_rows: 0,
            faults,
        }
    }

    /// Whether so much is wrong that no more rows need to be read.
    pub(super) fn is_full(&self) -> bool {
        self.faults.full()
    }

    /// Takes a row.
    ///
    /// # Errors
    /// When the scratch fails.
    pub(super) fn push(&mut self, record: &ByteRecord) -> io::Result<()> {
        if record.iter().all(|field| field.trim_ascii().is_empty()) {
            self.empty_rows += 1;
            return Ok(());
        }
        let line = record.position().map_or(0, ::csv::Position::line);
        let wanted = self.columns.len();
        let surplus = record
            .iter()
            .skip(wanted)
            .any(|field| !field.trim_ascii().is_empty());
        if record.len() < wanted || surplus {
            let detail = format!("{} fields where the header has {wanted}", record.len());
            self.faults
                .malformed(fault("ragged_row", line, None, detail));
            return Ok(());
        }
        match self.clock.read(&record[self.time]) {
            Err((code, detail)) => {
                let column = Some(self.columns[self.time].name.as_str());
                self.faults.invalid(fault(code, line, column, detail));
            }
            Ok(instant) if self.is_next(instant, line) => {
                self.last = Some(instant);
                self.push_values(record, instant, line)?;
            }
            Ok(_) => {}
        }
        Ok(())
    }

    /// Whether the row comes after those before it; counts and reports those that do not.
    fn is_next(&mut self, instant: f64, line: u64) -> bool {
        let Some(last) = self.last else {
            return true;
        };
        if instant == last {
            self.duplicates += 1;
        } else if instant < last && !self.ran_backwards {
            self.ran_backwards = true;
            let detail =
                format!("time runs backwards: {instant} s after {last} s from the first row");
            let column = Some(self.columns[self.time].name.as_str());
            self.faults
                .invalid(fault("time_backwards", line, column, detail));
        }
        instant > last
    }

    fn push_values(&mut self, record: &ByteRecord, instant: f64, line: u64) -> io::Result<()> {
        self.row.clear();
        for (k, field) in record.iter().take(self.columns.len()).enumerate() {
            if k == self.time {
                self.row.push(instant);
                continue;
            }
            match value(field, self.columns[k].unit) {
                Ok(value) => self.row.push(value),
                Err((code, mut detail)) => {
                    detail.push_str(self.advice(field));
                    let column = Some(self.columns[k].name.as_str());
                    self.faults.invalid(fault(code, line, column, detail));
                }
            }
        }
        // With a fault there will be no recording.
        if self.faults.is_empty() {
            self.samples.push(&self.row)?;
        }
        Ok(())
    }

    /// What to do about a number with a decimal comma.
    fn advice(&self, field: &[u8]) -> &'static str {
        if self.comma_is_free && field.contains(&b',') {
            "; write a decimal point, not a comma"
        } else {
            ""
        }
    }

    /// The recording, or all faults.
    pub(super) fn into_received(mut self, name: Option<String>) -> Result<Received, ReadError> {
        let samples = self.samples.rows();
        if self.faults.is_empty() && samples < MIN_SAMPLES {
            let detail =
                format!("{samples} rows with distinct times; at least {MIN_SAMPLES} are needed");
            self.faults
                .invalid(fault("too_few_samples", 1, None, detail));
        }
        self.faults.result()?;
        let signals = self.columns.into_iter().enumerate();
        let signals = signals
            .filter(|(k, _)| *k != self.time)
            .map(|(k, column)| Named {
                name: column.name,
                unit: column.unit.si.to_owned(),
                recorded_unit: column.recorded_unit,
                column: k,
            })
            .collect();
        let end = (samples, self.last.unwrap_or(0.0));
        let mut instants = self.samples.column(self.time);
        let time = TimeAxis::of_series(&mut instants, end, self.clock.scale());
        Ok(Received {
            name,
            start: self.clock.start(),
            time: time.map_err(ReadError::Scratch)?,
            signals,
            notes: notes(self.duplicates, self.empty_rows),
            columns: self.samples,
        })
    }
}

fn notes(duplicates: usize, empty_rows: usize) -> Vec<Warning> {
    let mut notes = Vec::new();
    if duplicates > 0 {
        notes.push(Warning::duplicate_time(duplicates));
    }
    if empty_rows > 0 {
        notes.push(Warning::of_recording(
            "empty_rows",
            format!("{empty_rows} empty rows skipped"),
        ));
    }
    notes
}

/// The SI value of a field; NaN for a missing sample.
fn value(field: &[u8], unit: Unit) -> Result<f64, (&'static str, String)> {
    let field = field.trim_ascii();
    if field.is_empty() {
        return Ok(f64::NAN);
    }
    let parsed = std::str::from_utf8(field)
        .ok()
        .and_then(|text| text.parse::<f64>().ok());
    let Some(parsed) = parsed else {
        return Err((
            "not_a_number",
            format!("`{}` is not a number", excerpt(field)),
        ));
    };
    let value = unit.to_si(parsed);
    if value.is_finite() || parsed.is_nan() {
        Ok(value)
    } else {
        Err((
            "not_finite",
            format!("`{}` is not a finite number", excerpt(field)),
        ))
    }
}

fn excerpt(field: &[u8]) -> String {
    let text = String::from_utf8_lossy(field);
    let start: String = text.chars().take(QUOTED_CHARACTERS).collect();
    if start.len() < text.len() {
        format!("{start}…")
    } else {
        start
    }
}
