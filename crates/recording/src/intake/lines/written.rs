//! Lines that an agent writes, spread over streams by the rules of a mapping.
//!
//! A line is taken whole or not at all. A line that is wrong keeps no other line out: what is wrong is told
//! beside what was taken. Series that no rule names are listed and not taken. Each sample keeps the instant
//! of its line to the nanosecond; of two samples of a signal at one instant the later line counts.

use super::mapping::Mapping;
use super::point::{FieldValue, LineFault, ProtocolLine};
use super::reader::LineReader;
use crate::intake::error::ReadError;
use crate::intake::memory::Memory;
use crate::{Batch, Class, QualityReport, RowColumn, RowSignal, Rows};
use routes::Routes;
use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use unmapped::UnmappedList;
pub use unmapped::{LastValue, MAX_UNMAPPED, UnmappedSeries};

mod routes;
mod unmapped;

/// Lines of which an answer tells the fault; those beyond are counted.
const TOLD_LINES: usize = 20;
/// The characters of a line that are repeated where something is wrong with it.
const SHOWN_CHARACTERS: usize = 200;
/// Bytes of a sample while it is sorted.
const SAMPLE_BYTES: u64 = 2 * size_of::<LineSample>() as u64;
/// Bytes of an instant of a row, and of a signal at it: the value and its class.
const INSTANT_BYTES: u64 = 8;
const VALUE_BYTES: u64 = 9;
/// What a sender can do whose samples take too much memory.
const INSTEAD: &str = "send fewer lines at once";

/// The unit of the stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Precision {
    /// How long the unit is `[ns]`.
    nanoseconds: i64,
}

impl Precision {
    /// Nanoseconds, which stamps are in where nothing says otherwise.
    pub const NANOSECONDS: Self = Self { nanoseconds: 1 };

    /// The unit that InfluxDB calls so: `n`, `ns`, `u`, `us`, `µ`, `ms`, `s`, `m` or `h`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let nanoseconds = match name {
            "n" | "ns" => 1,
            "u" | "us" | "µ" => 1_000,
            "ms" => 1_000_000,
            "s" => 1_000_000_000,
            "m" => 60 * 1_000_000_000,
            "h" => 3600 * 1_000_000_000,
            _ => return None,
        };
        Some(Self { nanoseconds })
    }

    /// The instant of a stamp, nanoseconds since 1970.
    fn instant(self, stamp: &str) -> Result<i64, LineFault> {
        if stamp.is_empty() {
            return Err(LineFault::MissingStamp);
        }
        let whole: i64 = stamp.parse().map_err(|_| LineFault::BadStamp)?;
        let instant = whole.checked_mul(self.nanoseconds);
        instant.ok_or(LineFault::StampOutOfRange)
    }
}

/// The samples of a text of lines, and the lines and series that were not taken.
#[derive(Debug, Default)]
pub struct WrittenLines {
    /// The samples for each stream, in the order of the streams' names.
    pub batches: Vec<StreamBatch>,
    /// Series that no rule names, [`MAX_UNMAPPED`] at the most.
    pub unmapped: Vec<UnmappedSeries>,
    /// Samples of further series that no rule names.
    pub unlisted: u64,
    /// Lines that were taken.
    pub taken: u64,
    /// Lines that are wrong.
    pub refused: RefusedLines,
}

/// Samples for one stream.
#[derive(Debug)]
pub struct StreamBatch {
    /// The name of the stream.
    pub stream: String,
    /// The lines that the samples are of.
    pub lines: u64,
    /// The samples.
    pub batch: Batch,
}

/// Lines that were not taken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RefusedLines {
    /// How many lines there are.
    pub lines: u64,
    /// Sentences on the first of them.
    pub told: Vec<String>,
}

impl RefusedLines {
    fn add(&mut self, sentence: impl FnOnce() -> String) {
        self.lines += 1;
        if self.told.len() < TOLD_LINES {
            self.told.push(sentence());
        }
    }
}

/// Why a line is not taken.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error("unable to parse '{line}': {fault}")]
    Unparsed { line: String, fault: LineFault },
    #[error(
        "field type conflict: input field \"{field}\" on measurement \"{measurement}\" is type string, a signal \
         takes numbers"
    )]
    Text { field: String, measurement: String },
    #[error(
        "value {value} of field \"{field}\" on measurement \"{measurement}\" is not a finite number in SI"
    )]
    NotFinite {
        value: f64,
        field: String,
        measurement: String,
    },
    #[error("point {line} is further ahead of this server's clock than stamps may be")]
    Ahead { line: String },
}

/// Reads lines and spreads their samples over streams. `latest_ns` is the latest instant that a sample may
/// have, nanoseconds since 1970.
///
/// # Errors
/// The source fails, or its samples would take too much memory.
pub fn written(
    source: impl Read,
    mapping: &Mapping,
    precision: Precision,
    latest_ns: i64,
) -> Result<WrittenLines, ReadError> {
    let (memory, source) = Memory::counting(source);
    let mut lines = LineReader::new(BufReader::new(source));
    let mut writing = Writing::new(mapping, precision, latest_ns);
    let mut refused = RefusedLines::default();
    let mut taken = 0;
    while let Some(line) = lines.next()? {
        let outcome = match line.text {
            Ok(text) => writing.take(text),
            Err(fault) => Err(Refusal::Unparsed {
                line: format!("line {}", line.number),
                fault,
            }),
        };
        match outcome {
            Ok(()) => taken += 1,
            Err(refusal) => refused.add(|| refusal.to_string()),
        }
        let bytes = SAMPLE_BYTES * writing.samples;
        memory.hold(bytes, "samples of these lines", INSTEAD)?;
    }
    let (unmapped, unlisted) = writing.unmapped.into_parts();
    let batches = writing.streams.into_iter();
    let batches = batches.filter(|(_, samples)| !samples.samples.is_empty());
    let batches = batches.map(|(stream, samples)| samples.into_batch(stream, &memory));
    Ok(WrittenLines {
        batches: batches.collect::<Result<_, _>>()?,
        unmapped,
        unlisted,
        taken,
        refused,
    })
}

/// A sample on its way into a stream.
#[derive(Clone, Copy)]
struct LineSample {
    instant: i64,
    /// The place of the signal among those of the stream.
    signal: usize,
    value: f64,
}

/// A sample whose line is not yet known to be right.
struct PendingSample {
    rule: usize,
    signal: usize,
    value: f64,
}

/// The samples of one stream by now.
#[derive(Default)]
struct BatchSamples {
    signals: Vec<RowSignal>,
    samples: Vec<LineSample>,
    lines: u64,
    /// The number of the line whose samples came last.
    last_line: u64,
}

/// A text of lines that is read.
struct Writing<'m> {
    precision: Precision,
    latest_ns: i64,
    routes: Routes<'m>,
    streams: BTreeMap<&'m str, BatchSamples>,
    unmapped: UnmappedList,
    /// Samples that were taken.
    samples: u64,
    /// Lines that were looked at.
    lines: u64,
    pending: Vec<PendingSample>,
}

impl<'m> Writing<'m> {
    fn new(mapping: &'m Mapping, precision: Precision, latest_ns: i64) -> Self {
        let mut streams: BTreeMap<&str, BatchSamples> = BTreeMap::new();
        let routes = Routes::new(mapping, |rule, mapped| {
            let stream = streams.entry(rule.stream.as_str()).or_default();
            stream.place(mapped)
        });
        Self {
            precision,
            latest_ns,
            routes,
            streams,
            unmapped: UnmappedList::default(),
            samples: 0,
            lines: 0,
            pending: Vec::new(),
        }
    }

    /// Takes a line, all of it or nothing.
    fn take(&mut self, text: &str) -> Result<(), Refusal> {
        self.lines += 1;
        let unparsed = |fault| Refusal::Unparsed {
            line: shown(text),
            fault,
        };
        let point = ProtocolLine::parse(text).map_err(unparsed)?;
        let instant = self.precision.instant(point.stamp).map_err(unparsed)?;
        let route = self.routes.of(&point).map_err(unparsed)?;
        self.pending.clear();
        let mut unnamed = Vec::new();
        for field in point.fields() {
            let (name, written) = field.map_err(unparsed)?;
            let value = FieldValue::parse(written).map_err(unparsed)?;
            let Some(field) = self.routes.field(&route, &name) else {
                unnamed.push((name, value));
                continue;
            };
            let number = match value {
                FieldValue::Number(number) => number,
                FieldValue::Boolean(value) => f64::from(u8::from(value)),
                FieldValue::Text(_) => {
                    return Err(Refusal::Text {
                        field: shown(&name),
                        measurement: shown(&point.measurement()),
                    });
                }
            };
            let value = field.unit.to_si(number);
            if !value.is_finite() {
                return Err(Refusal::NotFinite {
                    value: number,
                    field: shown(&name),
                    measurement: shown(&point.measurement()),
                });
            }
            self.pending.push(PendingSample {
                rule: field.rule,
                signal: field.signal,
                value,
            });
        }
        if instant > self.latest_ns {
            return Err(Refusal::Ahead { line: shown(text) });
        }
        self.keep_pending(instant);
        for (name, value) in unnamed {
            self.unmapped.add(&route, &name, &value, instant);
        }
        Ok(())
    }

    /// Keeps the samples of a line that is right.
    fn keep_pending(&mut self, instant: i64) {
        for PendingSample {
            rule,
            signal,
            value,
        } in self.pending.drain(..)
        {
            let stream = self.routes.stream(rule);
            let stream = self.streams.entry(stream).or_default();
            if stream.last_line != self.lines {
                stream.last_line = self.lines;
                stream.lines += 1;
            }
            stream.samples.push(LineSample {
                instant,
                signal,
                value,
            });
            self.samples += 1;
        }
    }
}

impl BatchSamples {
    /// The place of a signal among those of the stream, where it may be new.
    fn place(&mut self, mapped: RowSignal) -> usize {
        let place = self
            .signals
            .iter()
            .position(|signal| signal.name == mapped.name);
        place.unwrap_or_else(|| {
            self.signals.push(mapped);
            self.signals.len() - 1
        })
    }

    /// The samples as rows, with the signals that have any.
    fn into_batch(mut self, stream: &str, memory: &Memory) -> Result<StreamBatch, ReadError> {
        // Samples at one instant stay in the order of their lines.
        self.samples.sort_by_key(|sample| sample.instant);
        let mut instants: Vec<i64> = self.samples.iter().map(|sample| sample.instant).collect();
        instants.dedup();
        let mut columns: Vec<Option<RowColumn>> = vec![None; self.signals.len()];
        let mut present = vec![false; self.signals.len()];
        self.samples
            .iter()
            .for_each(|sample| present[sample.signal] = true);
        let n_signals = present.iter().filter(|is_present| **is_present).count();
        let rows = instants.len();
        let bytes = rows as u64 * (INSTANT_BYTES + VALUE_BYTES * n_signals as u64);
        let what = format!("{n_signals} signals at {rows} instants");
        memory.hold(bytes, &what, INSTEAD)?;
        memory.take(bytes);
        let mut row = 0;
        for sample in &self.samples {
            while instants[row] < sample.instant {
                row += 1;
            }
            let column = columns[sample.signal].get_or_insert_with(|| RowColumn {
                values: vec![f64::NAN; rows],
                classes: vec![Class::Good; rows],
            });
            column.values[row] = sample.value;
        }
        let named = self.signals.into_iter().zip(columns);
        let (signals, columns) = named
            .filter_map(|(signal, column)| Some((signal, column?)))
            .unzip();
        Ok(StreamBatch {
            stream: stream.to_owned(),
            lines: self.lines,
            batch: Batch {
                signals,
                rows: Rows { instants, columns },
                zone: None,
                report: QualityReport::default(),
                double_hour: None,
            },
        })
    }
}

/// A text of a sender, short enough for a sentence.
fn shown(text: &str) -> String {
    match text.char_indices().nth(SHOWN_CHARACTERS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests;
