//! What moves the plant beside its inputs, as a result tells it.

use super::{ConfidenceInterval, Trust};
use crate::identification::spec::{ActsOnSpec, NoiseKind};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// What moves the plant beside its inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct ProcessNoiseReport {
    /// How the likelihood is made: `ekf`, the continuous–discrete extended Kalman filter.
    #[schema(example = "ekf")]
    pub filter: String,
    /// The name of the noise model that was taken.
    #[schema(example = "white on the rate of velocity")]
    pub chosen: String,
    /// All noise models that were fitted.
    pub compared: Vec<ComparedNoiseReport>,
    /// The disturbances of the noise model that was taken.
    pub disturbances: Vec<DisturbanceReport>,
    /// For each measured output the standard deviation of its sensor's noise.
    pub sensors: BTreeMap<String, NoiseNumberReport>,
    /// For each measured output how far its samples are off what was expected of them.
    pub innovations: BTreeMap<String, InnovationReport>,
    /// For each output how the samples that were held back lie in the band that is expected of them from the
    /// last sample before on; empty where none were.
    #[serde(default)]
    pub held_back: BTreeMap<String, BandReport>,
    /// How the windows of the record agree about each parameter: the spread of what each window alone would
    /// make of it, in units of what noise allows; near 1 where they agree.
    #[serde(default)]
    pub window_spread: BTreeMap<String, f64>,
}

/// A noise model that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct ComparedNoiseReport {
    /// The name of the noise model.
    #[schema(example = "white on the rate of velocity")]
    pub name: String,
    /// The natural logarithm of the likelihood; `null` where the fit failed.
    pub log_likelihood: Option<f64>,
    /// The Bayesian information criterion: the lowest is taken, as far as its innovations can be relied on.
    pub bic: Option<f64>,
    /// Whether the disturbances would have left far more in the free run than was left: such a noise model is
    /// no explanation, whatever its likelihood.
    #[serde(default)]
    pub too_strong: bool,
    /// The values of the parameters under the noise model, SI.
    pub parameters: BTreeMap<String, f64>,
}

/// A disturbance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct DisturbanceReport {
    /// What the disturbance acts on; a state's rate is disturbed.
    pub acts_on: ActsOnSpec,
    /// How the disturbance moves.
    pub kind: NoiseKind,
    /// The SI unit of what it acts on: that of `std`.
    #[schema(example = "m/s/s")]
    pub unit: String,
    /// The standard deviation of a disturbance with memory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub std: Option<NoiseNumberReport>,
    /// The strength, in `unit` times √s; that of a walk in `unit` per √s.
    pub strength: NoiseNumberReport,
    /// How long a disturbance with memory remembers `[s]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub time_constant_s: Option<NoiseNumberReport>,
    /// For each output the share of its variance that the disturbance makes.
    pub share_of_output: BTreeMap<String, f64>,
}

/// A number of a disturbance or of a sensor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct NoiseNumberReport {
    /// The value, SI.
    pub estimate: f64,
    /// One standard deviation of the value's error; `null` where the value was given, or the data do not fix
    /// it.
    pub standard_error: Option<f64>,
    /// The 95 % interval.
    pub confidence_interval: Option<ConfidenceInterval>,
}

/// How far the samples of an output are off what was expected of them from all samples before.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct InnovationReport {
    /// Whether the errors pass for white noise; `null` when too few.
    pub white: Option<bool>,
    /// The mean square of the errors in units of what is expected; near 1 where the noise model holds.
    pub chi_square_per_sample: Option<f64>,
    /// The correlation of neighbouring errors.
    pub lag_1_autocorrelation: Option<f64>,
}

/// How samples that were held back lie in the band that is expected of them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct BandReport {
    /// The number of samples.
    pub samples: u64,
    /// The share of the samples within the 95 % band.
    #[schema(example = 0.96)]
    pub inside: f64,
    /// The mean square of their errors in units of what is expected.
    pub mean_square: f64,
}

/// What the free run, which knows of no disturbance, makes of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct OutputErrorEstimate {
    /// The value, SI.
    pub estimate: f64,
    /// One standard deviation of the value's error.
    pub standard_error: Option<f64>,
    /// How far the total interval can be relied on.
    pub trust: Trust,
}
