//! How much is asked about an estimate's uncertainty.

use super::identifiability::FlatDirection;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How confidence intervals are made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Intervals {
    /// From the curvature at the estimate: at once, symmetric along the parameter's scale.
    #[default]
    Fisher,
    /// From the likelihood profile: the parameter is moved and all others are fitted again, until
    /// the data object. Asymmetric where the model is; an end that the data leave open within the
    /// search range is `null`.
    Profile,
    /// From refits to data made of the simulation and its own residuals, drawn in blocks where
    /// they have a memory.
    Bootstrap,
}

/// What to do where the data do not see a change of an unknown, or of a combination of unknowns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FlatDirections {
    /// Say so at the start of the job, and in the result.
    Report,
    /// End the job at its start where several unknowns can change together without an output that
    /// shows it; say so where the data hardly depend on a single one.
    #[default]
    RefuseCombinations,
    /// End the job at its start in both cases.
    Refuse,
}

impl FlatDirections {
    /// Whether a job ends at its start for a direction.
    #[must_use]
    pub fn refuses(self, direction: &FlatDirection) -> bool {
        match self {
            FlatDirections::Report => false,
            FlatDirections::RefuseCombinations => direction.is_combination(),
            FlatDirections::Refuse => true,
        }
    }
}

/// What a job says under `uncertainty`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(default, deny_unknown_fields)]
#[schema(as = UncertaintySettings)]
pub struct Settings {
    /// How the 95 % intervals are made.
    pub intervals: Intervals,
    /// Refits of a bootstrap, 40 to 10 000.
    pub bootstrap_samples: u32,
    /// Fits in which the noise and all that is taken as known are drawn anew, 100 to 100 000, to check
    /// the total uncertainty by (JCGM 101); 0: none.
    pub monte_carlo_samples: u32,
    /// What to do where the data do not see a change of an unknown, or of a combination of unknowns.
    pub flat_directions: FlatDirections,
}

impl Settings {
    /// Whether there are many refits that do not depend on each other.
    #[must_use]
    pub fn has_independent_refits(&self) -> bool {
        self.intervals != Intervals::Fisher || self.monte_carlo_samples > 0
    }
}

impl Default for Settings {
    fn default() -> Self {
        Settings {
            intervals: Intervals::default(),
            bootstrap_samples: 200,
            monte_carlo_samples: 0,
            flat_directions: FlatDirections::default(),
        }
    }
}
