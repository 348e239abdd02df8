//! What one candidate's outputs look like beside the measured ones.

use super::problem::{Extent, Problem, Spelled};
use crate::simulation::batch::{self, Sink};
use crate::simulation::lanes::Lanes;
use crate::simulation::{Accuracy, Failure};
use std::sync::atomic::AtomicBool;

/// The outputs of one candidate over the whole of one experiment, validation part included.
#[derive(Clone, Debug)]
pub struct Trajectory {
    /// For each of the model's outputs its samples, SI.
    pub outputs: Vec<Vec<f64>>,
}

/// Simulates one candidate over every experiment. Answers nothing when `stop` was raised.
///
/// # Errors
/// When the candidate's simulation fails.
pub fn simulate(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Option<Result<Vec<Trajectory>, Failure>> {
    let spelled = Spelled::new(problem, &[positions.to_vec()], None);
    let runs = spelled.runs(problem, Extent::Whole, Accuracy::Full);
    let n_outputs = problem.model.description().outputs.len();
    let recorder = |_run: usize| FirstLane {
        outputs: vec![Vec::new(); n_outputs],
    };
    let pieces = batch::simulate(problem.model.plant(), &runs, stop, recorder)?;
    let trajectory = |piece: batch::Piece<FirstLane>| match piece.failures[0] {
        Some(failure) => Err(failure),
        None => Ok(Trajectory {
            outputs: piece.sink.outputs,
        }),
    };
    Some(pieces.into_iter().map(trajectory).collect())
}

struct FirstLane {
    outputs: Vec<Vec<f64>>,
}

impl Sink for FirstLane {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        let n_outputs = self.outputs.len();
        for row in outputs.chunks_exact(n_outputs) {
            for (values, value) in self.outputs.iter_mut().zip(row) {
                values.push(value.0[0]);
            }
        }
    }
}
