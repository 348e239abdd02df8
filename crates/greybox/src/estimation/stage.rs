//! The stages of a run, with what belongs to each alone.

use super::progress::Phase;
use super::shooting::Shooting;
use serde::{Deserialize, Serialize};

/// Where a run stands.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(tag = "phase", rename_all = "snake_case")]
pub(super) enum EstimationStage {
    /// A search goes on, generation after generation.
    #[default]
    Search,
    /// The best candidates of the searches are refined.
    Refine(RefinementStage),
    /// The estimate stands.
    Analyse {
        /// Other minima as low as the estimate.
        #[serde(default)]
        twins: Vec<Vec<f64>>,
    },
}

impl EstimationStage {
    /// The part of the method that the stage belongs to.
    pub fn phase(&self) -> Phase {
        match self {
            EstimationStage::Search => Phase::Search,
            EstimationStage::Refine(_) => Phase::Refine,
            EstimationStage::Analyse { .. } => Phase::Analyse,
        }
    }
}

/// How a refinement goes on. Serialises as the list of descents over segments, which is empty where
/// the free run descends.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "SavedRefinement", into = "SavedRefinement")]
pub(super) enum RefinementStage {
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

impl From<SavedRefinement> for RefinementStage {
    fn from(saved: SavedRefinement) -> RefinementStage {
        match saved.shootings {
            none if none.is_empty() => RefinementStage::FreeRun,
            shootings => RefinementStage::OverSegments(shootings),
        }
    }
}

impl From<RefinementStage> for SavedRefinement {
    fn from(refinement: RefinementStage) -> SavedRefinement {
        SavedRefinement {
            shootings: match refinement {
                RefinementStage::OverSegments(shootings) => shootings,
                RefinementStage::FreeRun => Vec::new(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// Reads a stage, and writes it again.
    fn rewritten(saved: &Value) -> (EstimationStage, Value) {
        let stage = EstimationStage::deserialize(saved).expect("a stage");
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
        assert!(matches!(stage, EstimationStage::Search));
        assert_eq!(written, json!({"phase": "search"}));
        let (stage, written) = rewritten(&fields("refine", &[], json!([])));
        assert!(matches!(
            stage,
            EstimationStage::Refine(RefinementStage::FreeRun)
        ));
        assert_eq!(written, json!({"phase": "refine", "shootings": []}));
        let (stage, written) = rewritten(&fields("refine", &[&shooting], json!([])));
        assert!(matches!(
            stage,
            EstimationStage::Refine(RefinementStage::OverSegments(_))
        ));
        assert_eq!(written, json!({"phase": "refine", "shootings": [shooting]}));
        let (stage, written) = rewritten(&fields("analyse", &[], json!([[0.5]])));
        assert!(matches!(stage, EstimationStage::Analyse { twins } if twins == [[0.5]]));
        assert_eq!(written, json!({"phase": "analyse", "twins": [[0.5]]}));
    }
}
