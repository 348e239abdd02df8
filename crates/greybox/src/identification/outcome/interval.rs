//! Intervals, profiles and correlations of estimates.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A confidence interval; an end that the data leave open is `null`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct ConfidenceInterval {
    /// The probability that the interval holds the true value.
    #[schema(example = 0.95)]
    pub level: f64,
    /// The lower end.
    pub lower: Option<f64>,
    /// The upper end.
    pub upper: Option<f64>,
    /// How the interval was made: `fisher` (curvature at the estimate), `fisher_coloured` (that, widened for
    /// residuals with a memory), `profile` (likelihood profile), `bootstrap`, `posterior` (quantiles of draws) or
    /// `constrained` (curvature within the constraints).
    #[schema(example = "fisher")]
    pub method: String,
}

/// An interval with all that was taken as known; an end that is left open is `null`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct TotalInterval {
    /// The probability that the interval holds the true value.
    #[schema(example = 0.95)]
    pub level: f64,
    /// The lower end.
    pub lower: Option<f64>,
    /// The upper end.
    pub upper: Option<f64>,
}

/// A point of a likelihood profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ProfilePoint {
    /// The value at which the estimate was held, SI.
    pub value: f64,
    /// How far the sum of squares rises, as a multiple of the rise at which the interval ends: 0 at
    /// the estimate, 1 at the ends of the interval.
    pub excess: f64,
}

/// The correlation of the estimates' errors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Correlation {
    /// The rows' and columns' names.
    pub names: Vec<String>,
    /// Row by row; `null` where a variance is zero or unknown.
    pub matrix: Vec<Vec<Option<f64>>>,
    /// The condition number of the outputs' derivatives, each scaled to the same length: how much
    /// worse the worst combination is known than the best.
    #[serde(default)]
    pub condition_number: Option<f64>,
}
