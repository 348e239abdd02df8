//! A recording as it comes in, on its way to where it is kept: its samples need not all be in
//! memory.

use super::columns::{Columns, Series};
use super::{Recording, Signal, TimeAxis, Warning};
use std::io;

/// A recording whose samples are in memory or in a scratch.
///
/// Instants that are not uniform are held in memory; else it takes the same memory however long
/// the recording is, where there is a scratch.
pub struct Received {
    /// A name for people.
    pub name: Option<String>,
    /// The instant of the first sample, where the source gave one.
    pub start: Option<jiff::Timestamp>,
    /// When the samples were taken.
    pub time: TimeAxis,
    /// The signals in the order of the source.
    pub signals: Vec<Named>,
    /// What reading changed or assumed, e.g. rows that were dropped.
    pub notes: Vec<Warning>,
    pub(crate) columns: Columns,
}

/// What a signal is called and measured in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// The name, unique in its recording.
    pub name: String,
    /// The SI unit of the samples; empty where the source gave no unit.
    pub unit: String,
    /// The unit as the source wrote it; empty where it gave none.
    pub recorded_unit: String,
    /// The column that holds the samples.
    pub(crate) column: usize,
}

impl Received {
    /// Hands over the samples of one of the `signals` in their order, piece by piece.
    ///
    /// # Errors
    /// When the samples cannot be read back, or with what `take` answers.
    pub fn visit(
        &mut self,
        signal: usize,
        take: &mut dyn FnMut(&[f64]) -> io::Result<()>,
    ) -> io::Result<()> {
        let column = self.signals[signal].column;
        self.columns.column(column).visit(take)
    }

    /// The recording with all of its samples in memory.
    ///
    /// # Errors
    /// When the samples cannot be read back.
    pub fn into_recording(mut self) -> io::Result<Recording> {
        let signals = self.signals.into_iter().map(|signal| {
            Ok(Signal {
                values: self.columns.take(signal.column)?,
                name: signal.name,
                unit: signal.unit,
                recorded_unit: signal.recorded_unit,
            })
        });
        Ok(Recording {
            signals: signals.collect::<io::Result<_>>()?,
            name: self.name,
            start: self.start,
            time: self.time,
            notes: self.notes,
        })
    }
}

impl From<Recording> for Received {
    fn from(recording: Recording) -> Self {
        let signals = recording.signals.into_iter().enumerate();
        let (signals, columns) = signals
            .map(|(column, signal)| (Named::new(&signal, column), signal.values))
            .unzip();
        Self {
            name: recording.name,
            start: recording.start,
            time: recording.time,
            signals,
            notes: recording.notes,
            columns: Columns::of(columns),
        }
    }
}

impl Named {
    pub(super) fn new(signal: &Signal, column: usize) -> Self {
        Self {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            recorded_unit: signal.recorded_unit.clone(),
            column,
        }
    }
}
