//! A recording as it comes in, on its way to where it is kept: its samples need not all be in
//! memory.

use super::columns::{SampleColumns, SampleSeries};
use super::{ClassSpan, DoubleHour, Interpolation, Recording, Signal, TimeAxis, Warning};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io;
use utoipa::ToSchema;

/// A recording whose samples are in memory or in a scratch.
///
/// Instants that are not uniform are held in memory; else it takes the same memory however long
/// the recording is, where there is a scratch.
pub struct ReceivedRecording {
    /// A name for people.
    pub name: Option<String>,
    /// The instant of the first sample, where the source gave one.
    pub start: Option<jiff::Timestamp>,
    /// The time zone that the source counted in, where it is known: an IANA name or an offset.
    pub zone: Option<String>,
    /// The format and the options that the recording was read with.
    pub source: RecordingSource,
    /// When the samples were taken.
    pub time: TimeAxis,
    /// The local hour that came twice, where nothing in the source tells its passes apart.
    pub double_hour: Option<DoubleHour>,
    /// Whether signals have instants of their own, so that a missing sample of one may mean that
    /// another was taken there.
    pub own_instants: bool,
    /// The signals in the order of the source.
    pub signals: Vec<NamedSignal>,
    /// What reading changed or assumed, e.g. rows that were dropped.
    pub notes: Vec<Warning>,
    pub(crate) columns: SampleColumns,
}

/// What a recording was read from, so that the reading can be repeated.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[schema(as = Source)]
pub struct RecordingSource {
    /// The format, e.g. `wide_csv` or `pi_web_api`; empty for recordings that no reader made.
    pub format: String,
    /// The options that came with it, as they were given.
    pub options: BTreeMap<String, String>,
}

/// What a signal is called and measured in: all but its samples.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NamedSignal {
    /// The name, unique in its recording.
    pub name: String,
    /// The SI unit of the samples; empty where the source gave no unit.
    pub unit: String,
    /// The unit as the source wrote it; empty where it gave none.
    pub recorded_unit: String,
    /// How the signal goes on between samples, where the source or its options said so.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interpolation: Option<Interpolation>,
    /// Samples that are not good, in their order; the others are.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub classes: Vec<ClassSpan>,
    /// The column that holds the samples.
    #[serde(skip)]
    pub(crate) column: usize,
}

impl ReceivedRecording {
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
            let values = self.columns.take(signal.column)?;
            Ok(signal.with_values(values))
        });
        Ok(Recording {
            signals: signals.collect::<io::Result<_>>()?,
            name: self.name,
            start: self.start,
            zone: self.zone,
            source: self.source,
            time: self.time,
            double_hour: self.double_hour,
            own_instants: self.own_instants,
            notes: self.notes,
        })
    }
}

impl From<Recording> for ReceivedRecording {
    fn from(recording: Recording) -> Self {
        let signals = recording.signals.into_iter().enumerate();
        let (signals, columns) = signals
            .map(|(column, signal)| (NamedSignal::new(&signal, column), signal.values))
            .unzip();
        Self {
            name: recording.name,
            start: recording.start,
            zone: recording.zone,
            source: recording.source,
            time: recording.time,
            double_hour: recording.double_hour,
            own_instants: recording.own_instants,
            signals,
            notes: recording.notes,
            columns: SampleColumns::of(columns),
        }
    }
}

impl NamedSignal {
    pub(crate) fn new(signal: &Signal, column: usize) -> Self {
        Self {
            name: signal.name.clone(),
            unit: signal.unit.clone(),
            recorded_unit: signal.recorded_unit.clone(),
            interpolation: signal.interpolation,
            classes: signal.classes.clone(),
            column,
        }
    }

    /// The signal that has these samples.
    #[must_use]
    pub fn with_values(self, values: Vec<f64>) -> Signal {
        Signal {
            name: self.name,
            unit: self.unit,
            recorded_unit: self.recorded_unit,
            interpolation: self.interpolation,
            classes: self.classes,
            values,
        }
    }
}
