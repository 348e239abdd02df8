//! What a run came to.

use super::floor::Floor;
use super::observer::Counters;
use super::problem::Problem;
use super::refine::DescentEnd;
use super::stage::Stage;
use super::{Estimation, StopReason};
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
    /// Where it ended: each coordinate with its value, SI.
    pub values: Vec<(String, f64)>,
    /// Iterations.
    pub iterations: u32,
    /// Why it ended, if it did.
    pub end: Option<DescentEnd>,
}

impl Report {
    pub(super) fn new(
        problem: &Problem,
        run: &Estimation,
        positions: Vec<f64>,
        stopped: Option<StopReason>,
    ) -> Report {
        let total = run.state.totals.and(&run.search.state);
        let twins = match &run.state.stage {
            Stage::Analyse { twins } => &twins[..],
            Stage::Search | Stage::Refine(_) => &[],
        };
        let reason = stopped
            .or(run.state.stop_reason)
            .unwrap_or(StopReason::GenerationLimit);
        Report {
            stop_reason: reason,
            values: problem.values(&positions),
            positions,
            cost: run.best_cost(),
            generations: total.generations,
            counters: total.counters,
            best_credit: total.best_credit.map(|(credit, _)| credit),
            best_generation: total.best_generation,
            searches: run
                .state
                .searches
                .iter()
                .map(|search| SearchEnd {
                    stop_reason: search.stop_reason,
                    generations: search.generations,
                    cost: search
                        .leaders
                        .first()
                        .map(|champion| champion.cost)
                        .filter(|cost| cost.is_finite()),
                })
                .collect(),
            refinements: run
                .state
                .descents
                .iter()
                .map(|descent| Refinement {
                    start_cost: descent.start_cost,
                    coarse_cost: descent.coarse_cost.or(descent.cost),
                    cost: descent.cost,
                    values: problem.named_values(&descent.positions),
                    iterations: descent.iterations,
                    end: descent.end,
                })
                .collect(),
            floor: Floor::of(&run.landmarks, &run.state.descents),
            twins: twins
                .iter()
                .map(|positions| problem.named_values(positions))
                .collect(),
        }
    }
}
