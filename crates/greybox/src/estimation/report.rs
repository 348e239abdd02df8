//! What a run came to.

use super::floor::FloorReport;
use super::observer::Counters;
use super::refine::DescentEnd;
use super::stop_reason::StopReason;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
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
    /// The positions of the estimate with all that is taken as known at its declared value; none where the
    /// estimate is that one.
    pub declared_positions: Option<Vec<f64>>,
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
    pub starts: Vec<StartReport>,
    /// How many of them came to the lowest cost; none before any has ended.
    pub floor: Option<FloorReport>,
    /// Other minima as low as the estimate: each coordinate with its value, SI.
    pub twins: Vec<Vec<(String, f64)>>,
}

impl Report {
    /// How far each coordinate lies from the estimate with all declared values, positions; none where the
    /// estimate is that one.
    #[must_use]
    pub fn moved_from_declared(&self) -> Option<Vec<f64>> {
        let declared = self.declared_positions.as_ref()?;
        let pairs = self.positions.iter().zip(declared);
        Some(
            pairs
                .map(|(position, declared)| position - declared)
                .collect(),
        )
    }
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

/// One start of the refinement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StartReport {
    /// The cost at which the start began.
    pub initial_cost: Option<f64>,
    /// The cost at which the coarse descent of the start ended: starts are compared by it.
    pub cost: Option<f64>,
    /// The values at which the start ended, SI.
    pub parameters: BTreeMap<String, f64>,
    /// Why the start ended: `converged`, `merged` (its step led within a standard error of a minimum that another
    /// start had found), `iteration_limit` or `failed`; `null` where the run was stopped before.
    #[serde(default)]
    #[schema(value_type = Option<String>)]
    pub end: Option<DescentEnd>,
}
