//! A recording as it comes in, on its way to where it is kept: its samples need not all be in
//! memory.

use super::columns::{SampleColumns, SampleSeries};
use super::{NamedSignal, Recording};
use std::io;

/// A recording whose samples are in memory or in a scratch.
///
/// Instants that are not uniform are held in memory; else it takes the same memory however long
/// the recording is, where there is a scratch.
pub struct ReceivedRecording {
    /// The recording without its samples.
    pub header: Recording<NamedSignal>,
    pub(crate) columns: SampleColumns,
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
        let column = self.header.signals[signal].column;
        self.columns.column(column).visit(take)
    }

    /// The recording with all of its samples in memory.
    ///
    /// # Errors
    /// When the samples cannot be read back.
    pub fn into_recording(mut self) -> io::Result<Recording> {
        let signals = std::mem::take(&mut self.header.signals).into_iter();
        let signals = signals.map(|signal| {
            let values = self.columns.take(signal.column)?;
            Ok(signal.with_values(values))
        });
        let signals = signals.collect::<io::Result<_>>()?;
        Ok(self.header.with_signals(signals))
    }
}

impl From<Recording> for ReceivedRecording {
    fn from(mut recording: Recording) -> Self {
        let signals = std::mem::take(&mut recording.signals).into_iter();
        let (signals, columns) = signals
            .enumerate()
            .map(|(column, signal)| (NamedSignal::new(&signal, column), signal.values))
            .unzip();
        Self {
            header: recording.with_signals(signals),
            columns: SampleColumns::of(columns),
        }
    }
}
