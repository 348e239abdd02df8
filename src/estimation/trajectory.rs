//! What one candidate's outputs look like beside the measured ones.

use super::problem::{Extent, Problem, Spelled};
use crate::simulation::single::{self, Outputs};
use crate::simulation::{Accuracy, Failure};
use std::sync::atomic::AtomicBool;

/// Simulates one candidate over the whole of every experiment, validation parts included:
/// for each experiment, for each of the model's outputs, its samples `[SI]`. Answers nothing when
/// `stop` was raised.
///
/// # Errors
/// When the candidate's simulation fails.
pub fn simulate(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Option<Result<Vec<Outputs>, Failure>> {
    let spelled = Spelled::new(problem, &[positions.to_vec()]);
    let runs = spelled.runs(problem, Extent::Whole, Accuracy::Full);
    let recordings: Vec<_> = runs
        .iter()
        .map(|run| (run.excitation, run.candidates[0]))
        .collect();
    single::outputs(problem.model.plant(), &recordings, stop)
}
