//! The settings of the method: the paper's numbers as defaults, and what the paper leaves open.

use greybox_numerics::{settings, words};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Candidates in a generation of CMA-ES at the least: with fewer nothing is learnt from them.
const FEWEST_OF_CMA_ES: u32 = 4;
/// Candidates for each unknown, at the least, in a search that follows those which a job allows.
const CANDIDATES_OF_UNKNOWN: u32 = 5;
/// Generations at the most of such a search, in which the candidates become fewer.
const MOST_GENERATIONS: u32 = 2000;
/// Generations without a gain in which such a search ends.
const PATIENCE: u32 = 100;

/// How credits grow from one block of data to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CreditForm {
    /// The paper's Eq. 11, its gain held inside the stability bound.
    Paper,
    /// The exact flow of which Eq. 11 is the Euler step.
    #[default]
    Hedge,
}

/// How the error spread σ of Eq. 10 is adjusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ErrorSpread {
    /// Tied to the spread of the candidates' errors: the selection pressure stays the same while
    /// the population converges.
    #[default]
    Concentration,
    /// The mean of the candidates' errors. Decays into random search as they converge.
    MeanError,
    /// The lowest of the candidates' errors.
    BestError,
}

/// The order in which a generation's credits see the blocks of data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum BlockOrder {
    /// A seeded random order, new in each generation.
    #[default]
    Shuffled,
    /// As recorded. With an early stop the end of the record is never judged.
    Recorded,
}

/// The estimation method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum MethodName {
    /// ICRA credits and a genetic search, refined by least squares.
    #[default]
    IcraGenetic,
    /// Differential evolution, refined by least squares: to compare with.
    DifferentialEvolution,
    /// Covariance matrix adaptation evolution strategy, refined by least squares: to compare with.
    CmaEs,
    /// Least squares from `refine_candidates` random points of the box: to compare with.
    MultistartLm,
}

words!(CreditForm, ErrorSpread, BlockOrder, MethodName);

settings! {
    /// Everything that a job says under `method`.
    pub struct Settings {
        /// The method.
        name: MethodName = MethodName::default();
        /// Candidates in a generation (the paper's K, the λ of `cma_es`), 2 to 10 000; at least 4
        /// in `cma_es`.
        population: u32 = 30, from 2, to 10_000;
        /// Generations at the most, 0 to 1 000 000. 0 refines the middle of the box.
        generations: u32 = 1000, from 0, to 1_000_000;
        /// How likely two parents are crossed, 0 to 1.
        crossover_probability: f64 = 0.8, from 0, to 1;
        /// Fragments that a crossover cuts the strings into, 2 to 64.
        crossover_parts: u32 = 3, from 2, to 64;
        /// How likely each bit is reversed, 0 to 1.
        mutation_probability: f64 = 0.01, from 0, to 1;
        /// The credit gain ν, 0.01 to 300.
        credit_gain: f64 = 15.0, from 0.01, to 300;
        /// How credits grow.
        credit_form: CreditForm = CreditForm::default();
        /// How the error spread σ is adjusted.
        error_spread: ErrorSpread = ErrorSpread::default();
        /// The entropy, as a share of its maximum, at which the concentration rule aims, 0.05 to 0.95.
        entropy_target: f64 = 0.5, from 0.05, to 0.95;
        /// Samples in a block (the paper's N), 1 to 1 000 000.
        block_samples: u32 = 15, from 1, to 1_000_000;
        /// The order in which the blocks are judged.
        block_order: BlockOrder = BlockOrder::default();
        /// Credit updates at the most in one generation (the paper's T); absent: one for each block.
        credit_updates: Option<u32> = None, from 1, to 1_000_000;
        /// Bits of the Gray code for each parameter, 4 to 32. `cma_es`, whose steps become finer than
        /// 16 bits are, always takes 32.
        bits_per_parameter: u32 = 16, from 4, to 32;
        /// Whether the candidate with the lowest cost always survives.
        elitism: bool = true;
        /// Every so many generations the elite takes one least-squares step; 0: never.
        hill_climbing_interval: u32 = 2, from 0, to 1_000_000;
        /// Stop when the lowest cost has gained less than 0.1 % in so many generations; 0: never.
        stagnation_generations: u32 = 10, from 0, to 1_000_000;
        /// Whether the search stops where the residuals of the best candidate are as small as the
        /// declared noise and least squares promises nothing better. Looked at when the elite climbs
        /// (`hill_climbing_interval`), and so in `icra_genetic` only.
        noise_floor: bool = true;
        /// Stop at this cost.
        cost_target: Option<f64> = None, from 0;
        /// A residual larger than so many times the declared noise counts linearly and not squared
        /// (Huber's loss), 0.5 to 100; absent: all count squared. For recordings with outliers; every
        /// measured output needs its `noise_std`. 1.345 costs 5 % of efficiency where there are none.
        huber_threshold: Option<f64> = None, from 0.5, to 100;
        /// Independent searches, 1 to 32. With more than one the best candidate of each is refined,
        /// and the result shows how far they agree. `multistart_lm` begins so many times as often.
        restarts: u32 = 1, from 1, to 32;
        /// Further searches at the most, 0 to 31, that begin by themselves where it is in doubt whether
        /// the lowest minimum is the floor: where only one start came to it, where what is left is
        /// larger than the noise, or where a constant explains as much. They end when two searches
        /// have come to the same lowest cost. Where up to 100 residuals leave the floor in doubt, so many
        /// times as many may follow as there are unknowns: searches of `icra_genetic` are then followed
        /// by `differential_evolution` with at least five candidates for each unknown at first.
        further_searches: u32 = 4, from 0, to 31;
        /// Whether Levenberg–Marquardt refines the best candidates at the end.
        refine: bool = true;
        /// How many distinct candidates are refined, 1 to 32.
        refine_candidates: u32 = 3, from 1, to 32;
    }
}

impl Settings {
    /// The settings of the search with a number, from 0. What the hybrid search has not found in all the
    /// searches that a job allows, differential evolution looks for with more candidates and more patience
    /// (measured in `benches/studies/tried.md`).
    #[must_use]
    pub fn of_search(&self, number: u32, unknowns: usize) -> Settings {
        let is_allowed = number < self.restarts + self.further_searches;
        if is_allowed || self.name != MethodName::IcraGenetic {
            return self.clone();
        }
        let candidates = CANDIDATES_OF_UNKNOWN.saturating_mul(unknowns as u32);
        let patience = match self.stagnation_generations {
            0 => 0,
            generations => generations.max(PATIENCE),
        };
        Settings {
            name: MethodName::DifferentialEvolution,
            population: self.population.max(candidates),
            generations: MOST_GENERATIONS,
            stagnation_generations: patience,
            ..self.clone()
        }
    }

    /// Why the method cannot work with these settings, if it cannot.
    #[must_use]
    pub fn contradiction(&self) -> Option<&'static str> {
        match self.name {
            MethodName::MultistartLm if !self.refine => {
                Some("`multistart_lm` is nothing but refinement: leave `refine` at true")
            }
            MethodName::CmaEs if self.population < FEWEST_OF_CMA_ES => {
                Some("`cma_es` needs a `population` of at least 4 to learn from")
            }
            _ => None,
        }
    }
}
