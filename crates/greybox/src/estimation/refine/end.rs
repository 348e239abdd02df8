//! Why a descent ended.

use serde::{Deserialize, Serialize};

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DescentEnd {
    /// No step gains anything more.
    Converged,
    /// A step leads within a standard error of a minimum that another descent has found, and the
    /// descent is taken to end there.
    Merged,
    /// The iterations are used up.
    IterationLimit,
    /// The candidate or its neighbours cannot be simulated.
    Failed,
}

impl DescentEnd {
    /// The name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            DescentEnd::Converged => "converged",
            DescentEnd::Merged => "merged",
            DescentEnd::IterationLimit => "iteration_limit",
            DescentEnd::Failed => "failed",
        }
    }
}
