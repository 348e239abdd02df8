//! One candidate over one or more recordings, all outputs kept.

use super::batch::{self, BatchRun, Sink};
use super::{DrivingInputs, Plant, SimulatedCandidate, SimulationFailure};
use greybox_numerics::lanes::Lanes;
use std::sync::atomic::AtomicBool;

/// For each output its samples, SI.
pub type Outputs = Vec<Vec<f64>>;

/// Simulates one candidate over each recording. Answers nothing when `stop` was raised.
///
/// # Errors
/// How the candidate failed, if it did in any recording.
pub fn outputs(
    plant: &dyn Plant,
    recordings: &[(DrivingInputs<'_>, SimulatedCandidate<'_>)],
    stop: &AtomicBool,
) -> Option<Result<Vec<Outputs>, SimulationFailure>> {
    let runs: Vec<BatchRun<'_>> = recordings
        .iter()
        .map(|&(excitation, candidate)| BatchRun {
            excitation,
            candidates: vec![candidate],
            in_step: 0,
        })
        .collect();
    let recorder = |_run: usize| FirstLane(vec![Vec::new(); plant.n_outputs()]);
    let pieces = batch::simulate(plant, &runs, stop, recorder)?;
    let outputs = pieces.into_iter().map(|piece| match piece.failures[0] {
        Some(failure) => Err(failure),
        None => Ok(piece.sink.0),
    });
    Some(outputs.collect())
}

struct FirstLane(Outputs);

impl Sink for FirstLane {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        for row in outputs.chunks_exact(self.0.len()) {
            for (values, value) in self.0.iter_mut().zip(row) {
                values.push(value.0[0]);
            }
        }
    }
}
