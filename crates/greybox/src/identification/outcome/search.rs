//! What a result says of the search: its generations and its candidates.

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
