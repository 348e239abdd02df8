//! What a search is saved as.

use super::cma_es::Strategy;
use super::differential_evolution::{Learnt, Parent};
use crate::estimation::leaders::Judged;
use crate::estimation::observer::Counters;
use crate::estimation::stop_reason::Stagnation;
use crate::genetic::Chromosome;
use serde::{Deserialize, Serialize};

/// Everything that the next generation depends on.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct State {
    /// Generations of this search that were judged.
    pub generation: u32,
    /// The candidates of the next generation.
    pub population: Vec<Chromosome>,
    /// The parents that the candidates challenge, in differential evolution.
    #[serde(default)]
    pub parents: Vec<Parent>,
    /// What differential evolution has learnt.
    #[serde(default)]
    pub learnt: Learnt,
    /// What the candidates are drawn from, in covariance matrix adaptation.
    #[serde(default)]
    pub strategy: Option<Strategy>,
    /// The best distinct candidates so far, the champion first.
    pub leaders: Vec<Judged>,
    /// The largest credit so far, and the generation that first had it.
    pub best_credit: Option<(f64, u32)>,
    /// The generation in which the champion was found.
    pub best_generation: Option<u32>,
    /// What has been done.
    pub counters: Counters,
    /// The champion that climbed last.
    #[serde(default)]
    pub climbed: Option<Chromosome>,
    /// How long nothing has been gained.
    pub stagnation: Stagnation,
}
