//! Hill-climbing within the search: the least-squares steps of one candidate, and whether it
//! already stands where only noise is left.

use super::problem::Problem;
use super::refine::{self, Linearisation};
use super::sensitivity::SensitivityError;
use greybox_numerics::statistics;
use greybox_simulation::Accuracy;
use std::sync::atomic::AtomicBool;

/// What hill-climbing came to.
#[derive(Debug, Default)]
pub struct HillClimb {
    /// Where the least-squares steps lead.
    pub to: Vec<Vec<f64>>,
    /// Whether there is nothing left to climb but noise.
    pub at_floor: bool,
    /// Candidates simulated for it.
    pub evaluations: u64,
}

impl HillClimb {
    /// The dampings of the steps.
    const DAMPINGS: [f64; 4] = [1e-4, 1e-2, 1.0, 1e2];
    /// At the noise floor least squares may still promise so much of the cost.
    const FLOOR_GAIN: f64 = 1e-2;

    /// From a candidate. Answers nothing when `stop` was raised.
    #[must_use]
    pub fn from(problem: &Problem, positions: &[f64], stop: &AtomicBool) -> Option<HillClimb> {
        let linearisation = match refine::linearise(problem, positions, Accuracy::Screening, stop) {
            Ok(linearisation) => linearisation,
            Err(SensitivityError::Interrupted) => return None,
            Err(SensitivityError::Failed(_)) => return Some(HillClimb::default()),
        };
        let steps = refine::trial_steps(problem, &linearisation, positions, HillClimb::DAMPINGS);
        Some(HillClimb {
            to: steps.into_iter().map(|(_, moved)| moved).collect(),
            at_floor: HillClimb::is_at_floor(problem, &linearisation, positions),
            evaluations: positions.len() as u64 + 1,
        })
    }

    /// Whether a candidate explains the data up to the declared noise, and least squares promises
    /// nothing better around it: nothing that is left could tell another from it.
    fn is_at_floor(problem: &Problem, linearisation: &Linearisation, positions: &[f64]) -> bool {
        let is_noise = problem.declares_noise()
            && statistics::is_unit_mean_square(linearisation.cost, linearisation.triangle.rows());
        let outlook = || linearisation.outlook(problem, positions);
        is_noise && outlook().is_some_and(|outlook| outlook.gain < HillClimb::FLOOR_GAIN)
    }
}
