//! What a run came to.

use super::floor::Floor;
use super::observer::Counters;
use super::refine::DescentEnd;
use super::stop_reason::StopReason;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a run came to.
#[derive(Clone, Debug)]
pub struct Report {
    /// Why it ended.
    pub stop_reason: StopReason,
    /// The position of each coordinate, 0 to 1 between its bounds.
    pub positions: Vec<f64>,
    /// The value of each coordinate, SI.
    pub values: Vec<f64>,
    /// The cost.
    pub cost: Option<f64>,
    /// Generations judged.
    pub generations: u32,
    /// What has been done.
    pub counters: Counters,
    /// The largest credit of any generation.
    pub best_credit: Option<f64>,
    /// The generation that found the best candidate of the search.
    pub best_generation: Option<u32>,
    /// Each search.
    pub searches: Vec<SearchEnd>,
    /// Each start of the refinement.
    pub refinements: Vec<Refinement>,
    /// How many of them came to the lowest cost; none before any has ended.
    pub floor: Option<Floor>,
    /// Other minima as low as the estimate: each coordinate with its value, SI.
    pub twins: Vec<Vec<(String, f64)>>,
}

/// How one of the searches ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SearchEnd {
    /// Why the search ended: `generation_limit`, `cost_target`, `noise_floor` or `stagnation`.
    pub stop_reason: StopReason,
    /// How many generations the search took.
    pub generations: u32,
    /// The cost of the best candidate of the search; `null` where all candidates failed.
    pub cost: Option<f64>,
}

/// One descent of the refinement.
#[derive(Clone, Debug)]
pub struct Refinement {
    /// The cost where it started.
    pub start_cost: Option<f64>,
    /// The cost where it ended, coarsely simulated: what the starts are compared by.
    pub coarse_cost: Option<f64>,
    /// The cost where it ended; finely simulated for the one that was polished.
    pub cost: Option<f64>,
    /// Where the descent ended: each coordinate with its value, SI.
    pub values: Vec<(String, f64)>,
    /// Iterations.
    pub iterations: u32,
    /// Why it ended, if it did.
    pub end: Option<DescentEnd>,
}
