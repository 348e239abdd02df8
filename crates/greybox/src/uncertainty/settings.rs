//! How much is asked about an estimate's uncertainty.

use super::identifiability::FlatDirection;
use crate::estimation::sought_noise::SoughtDisturbance;
use greybox_numerics::{settings, words};
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
    /// From draws from the posterior distribution: the likelihood with the priors. An unknown without a prior
    /// has a uniform one along the scale of its search range.
    Posterior,
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

words!(Intervals, FlatDirections);

/// Generations of the chains of a posterior, where a job does not say.
const USUAL_GENERATIONS: u32 = 10_000;

/// Whether generations of chains need not be written: specifications without them keep the digests that they had.
fn are_usual_generations(generations: &u32) -> bool {
    *generations == USUAL_GENERATIONS
}

/// Next steps that are tried, where a job does not say.
const USUAL_TRIES: u32 = 4;

/// Whether the number of tries need not be written: specifications without it keep the digests that they had.
fn are_usual_tries(tries: &u32) -> bool {
    *tries == USUAL_TRIES
}

settings! {
    /// What a job says under `uncertainty`.
    #[schema(as = UncertaintySettings)]
    pub struct Settings {
        /// How the 95 % intervals are made.
        intervals: Intervals = Intervals::default();
        /// Refits of a bootstrap, 40 to 10 000.
        bootstrap_samples: u32 = 200, from 40, to 10_000;
        /// Generations of the 32 chains of a posterior at the most, 500 to 100 000: they end earlier where R̂ is
        /// below 1.01 and the effective sample sizes are above 400.
        #[serde(skip_serializing_if = "are_usual_generations")]
        posterior_generations: u32 = USUAL_GENERATIONS, from 500, to 100_000;
        /// Fits in which the noise and all that is taken as known are drawn anew, 100 to 100 000, to check
        /// the total uncertainty by (JCGM 101); 0: none.
        monte_carlo_samples: u32 = 0, from 0, to 100_000, unless too_few_fits;
        /// How many next steps of the verdict are tried before they are offered, 0 to 16: the job is fitted anew with
        /// each, from its estimate.
        #[serde(skip_serializing_if = "are_usual_tries")]
        tried_steps: u32 = USUAL_TRIES, from 0, to 16;
        /// What to do where the data do not see a change of an unknown, or of a combination of unknowns.
        flat_directions: FlatDirections = FlatDirections::default();
    }
}

/// Why so many fits give no interval, where they give none.
fn too_few_fits(fits: &u32) -> Option<String> {
    (1..100)
        .contains(fits)
        .then(|| format!("{fits} fits say nothing of an interval: 0 for none, or 100 at the least"))
}

impl Settings {
    /// Whether there are many refits that do not depend on each other.
    #[must_use]
    pub fn has_independent_refits(&self) -> bool {
        matches!(self.intervals, Intervals::Profile | Intervals::Bootstrap)
            || self.monte_carlo_samples > 0
    }
}

/// What may move the plant beside its inputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum SoughtNoise {
    /// Nothing: the free run is compared with the data.
    #[default]
    None,
    /// Where the residuals of the free run are not white, the noise model that the data choose.
    Auto,
    /// These disturbances.
    Listed(Vec<SoughtDisturbance>),
}

/// The questions about an estimate.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// How much.
    pub settings: Settings,
    /// Where random numbers come from.
    pub seed: u64,
    /// Parameters that may be left out of the model ([`super::selection`]).
    pub effects: Vec<String>,
    /// What may move the plant beside its inputs.
    pub noise: SoughtNoise,
    /// Whether outputs of unknown noise are weighed anew and the budget of what is taken as known
    /// is drawn up, which takes many simulations.
    pub thorough: bool,
}

impl Request {
    /// The request without profiles, bootstraps and Monte Carlo: what follows from the curvature alone.
    #[must_use]
    pub fn at_once(&self) -> Request {
        Request {
            settings: Settings::default(),
            ..self.clone()
        }
    }

    /// The request about the free run alone, at once.
    #[must_use]
    pub fn of_free_run(&self) -> Request {
        Request {
            noise: SoughtNoise::None,
            ..self.at_once()
        }
    }
}
