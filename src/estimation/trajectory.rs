//! What one candidate's outputs look like beside the measured ones.

use super::problem::{Extent, Problem, Spelled};
use crate::numerics::lanes::Lanes;
use crate::simulation::batch::{self, Sink};
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
    single::outputs(problem.plant().as_ref(), &recordings, stop)
}

/// Samples of each experiment that the derivatives are counted over.
const COUNTED_SAMPLES: usize = 256;

/// About how many derivatives one candidate takes in the search: counted where each experiment
/// begins, and taken for the same over all of it. Answers nothing when `stop` was raised.
#[must_use]
pub fn derivatives(problem: &Problem, positions: &[f64], stop: &AtomicBool) -> Option<u64> {
    let spelled = Spelled::new(problem, &[positions.to_vec()]);
    let mut runs = spelled.runs(problem, Extent::Estimation, Accuracy::Screening);
    let shares: Vec<f64> = runs
        .iter_mut()
        .map(|run| {
            let samples = run.excitation.samples;
            run.excitation.samples = samples.min(COUNTED_SAMPLES);
            let intervals = |samples: usize| samples.saturating_sub(1).max(1) as f64;
            intervals(samples) / intervals(run.excitation.samples)
        })
        .collect();
    let pieces = batch::simulate(problem.plant().as_ref(), &runs, stop, |_run| Unread)?;
    let counts = pieces
        .iter()
        .map(|piece| piece.derivative_evaluations as f64 * shares[piece.run]);
    Some(counts.sum::<f64>() as u64)
}

/// Outputs that nobody reads.
struct Unread;

impl Sink for Unread {
    fn consume(&mut self, _first_sample: usize, _outputs: &[Lanes]) {}
}
