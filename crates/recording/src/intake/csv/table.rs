//! A column for each signal: fields to SI values, row by row, and everything that can be wrong with
//! them.

use super::super::cell::Cell;
use super::super::clock::Clock;
use super::super::column::SignalColumn;
use super::super::error::{ReadError, ReadingFaults, at_line, no_signals};
use super::super::options::{Options, ReadingPurpose};
use super::super::order::{CoarseTimes, MOST_TIMES_USUAL, TimeOrder};
use super::below::RowsBelow;
use super::fields::{is_data, line_of, not_utf8};
use super::header::Header;
use super::rows::is_empty;
use crate::columns::{SampleColumns, SampleSeries, Since};
use crate::{NewScratch, ReceivedRecording, Recording, TimeAxis, Warning};
use ::csv::ByteRecord;
use greybox_numerics::parsing::Fault;
use std::io;

/// The values read so far.
pub(super) struct CsvTable<'o> {
    options: &'o Options,
    columns: Vec<SignalColumn>,
    /// The names as the header has them.
    names: Vec<String>,
    /// The samples of each column; the time's are seconds from the first row.
    samples: SampleColumns,
    /// The row that is read.
    row: Vec<f64>,
    /// The rows of the last time, one behind the other: one that a later row may correct, or all of a time that is
    /// told too coarsely.
    last_rows: Vec<f64>,
    order: TimeOrder,
    time: usize,
    clock: Clock,
    /// The time of the last row [s].
    last: Option<f64>,
    /// The earliest and the latest of the times that are kept [s].
    span: (f64, f64),
    ran_backwards: bool,
    duplicates: usize,
    empty_rows: usize,
    below: RowsBelow,
    faults: ReadingFaults,
}

impl<'o> CsvTable<'o> {
    pub(super) fn new(header: Header, options: &'o Options, scratch: Option<NewScratch>) -> Self {
        let Header {
            columns,
            names,
            time,
            time_unit,
            faults,
        } = header;
        Self {
            options,
            samples: SampleColumns::new(columns.len(), scratch),
            row: Vec::with_capacity(columns.len()),
            last_rows: Vec::with_capacity(columns.len()),
            order: TimeOrder::default(),
            clock: Clock::new(&names[time], &time_unit, options),
            time,
            columns,
            names,
            last: None,
            span: (f64::INFINITY, f64::NEG_INFINITY),
            ran_backwards: false,
            duplicates: 0,
            empty_rows: 0,
            below: RowsBelow::default(),
            faults,
        }
    }

    /// Learns from the times of the first rows how they are written and how they follow each other. Rows that
    /// stand there twice are no rows of a time that is told too coarsely.
    pub(super) fn look_ahead(&mut self, times: &[String], are_repeated: bool) {
        self.clock.look_ahead(times.iter().map(String::as_str));
        let mut clock = self.clock.clone();
        let mut last = None;
        let instants = times.iter().filter_map(|time| {
            last = clock.read(&Cell::Text(time), last).ok().or(last);
            last
        });
        self.order = TimeOrder::of(&instants.collect::<Vec<f64>>());
        let is_stream = self.options.purpose == ReadingPurpose::Stream;
        let is_twice = |coarse: &CoarseTimes| are_repeated && coarse.rows == 2;
        self.order.coarse = self
            .order
            .coarse
            .filter(|coarse| !is_stream && !is_twice(coarse));
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
        if is_empty(record) {
            self.empty_rows += 1;
            return Ok(());
        }
        let line = line_of(record);
        let wanted = self.columns.len();
        let surplus = record
            .iter()
            .skip(wanted)
            .any(|field| !field.trim_ascii().is_empty());
        if record.len() < wanted || surplus {
            let detail = format!(
                "{} fields where the header has {wanted}; `skip={line}` leaves the line out",
                record.len()
            );
            let mut faults = ReadingFaults::default();
            faults.malformed(at_line(line, None, "ragged_row", detail));
            self.take_faults_of(record, faults);
            return Ok(());
        }
        let Ok(time) = std::str::from_utf8(&record[self.time]) else {
            self.faults.malformed(not_utf8(line));
            return Ok(());
        };
        match self.clock.read(&Cell::Text(time), self.last) {
            Err((code, detail)) => {
                let column = Some(self.names[self.time].as_str());
                let mut faults = ReadingFaults::default();
                faults.invalid(at_line(line, column, code, detail));
                self.take_faults_of(record, faults);
            }
            Ok(instant) => {
                self.faults.extend(self.below.take_faults());
                if self.is_next(instant, line) {
                    self.push_last_rows(false)?;
                    self.last = Some(instant);
                    self.read_row(record, instant, line);
                    std::mem::swap(&mut self.row, &mut self.last_rows);
                } else if self.last == Some(instant) {
                    self.take_same(record, instant, line);
                }
            }
        }
        Ok(())
    }

    /// Takes the faults of a row that is none of the table. Below the data of a whole text it may be a row of sums or
    /// of words, or the row at which the text was cut.
    fn take_faults_of(&mut self, record: &ByteRecord, faults: ReadingFaults) {
        let field = |field: &[u8]| String::from_utf8_lossy(field).trim().to_owned();
        let is_number = |text: String| !text.is_empty() && is_data(&text);
        let mut beside = record.iter().enumerate();
        let has_numbers = beside.any(|(k, text)| k != self.time && is_number(field(text)));
        let time = field(record.get(self.time).unwrap_or_default());
        let is_short = record.len() < self.columns.len();
        let may_stand_below = self.options.purpose == ReadingPurpose::Recording
            && self.last.is_some()
            && (is_short || !has_numbers || !time.contains(char::is_numeric));
        if may_stand_below {
            self.below.take(record, faults);
        } else {
            self.faults.extend(self.below.take_faults());
            self.faults.extend(faults);
        }
        if self.below.is_long() {
            self.faults.extend(self.below.take_faults());
        }
    }

    /// Takes a row of the time of the row before.
    fn take_same(&mut self, record: &ByteRecord, instant: f64, line: u64) {
        if let Some(coarse) = self.order.coarse {
            let most = MOST_TIMES_USUAL * coarse.rows;
            if self.last_rows.len() >= most * self.columns.len() {
                let detail = format!(
                    "more than {most} rows have this time where {} are usual; write times with more digits",
                    coarse.rows
                );
                let column = Some(self.names[self.time].as_str());
                let fault = at_line(line, column, "repeated_time", detail);
                return self.faults.invalid(fault);
            }
            self.read_row(record, instant, line);
            self.last_rows.extend_from_slice(&self.row);
        } else if self.options.purpose.is_later_right() {
            self.read_row(record, instant, line);
            let corrected = self.last_rows.iter_mut().zip(&self.row);
            for (value, later) in corrected.filter(|(_, later)| !later.is_nan()) {
                *value = *later;
            }
        }
    }

    /// Whether the row comes after those before it; counts and reports those that do not.
    fn is_next(&mut self, instant: f64, line: u64) -> bool {
        let Some(last) = self.last else {
            return true;
        };
        let follows = self.order.follows(instant, last);
        let has_room = |coarse: CoarseTimes| coarse.has_room(last, instant);
        if follows && !self.order.coarse.is_none_or(has_room) {
            let detail = "several rows have each time, and this time comes too soon for those before it; write \
                          times with more digits";
            let column = Some(self.names[self.time].as_str());
            let fault = at_line(line, column, "repeated_time", detail);
            self.faults.invalid(fault);
        } else if instant == last {
            self.duplicates += usize::from(self.order.coarse.is_none());
        } else if !follows && !self.ran_backwards {
            self.ran_backwards = true;
            let how = match self.order.is_newest_first {
                true => "forwards where the newest row came first",
                false => "backwards",
            };
            let detail = format!("time runs {how}: {instant} s after {last} s from the first row");
            let column = Some(self.names[self.time].as_str());
            self.faults
                .invalid(at_line(line, column, "time_backwards", detail));
        }
        follows
    }

    /// Reads the fields of a row as SI values.
    fn read_row(&mut self, record: &ByteRecord, instant: f64, line: u64) {
        self.row.clear();
        for (k, field) in record.iter().take(self.columns.len()).enumerate() {
            if k == self.time {
                self.row.push(instant);
                continue;
            }
            let Ok(text) = std::str::from_utf8(field) else {
                self.faults.malformed(not_utf8(line));
                return;
            };
            let name = &self.names[k];
            let place = |code, detail| at_line(line, Some(name), code, detail);
            let value = self.columns[k].take(&Cell::Text(text), self.options, place);
            self.row.push(value);
        }
    }

    /// Keeps the rows that no later row can change any more.
    fn push_last_rows(&mut self, is_end: bool) -> io::Result<()> {
        // With a fault there will be no recording.
        if !self.faults.is_empty() {
            return Ok(());
        }
        let count = self.last_rows.len() / self.columns.len();
        let is_oldest = match self.order.is_newest_first {
            true => is_end,
            false => self.samples.rows() == 0,
        };
        for (k, row) in self.last_rows.chunks_mut(self.columns.len()).enumerate() {
            let k = if self.order.is_newest_first {
                count - 1 - k
            } else {
                k
            };
            let coarse = self.order.coarse;
            row[self.time] += coarse.map_or(0.0, |coarse| coarse.offset(k, count, is_oldest));
            self.samples.push(row)?;
            self.span = (
                self.span.0.min(row[self.time]),
                self.span.1.max(row[self.time]),
            );
        }
        Ok(())
    }

    /// The recording, or all faults.
    pub(super) fn into_received(mut self) -> Result<ReceivedRecording, ReadError> {
        self.push_last_rows(true).map_err(ReadError::Scratch)?;
        let samples = self.samples.rows();
        self.check(samples);
        std::mem::take(&mut self.faults).result()?;
        let mut notes = self.notes();
        notes.extend(self.clock.notes());
        let columns = self.columns.into_iter().enumerate();
        let mut signals = Vec::with_capacity(columns.len());
        for (k, column) in columns.filter(|(k, _)| *k != self.time) {
            notes.extend(column.notes());
            for stand_in in column.stand_ins() {
                self.samples.leave_out(k, stand_in);
            }
            if column.is_signal() {
                signals.push(column.into_named(Vec::new(), k));
            }
        }
        if self.order.is_newest_first {
            self.samples.reverse();
        }
        let (first, last) = self.span;
        let mut instants = Since {
            first,
            is_exact: self.clock.is_absolute(),
            instants: self.samples.column(self.time),
        };
        let time = match self.options.purpose {
            ReadingPurpose::Recording => {
                TimeAxis::of_series(&mut instants, samples, last - first, self.clock.scale())
            }
            ReadingPurpose::Stream => instants.collect().map(TimeAxis::Instants),
        };
        Ok(ReceivedRecording {
            header: Recording {
                double_hour: self.clock.double_hour(first),
                own_instants: false,
                name: self.options.name.clone(),
                start: self.clock.start(first),
                zone: self.clock.zone(),
                source: self.options.source("wide_csv"),
                time: time.map_err(ReadError::Scratch)?,
                signals,
                notes,
            },
            columns: self.samples,
        })
    }

    /// Warnings about the rows.
    fn notes(&self) -> Vec<Warning> {
        let mut notes = Vec::new();
        if self.duplicates > 0 {
            notes.push(self.options.purpose.duplicate_time(self.duplicates));
        }
        notes.extend(self.order.coarse.map(CoarseTimes::note));
        if self.order.is_newest_first {
            let detail =
                "the newest row came first; the rows were put in the order of time".to_owned();
            notes.push(Warning::of_recording("newest_first", detail));
        }
        if self.empty_rows > 0 {
            let detail = format!("{} empty rows skipped", self.empty_rows);
            notes.push(Warning::of_recording("empty_rows", detail));
        }
        notes.extend(self.below.note());
        notes
    }

    /// What can be told at the end only.
    fn check(&mut self, samples: usize) {
        let least = self.options.purpose.least_instants();
        if samples < least {
            self.faults.extend(self.below.take_faults());
        }
        let signals = self
            .names
            .iter()
            .enumerate()
            .filter(|(k, _)| *k != self.time);
        let names: Vec<&str> = signals.map(|(_, name)| name.as_str()).collect();
        self.options.check_names(&names, &mut self.faults);
        let signals = self.columns.iter_mut().enumerate();
        let mut n_signals = 0;
        for (_, column) in signals.filter(|(k, _)| *k != self.time) {
            n_signals += usize::from(column.is_signal());
            self.faults.extend(column.faults());
        }
        if n_signals == 0 && self.faults.is_empty() {
            let text = self.columns.iter().find_map(SignalColumn::first_text);
            let fault = no_signals("no column but the time has a number in it", text);
            self.faults.invalid(fault);
        } else if self.faults.is_empty()
            && self.options.purpose == ReadingPurpose::Recording
            && self.duplicates > samples
        {
            let detail = format!(
                "{} of {} rows have the time of the row before, and nothing says when each was taken: write times \
                 with more digits, or say another column with `time`",
                self.duplicates,
                self.duplicates + samples
            );
            self.faults
                .invalid(Fault::of_whole("repeated_time", detail));
        } else if self.faults.is_empty() && samples < least {
            let detail = format!("{samples} rows with distinct times; at least {least} are needed");
            self.faults
                .invalid(at_line(1, None, "too_few_samples", detail));
        }
    }
}
