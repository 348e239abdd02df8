//! How far a run came.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The part of the method that a job is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// The genetic search, generation after generation.
    Search,
    /// Local least squares from the best candidates.
    Refine,
    /// Standard errors, intervals and the verdict.
    Analyse,
}

/// What a unit of work came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// There is more to do.
    Working,
    /// The stop flag was raised; nothing has changed.
    Interrupted,
    /// The estimate stands.
    Finished,
}

/// How far a job came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// The part of the method that it is in.
    pub phase: Phase,
    /// Generations finished.
    pub generation: u32,
    /// The most generations that there can be.
    pub generations: u32,
    /// Candidates judged.
    pub evaluations: u64,
    /// The lowest cost so far.
    pub best_cost: Option<f64>,
    /// The largest credit of the last generation.
    pub best_credit: Option<f64>,
    /// How much of the most work there can be is done, 0 to 1.
    pub fraction: f64,
    /// Working time until the end if all generations are needed `[s]`.
    pub eta_s: Option<f64>,
}
