//! What a result says of the search: its generations, its starts, and how often the lowest cost was
//! found.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What the search did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SearchReport {
    /// Generations completed.
    pub generations: u32,
    /// Candidates judged, repeats included.
    pub evaluations: u64,
    /// Candidates simulated; repeats are not simulated again.
    pub distinct_evaluations: u64,
    /// Candidates whose simulation failed, counted by cause.
    pub failed_evaluations: BTreeMap<String, u64>,
    /// The best credit of the last generation; `null` for methods without credits.
    pub best_credit: Option<f64>,
    /// The generation in which the champion was found.
    pub best_generation: Option<u32>,
}

/// One start of the refinement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StartReport {
    /// The cost where it started.
    pub initial_cost: Option<f64>,
    /// The cost where its coarse descent ended: what the starts are compared by.
    pub cost: Option<f64>,
    /// Where it ended, SI.
    pub parameters: BTreeMap<String, f64>,
    /// Why: `converged`, `merged` (its step led within a standard error of a minimum that another
    /// start had found), `iteration_limit` or `failed`; `null` where the run was stopped before.
    #[serde(default)]
    pub end: Option<String>,
}

/// How often the lowest cost was found. The starts that look for a twin do not count.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FloorReport {
    /// Starts of the refinement that came to a cost.
    pub starts: u64,
    /// Starts of the refinement that came to the lowest cost.
    pub starts_at_floor: u64,
    /// Searches whose starts came to the lowest cost.
    pub searches_at_floor: u64,
    /// Whether a constant explains the data as well.
    pub plateau: bool,
    /// Minima of other parameters that cost as little: each unknown with its value, SI.
    pub twins: Vec<BTreeMap<String, f64>>,
}
