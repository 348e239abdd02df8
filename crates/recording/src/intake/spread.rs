//! Samples that agents write, spread over streams by the rules of a mapping.
//!
//! A point (a series, an instant and fields) is taken whole or not at all. A point that is wrong keeps no other point
//! out: the fault is told beside what was taken. Series that no rule names are listed and not taken. Each sample
//! keeps the instant of its point to the nanosecond; of two samples of a signal at one instant the later point counts.

mod mapping;
mod point;
mod routes;
mod unmapped;

pub use mapping::{MappedQuality, MappedSignal, Mapping, MappingRule};
pub(super) use point::{FieldValue, PointFault, PointField, shown};
pub(super) use routes::Route;
pub use unmapped::{LastValue, MAX_UNMAPPED, UnmappedSeries};

use super::cell::Cell;
use super::error::ReadError;
use super::memory::Memory;
use crate::{Batch, Class, QualityReport, RowColumn, RowSignal, Rows};
use routes::Routes;
use std::collections::BTreeMap;
use std::rc::Rc;
use unmapped::UnmappedList;

/// Points of which an answer tells the fault; those beyond are counted.
const TOLD_POINTS: usize = 20;
/// Bytes of a sample while it is sorted.
const SAMPLE_BYTES: u64 = 2 * size_of::<SpreadSample>() as u64;
/// Bytes of an instant of a row, and of a signal at it: the value and its class.
const INSTANT_BYTES: u64 = 8;
const VALUE_BYTES: u64 = 9;
/// The remedy for samples that take too much memory.
const INSTEAD: &str = "send fewer lines at once";

/// The samples of a body, and the points and series that were not taken.
#[derive(Debug, Default)]
pub struct WrittenSamples {
    /// The samples for each stream, in the order of the streams' names.
    pub batches: Vec<StreamBatch>,
    /// Series that no rule names, [`MAX_UNMAPPED`] at the most.
    pub unmapped: Vec<UnmappedSeries>,
    /// Samples of further series that no rule names.
    pub unlisted: u64,
    /// Points that were taken.
    pub taken: u64,
    /// Points that are wrong.
    pub refused: RefusedPoints,
}

/// Samples for one stream.
#[derive(Debug)]
pub struct StreamBatch {
    /// The name of the stream.
    pub stream: String,
    /// The points that the samples are of.
    pub points: u64,
    /// The samples.
    pub batch: Batch,
}

/// Points that were not taken.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RefusedPoints {
    /// How many points there are.
    pub points: u64,
    /// Sentences on the first of them.
    pub told: Vec<String>,
}

impl RefusedPoints {
    /// Counts a point, and keeps the sentence on it where it is among the first.
    pub(super) fn add(&mut self, sentence: impl FnOnce() -> String) {
        self.points += 1;
        if self.told.len() < TOLD_POINTS {
            self.told.push(sentence());
        }
    }

    /// Counts a part of a body, and keeps what is wrong with it where it is among the first.
    pub(super) fn refuse(&mut self, part: &str, fault: &str) {
        self.add(|| format!("{part}: {fault}"));
    }
}

/// A sample on its way into a stream.
#[derive(Clone, Copy)]
struct SpreadSample {
    instant: i64,
    value: f64,
    /// The place of the signal among those of the stream.
    signal: u32,
    class: Class,
}

/// A sample whose point is not yet known to be right.
struct PendingSample {
    rule: usize,
    signal: u32,
    value: f64,
}

/// The samples of one stream by now.
#[derive(Default)]
struct BatchSamples {
    signals: Vec<RowSignal>,
    samples: Vec<SpreadSample>,
    points: u64,
    /// The number of the point whose samples came last.
    last_point: u64,
}

/// Points that are spread over streams.
pub(super) struct Spreading<'m> {
    latest_ns: i64,
    memory: Memory,
    routes: Routes<'m>,
    streams: BTreeMap<&'m str, BatchSamples>,
    unmapped: UnmappedList,
    /// Samples that were taken.
    samples: u64,
    /// Points that were taken.
    taken: u64,
    /// Points that were looked at.
    points: u64,
    pending: Vec<PendingSample>,
    /// How good the samples of rules are, which the same point says.
    qualities: Vec<(usize, Class)>,
}

impl<'m> Spreading<'m> {
    /// Nothing by now. `latest_ns` is the latest instant that a sample may have, nanoseconds since 1970.
    pub(super) fn new(mapping: &'m Mapping, latest_ns: i64, memory: &Memory) -> Self {
        let mut streams: BTreeMap<&str, BatchSamples> = BTreeMap::new();
        let routes = Routes::new(mapping, |rule, mapped| {
            let stream = streams.entry(rule.stream.as_str()).or_default();
            stream.place(mapped)
        });
        Self {
            latest_ns,
            memory: memory.clone(),
            routes,
            streams,
            unmapped: UnmappedList::default(),
            samples: 0,
            taken: 0,
            points: 0,
            pending: Vec::new(),
            qualities: Vec::new(),
        }
    }

    /// The rules that fit a series. `key` is the series as its sender writes it, and `parts` takes the text apart into
    /// a measurement and tags.
    pub(super) fn route<E>(
        &mut self,
        key: &str,
        parts: impl FnOnce() -> Result<(String, BTreeMap<String, String>), E>,
    ) -> Result<Rc<Route>, E> {
        self.routes.of(key, parts)
    }

    /// Takes a point, all of it or nothing.
    pub(super) fn take<'t, E: From<PointFault>>(
        &mut self,
        route: &Route,
        instant: i64,
        fields: impl Iterator<Item = Result<PointField<'t>, E>>,
    ) -> Result<(), E> {
        self.points += 1;
        self.pending.clear();
        self.qualities.clear();
        let mut unnamed = Vec::new();
        for field in fields {
            let field = field?;
            let is_quality = self.take_quality(route, &field)?;
            match self.routes.field(route, &field.name) {
                None if is_quality => {}
                None => unnamed.push(field),
                Some(signal) => self.pending.push(PendingSample {
                    rule: signal.rule,
                    signal: signal.signal,
                    value: field.si(&signal.unit, &route.measurement)?,
                }),
            }
        }
        if instant > self.latest_ns {
            return Err(PointFault::Ahead.into());
        }
        self.keep_pending(instant);
        self.taken += 1;
        for field in unnamed {
            self.unmapped.add(route, &field.name, &field.value, instant);
        }
        Ok(())
    }

    /// Looks whether a field says how good others are.
    fn take_quality(&mut self, route: &Route, field: &PointField<'_>) -> Result<bool, PointFault> {
        let before = self.qualities.len();
        for (rule, scheme) in self.routes.quality(route, &field.name) {
            let code = match &field.value {
                FieldValue::Number(code) => Cell::Number(*code),
                FieldValue::Boolean(is_good) => Cell::Bool(*is_good),
                FieldValue::Text(text) => Cell::Text(text),
            };
            let class = scheme.class(&code).ok_or_else(|| PointFault::Quality {
                code: format!("`{code}`"),
                field: shown(&field.name),
                measurement: shown(&route.measurement),
            })?;
            self.qualities.push((rule, class));
        }
        Ok(self.qualities.len() > before)
    }

    /// Keeps the samples of a point that is right.
    fn keep_pending(&mut self, instant: i64) {
        for sample in self.pending.drain(..) {
            let class = class_of(&self.qualities, sample.rule);
            let stream = self.routes.stream(sample.rule);
            let stream = self.streams.entry(stream).or_default();
            if stream.last_point != self.points {
                stream.last_point = self.points;
                stream.points += 1;
            }
            stream.samples.push(SpreadSample {
                instant,
                signal: sample.signal,
                value: sample.value,
                class,
            });
            self.samples += 1;
        }
    }

    /// Refuses to go on where the samples that were taken hold too much memory.
    pub(super) fn check_memory(&self) -> Result<(), ReadError> {
        let bytes = SAMPLE_BYTES * self.samples;
        self.memory.hold(bytes, "samples of these lines", INSTEAD)
    }

    /// The samples by streams.
    pub(super) fn finish(self, refused: RefusedPoints) -> Result<WrittenSamples, ReadError> {
        let memory = self.memory;
        let (unmapped, unlisted) = self.unmapped.into_parts();
        let batches = self.streams.into_iter();
        let batches = batches.filter(|(_, samples)| !samples.samples.is_empty());
        let batches = batches.map(|(stream, samples)| samples.into_batch(stream, &memory));
        Ok(WrittenSamples {
            batches: batches.collect::<Result<_, _>>()?,
            unmapped,
            unlisted,
            taken: self.taken,
            refused,
        })
    }
}

/// How good the samples of a rule are.
fn class_of(qualities: &[(usize, Class)], rule: usize) -> Class {
    let classes = qualities.iter().filter(|(of, _)| *of == rule);
    let worst = classes.map(|(_, class)| *class).max();
    worst.unwrap_or(Class::Good)
}

impl BatchSamples {
    /// The place of a signal among those of the stream, where it may be new.
    fn place(&mut self, mapped: RowSignal) -> u32 {
        let place = self
            .signals
            .iter()
            .position(|signal| signal.name == mapped.name);
        let place = place.unwrap_or_else(|| {
            self.signals.push(mapped);
            self.signals.len() - 1
        });
        u32::try_from(place).expect("a mapping has less than 2^32 signals")
    }

    /// The samples as rows, with the signals that have any.
    fn into_batch(mut self, stream: &str, memory: &Memory) -> Result<StreamBatch, ReadError> {
        // Samples at one instant stay in the order of their points.
        self.samples.sort_by_key(|sample| sample.instant);
        let mut instants: Vec<i64> = self.samples.iter().map(|sample| sample.instant).collect();
        instants.dedup();
        let mut columns: Vec<Option<RowColumn>> = vec![None; self.signals.len()];
        let mut present = vec![false; self.signals.len()];
        self.samples
            .iter()
            .for_each(|sample| present[sample.signal as usize] = true);
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
            let column = columns[sample.signal as usize].get_or_insert_with(|| RowColumn {
                values: vec![f64::NAN; rows],
                classes: vec![Class::Good; rows],
            });
            let is_measured = sample.class != Class::Bad;
            column.values[row] = if is_measured { sample.value } else { f64::NAN };
            column.classes[row] = sample.class;
        }
        let named = self.signals.into_iter().zip(columns);
        let (signals, columns) = named
            .filter_map(|(signal, column)| Some((signal, column?)))
            .unzip();
        Ok(StreamBatch {
            stream: stream.to_owned(),
            points: self.points,
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
