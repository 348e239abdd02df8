//! The stages of a run, with what belongs to each alone.

use super::progress::Phase;
use super::shooting::Shooting;
use serde::{Deserialize, Serialize};

/// Where a run stands.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(tag = "phase", rename_all = "snake_case")]
pub(super) enum Stage {
    /// A search goes on, generation after generation.
    #[default]
    Search,
    /// The best candidates of the searches are refined.
    Refine(Refinement),
    /// The estimate stands.
    Analyse {
        /// Other minima as low as the estimate.
        #[serde(default)]
        twins: Vec<Vec<f64>>,
    },
}

impl Stage {
    /// The part of the method that the stage belongs to.
    pub fn phase(&self) -> Phase {
        match self {
            Stage::Search => Phase::Search,
            Stage::Refine(_) => Phase::Refine,
            Stage::Analyse { .. } => Phase::Analyse,
        }
    }
}

/// How a refinement goes on. Serialises as the list of descents over segments, which is empty where
/// the free run descends.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "SavedRefinement", into = "SavedRefinement")]
pub(super) enum Refinement {
    /// The best candidates of a search descend over segments; then the free run descends from
    /// where they came to.
    OverSegments(Vec<Shooting>),
    /// The descents of the free run go on, side by side.
    FreeRun,
}

#[derive(Serialize, Deserialize)]
struct SavedRefinement {
    #[serde(default)]
    shootings: Vec<Shooting>,
}

impl From<SavedRefinement> for Refinement {
    fn from(saved: SavedRefinement) -> Refinement {
        match saved.shootings {
            none if none.is_empty() => Refinement::FreeRun,
            shootings => Refinement::OverSegments(shootings),
        }
    }
}

impl From<Refinement> for SavedRefinement {
    fn from(refinement: Refinement) -> SavedRefinement {
        SavedRefinement {
            shootings: match refinement {
                Refinement::OverSegments(shootings) => shootings,
                Refinement::FreeRun => Vec::new(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// Reads a stage, and writes it again.
    fn rewritten(saved: &Value) -> (Stage, Value) {
        let stage = Stage::deserialize(saved).expect("a stage");
        let written = serde_json::to_value(&stage).expect("JSON");
        (stage, written)
    }

    /// Commit 2eabe3d wrote the fields of all stages in each.
    #[test]
    fn every_stage_reads_from_the_fields_of_all_stages() {
        let shooting = json!({
            "search": 0, "positions": [0.25], "starts": null, "weight": null, "damping": 1.0,
            "iterations": 1, "with_weight": 1, "evaluations": 3, "has_ended": false
        });
        let fields = |phase: &str, shootings: &[&Value], twins: Value| json!({"phase": phase, "shootings": shootings, "twins": twins});
        let (stage, written) = rewritten(&fields("search", &[], json!([])));
        assert!(matches!(stage, Stage::Search));
        assert_eq!(written, json!({"phase": "search"}));
        let (stage, written) = rewritten(&fields("refine", &[], json!([])));
        assert!(matches!(stage, Stage::Refine(Refinement::FreeRun)));
        assert_eq!(written, json!({"phase": "refine", "shootings": []}));
        let (stage, written) = rewritten(&fields("refine", &[&shooting], json!([])));
        assert!(matches!(stage, Stage::Refine(Refinement::OverSegments(_))));
        assert_eq!(written, json!({"phase": "refine", "shootings": [shooting]}));
        let (stage, written) = rewritten(&fields("analyse", &[], json!([[0.5]])));
        assert!(matches!(stage, Stage::Analyse { twins } if twins == [[0.5]]));
        assert_eq!(written, json!({"phase": "analyse", "twins": [[0.5]]}));
    }
}
