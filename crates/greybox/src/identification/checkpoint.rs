//! What is written down of a run: all that resumes it, and the parts that nodes do for each other.

use super::tried::Tries;
use crate::estimation::{EstimationCheckpoint, SearchUpdate};
use crate::uncertainty::refits::{Refit, RefitName};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// All that is needed to resume a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    #[serde(flatten)]
    pub(super) estimation: EstimationCheckpoint,
    /// Finished refits of the analysis.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) refits: BTreeMap<RefitName, Refit>,
    /// The next steps that were tried.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) tries: Tries,
}

/// What one node did of a run and another takes over.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// A refit of the analysis.
    Refit(Refit),
    /// An update of a search.
    Search(SearchUpdate),
}

impl Part {
    pub(super) fn of_search(update: SearchUpdate) -> (String, Part) {
        (update.name(), Part::Search(update))
    }

    /// Whether the part is a refit.
    #[must_use]
    pub fn is_refit(&self) -> bool {
        matches!(self, Part::Refit(_))
    }

    /// How many generations the part has.
    #[must_use]
    pub fn generations(&self) -> usize {
        match self {
            Part::Refit(_) => 0,
            Part::Search(update) => update.generations(),
        }
    }
}
