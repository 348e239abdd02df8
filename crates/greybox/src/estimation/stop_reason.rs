//! Why a run ends.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Why a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StopReason {
    /// All generations have been judged.
    GenerationLimit,
    /// The cost target was reached.
    CostTarget,
    /// What the best candidate leaves is the declared noise.
    NoiseFloor,
    /// Nothing was gained in many generations.
    Stagnation,
    /// The job's time was used up.
    TimeLimit,
    /// The job was cancelled.
    Cancelled,
    /// The job was paused.
    Paused,
}

impl StopReason {
    /// The name in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            StopReason::GenerationLimit => "generation_limit",
            StopReason::CostTarget => "cost_target",
            StopReason::NoiseFloor => "noise_floor",
            StopReason::Stagnation => "stagnation",
            StopReason::TimeLimit => "time_limit",
            StopReason::Cancelled => "cancelled",
            StopReason::Paused => "paused",
        }
    }
}

/// A gain that counts: this share of the cost.
const SMALLEST_GAIN: f64 = 1e-3;

/// How long nothing has been gained.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct Stagnation {
    /// The cost that the next gain is measured against.
    reference: Option<f64>,
    /// Generations since.
    generations: u32,
}

impl Stagnation {
    /// Takes note of the lowest cost after a generation. Answers whether the search has gained
    /// nothing for `patience` generations; a patience of 0 never runs out.
    pub fn observe(&mut self, cost: f64, patience: u32) -> bool {
        if !cost.is_finite() {
            return false;
        }
        match self.reference {
            Some(reference) if cost > reference * (1.0 - SMALLEST_GAIN) => self.generations += 1,
            _ => {
                *self = Stagnation {
                    reference: Some(cost),
                    generations: 0,
                }
            }
        }
        patience > 0 && self.generations >= patience
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_gains_that_never_add_up_stagnate() {
        let mut stagnation = Stagnation::default();
        let costs = [1.0, 0.9999, 0.9998, 0.9997];
        let stopped: Vec<bool> = costs
            .iter()
            .map(|cost| stagnation.observe(*cost, 3))
            .collect();
        assert_eq!(stopped, [false, false, false, true]);
    }

    #[test]
    fn small_gains_that_add_up_do_not() {
        let mut stagnation = Stagnation::default();
        let stopped = (0..100).any(|step| stagnation.observe(1.0 - 4e-4 * f64::from(step), 4));
        assert!(!stopped);
    }

    #[test]
    fn without_any_sound_candidate_the_search_goes_on() {
        let mut stagnation = Stagnation::default();
        assert!((0..50).all(|_| !stagnation.observe(f64::INFINITY, 3)));
    }
}
