//! What draws from the posterior distribution say.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What draws from the posterior distribution say of one unknown: the likelihood with the priors. An
/// unknown without a prior has a uniform one along the scale of its search range.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct PosteriorReport {
    /// How many chains were drawn side by side.
    #[schema(example = 32)]
    pub chains: u32,
    /// How many draws the figures are made from: the second half of the generations, thinned.
    #[schema(example = 6784)]
    pub draws: u64,
    /// The mean of the draws, SI.
    #[schema(example = 58.04)]
    pub mean: f64,
    /// The standard deviation of the draws, SI.
    #[schema(example = 0.32)]
    pub standard_deviation: f64,
    /// The 2.5 %, 50 % and 97.5 % quantiles of the draws.
    pub quantiles: Vec<PosteriorQuantile>,
    /// R̂ of rank-normalised split chains, near 1 where all chains draw from one distribution; `null` where
    /// all draws are one number.
    #[schema(example = 1.004)]
    pub r_hat: Option<f64>,
    /// How many independent draws would say as much about the middle of the distribution.
    #[schema(example = 2950.0)]
    pub ess_bulk: Option<f64>,
    /// How many independent draws would say as much about the 5 % and 95 % quantiles.
    #[schema(example = 3900.0)]
    pub ess_tail: Option<f64>,
}

/// A quantile of the draws.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PosteriorQuantile {
    /// The share of the draws that lies below.
    #[schema(example = 0.975)]
    pub probability: f64,
    /// The value, SI.
    #[schema(example = 58.7)]
    pub value: f64,
}

/// Some of the draws from the posterior distribution, evenly.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct PosteriorDraws {
    /// How many generations the chains moved.
    #[schema(example = 4250)]
    pub generations: u32,
    /// The names of the columns: the unknowns, as in `correlation`.
    pub names: Vec<String>,
    /// The SI unit of each column.
    pub units: Vec<String>,
    /// At most 1000 draws, each with a value for each column, SI.
    pub rows: Vec<Vec<f64>>,
}

impl PosteriorDraws {
    /// A table in CSV with a row for each draw; the unit of a column stands behind its name.
    #[must_use]
    pub fn csv(&self) -> String {
        let columns = self.names.iter().zip(&self.units);
        let heads: Vec<String> = columns
            .map(|(name, unit)| format!("{name} [{unit}]"))
            .collect();
        let mut text = heads.join(",");
        text.push('\n');
        for row in &self.rows {
            let fields: Vec<String> = row.iter().map(f64::to_string).collect();
            text.push_str(&fields.join(","));
            text.push('\n');
        }
        text
    }
}
