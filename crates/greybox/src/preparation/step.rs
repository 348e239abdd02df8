//! The steps of a recipe.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One step of a recipe: it changes the recording that the steps before it leave. `signals` are the names of signals;
/// all where a step goes without.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "step", rename_all = "snake_case")]
pub enum PreparationStep {
    /// Keeps the samples between two times, both included.
    #[schema(title = "CutStep")]
    Cut {
        /// The beginning `[s]`, from the first sample; the first sample where it is left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0)]
        from_s: Option<f64>,
        /// The end `[s]`, from the first sample; the last sample where it is left out.
        #[serde(skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0)]
        to_s: Option<f64>,
    },
    /// Leaves signals out.
    #[schema(title = "RemoveStep")]
    Remove {
        /// The signals that are left out.
        signals: Vec<String>,
    },
    /// Replaces each sample by the median of the samples around it, which takes spikes out and leaves edges.
    #[schema(title = "MedianStep")]
    Median {
        /// The signals that are changed.
        #[serde(skip_serializing_if = "Option::is_none")]
        signals: Option<Vec<String>>,
        /// How many samples the median is of, the sample itself in their middle: an odd number.
        #[schema(minimum = 3, maximum = 1001)]
        samples: u32,
    },
    /// Takes out what is faster than a frequency, without a delay: a Butterworth filter of second order, forwards
    /// and backwards.
    #[schema(title = "LowPassStep")]
    LowPass {
        /// The signals that are changed.
        #[serde(skip_serializing_if = "Option::is_none")]
        signals: Option<Vec<String>>,
        /// The frequency `[Hz]` at which an oscillation keeps 1/√2 of its height.
        #[schema(exclusive_minimum = 0)]
        cutoff_hz: f64,
    },
    /// Takes out what is slower than a frequency, without a delay: a Butterworth filter of second order, forwards
    /// and backwards.
    #[schema(title = "HighPassStep")]
    HighPass {
        /// The signals that are changed.
        #[serde(skip_serializing_if = "Option::is_none")]
        signals: Option<Vec<String>>,
        /// The frequency `[Hz]` at which an oscillation keeps 1/√2 of its height.
        #[schema(exclusive_minimum = 0)]
        cutoff_hz: f64,
    },
    /// Subtracts a trend.
    #[schema(title = "DetrendStep")]
    Detrend {
        /// The signals that are changed.
        #[serde(skip_serializing_if = "Option::is_none")]
        signals: Option<Vec<String>>,
        /// Which trend.
        trend: Trend,
    },
    /// Moves signals in time: the value of each instant comes from `by_s` before it.
    #[schema(title = "ShiftStep")]
    Shift {
        /// The signals that are moved.
        signals: Vec<String>,
        /// How far `[s]`: above 0 later, below 0 earlier.
        by_s: f64,
    },
    /// Puts all signals on a grid of another sample time: means around the instants of a coarser grid, straight lines
    /// between samples on a finer one.
    #[schema(title = "ResampleStep")]
    Resample {
        /// The time between two samples of the grid `[s]`.
        #[schema(exclusive_minimum = 0)]
        sample_time_s: f64,
        /// The signals that keep their value until the next sample, such as commands, in addition to those of which
        /// the recording says so. Their values are taken as they stand, not their means.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        held: Vec<String>,
    },
    /// Adds a signal that follows from others, or replaces one.
    #[schema(title = "CalculateStep")]
    Calculate {
        /// The signal that is made.
        signal: String,
        /// The equation of the signal in the language of models, in SI; names are those of signals.
        #[schema(example = "area*sqrt(2*dp/1000)")]
        equation: String,
        /// The unit in which the signal is shown, whose SI unit the equation has to have; not checked where it is
        /// left out.
        #[serde(default, skip_serializing_if = "String::is_empty")]
        unit: String,
        /// Names for signals whose own names the language cannot write: the signal by the name that the equation has
        /// for it.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        names: BTreeMap<String, String>,
    },
}

/// A trend of a signal over the whole recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Trend {
    /// The mean.
    Mean,
    /// The straight line that fits best, the mean with it.
    Line,
    /// The slope of the straight line that fits best; the mean stays.
    Slope,
}
