//! What a plant delivered, and the experiments cut from it.
//!
//! A [`Recording`] is named signals over one time axis, in SI units; [`ReceivedRecording`] is the same on its
//! way to where it is kept, and need not be in memory. An [`ExperimentData`] is the part of it that one
//! estimation uses: cut to a window, under the model's signal names. A missing
//! sample is NaN in both and is never invented; outside this module it is `null` or an empty field.

mod axis;
mod batch;
pub(crate) mod columns;
mod decimate;
mod double_hour;
mod error;
mod exclude;
mod experiment;
mod export;
pub mod intake;
mod interpolated;
mod marked_rows;
mod profile;
mod quality;
mod received;
mod recording;
mod resample;
mod rows;
mod signal;
mod source;
mod split;
mod stillness;
mod summary;
mod version;
mod warning;

pub use axis::TimeAxis;
pub(crate) use axis::{TICK, is_beyond_nanoseconds, nanoseconds};
pub use batch::Batch;
pub use columns::{NewScratch, Scratch};
pub use decimate::{SampledSignal, Samples, kept_indices};
pub use double_hour::DoubleHour;
pub use error::ExperimentError;
pub use exclude::{Exclude, ExcludedClass, ExcludedSpan};
pub use experiment::{ExperimentData, Instants, Mapped, RecordingSelection};
pub use export::CsvWriter;
pub use quality::{QualityReport, shown};
pub use received::ReceivedRecording;
pub use recording::{MAX_NAME_CHARACTERS, MAX_SIGNALS, MIN_SAMPLES, Recording, name_fault};
pub use resample::LONGEST_BRIDGE;
pub(crate) use resample::{ResampleRule, resample};
pub use rows::{Merged, RowColumn, RowSignal, Rows};
pub use signal::{Class, ClassCounts, ClassSpan, Interpolation, NamedSignal, Signal};
pub use source::RecordingSource;
pub use split::{Split, TimeWindow};
pub use stillness::stands_still;
pub use summary::{Conversion, SignalSummary, Summary};
pub use version::{Mark, RecordingVersion};
pub use warning::{TimeSpan, Warning};
