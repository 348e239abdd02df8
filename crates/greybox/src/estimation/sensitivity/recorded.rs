//! The outputs of a candidate and its neighbours, as they are compared.

use crate::estimation::problem::{Extent, Problem, Spelled};
use greybox_numerics::lanes::Lanes;
use greybox_simulation::batch::{self, BatchRun, Sink};
use greybox_simulation::{Accuracy, SimulationFailure};
use std::sync::atomic::AtomicBool;

/// The outputs of all candidates over one experiment.
#[derive(Debug)]
pub struct Columns {
    /// For each candidate the piece that holds it and its lane there.
    places: Vec<(usize, usize)>,
    /// How each candidate has failed, if it has.
    pub failures: Vec<Option<SimulationFailure>>,
    pieces: Vec<Recorded>,
    n_outputs: usize,
}

/// What is kept of a piece.
#[derive(Debug)]
struct Recorded {
    outputs: Vec<Lanes>,
    /// The states at the last sample.
    states: Vec<Lanes>,
}

impl Columns {
    /// An output, by its place in the problem; behind the outputs of a problem that compares
    /// innovations stand their variances.
    pub fn value(&self, candidate: usize, sample: usize, output: usize) -> f64 {
        let (piece, lane) = self.places[candidate];
        self.pieces[piece].outputs[sample * self.n_outputs + output].0[lane]
    }

    /// A state at the last sample.
    pub fn last_state(&self, candidate: usize, state: usize) -> f64 {
        let (piece, lane) = self.places[candidate];
        self.pieces[piece].states[state].0[lane]
    }

    /// How many states there are.
    pub fn n_states(&self) -> usize {
        self.pieces.first().map_or(0, |piece| piece.states.len())
    }
}

/// Simulates candidates, the first `in_step` of them with the steps of the first. Answers nothing
/// when the stop flag was raised.
pub(super) fn record(
    problem: &Problem,
    candidates: &[Vec<f64>],
    in_step: usize,
    accuracy: Accuracy,
    stop: &AtomicBool,
) -> Option<Vec<Columns>> {
    let spelled = Spelled::new(problem, candidates).in_step(in_step);
    let runs = spelled.runs(problem, Extent::Estimation, accuracy);
    record_runs(problem, &runs, stop)
}

/// Simulates runs that all have as many candidates. Answers nothing when the stop flag was raised.
pub fn record_runs(
    problem: &Problem,
    runs: &[BatchRun<'_>],
    stop: &AtomicBool,
) -> Option<Vec<Columns>> {
    let mut chosen: Vec<usize> = problem.outputs.iter().map(|output| output.index).collect();
    if let Some(innovations) = &problem.innovations {
        let variances = problem.outputs.iter();
        chosen.extend(variances.map(|output| output.index + innovations.n_outputs));
    }
    let recorder = |run: usize| Recorder {
        chosen: chosen.clone(),
        n_outputs: problem.model.description().outputs.len(),
        recorded: Recorded {
            outputs: Vec::with_capacity(runs[run].excitation.samples * chosen.len()),
            states: Vec::new(),
        },
    };
    let pieces = batch::simulate(problem.plant().as_ref(), runs, stop, recorder)?;
    let empty = |run: &BatchRun<'_>| Columns {
        places: vec![(0, 0); run.candidates.len()],
        failures: vec![None; run.candidates.len()],
        pieces: Vec::new(),
        n_outputs: chosen.len(),
    };
    let mut columns: Vec<Columns> = runs.iter().map(empty).collect();
    for piece in pieces {
        let of_experiment = &mut columns[piece.run];
        for (lane, &member) in piece.members.iter().enumerate() {
            of_experiment.places[member] = (of_experiment.pieces.len(), lane);
            of_experiment.failures[member] = piece.failures[lane];
        }
        of_experiment.pieces.push(piece.sink.recorded);
    }
    Some(columns)
}

/// Keeps the outputs that are compared.
struct Recorder {
    chosen: Vec<usize>,
    n_outputs: usize,
    recorded: Recorded,
}

impl Sink for Recorder {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        for row in outputs.chunks_exact(self.n_outputs) {
            let chosen = self.chosen.iter().map(|&output| row[output]);
            self.recorded.outputs.extend(chosen);
        }
    }

    fn finish(&mut self, states: &[Lanes]) {
        self.recorded.states = states.to_vec();
    }
}
