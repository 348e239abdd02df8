//! The outputs of a candidate and its neighbours, as they are compared.

use crate::estimation::problem::{Extent, Problem, Spelled};
use crate::numerics::lanes::Lanes;
use crate::simulation::batch::{self, Sink};
use crate::simulation::{Accuracy, Failure};
use std::sync::atomic::AtomicBool;

/// The outputs of all candidates over one experiment.
#[derive(Debug)]
pub(super) struct Columns {
    /// For each candidate the piece that holds it and its lane there.
    places: Vec<(usize, usize)>,
    pub(super) failures: Vec<Option<Failure>>,
    pieces: Vec<Vec<Lanes>>,
    n_outputs: usize,
}

impl Columns {
    pub(super) fn value(&self, candidate: usize, sample: usize, output: usize) -> f64 {
        let (piece, lane) = self.places[candidate];
        self.pieces[piece][sample * self.n_outputs + output].0[lane]
    }
}

/// Simulates candidates, the first `in_step` of them with the steps of the first. Answers nothing
/// when the stop flag was raised.
pub(super) fn record(
    problem: &Problem,
    (candidates, in_step): (&[Vec<f64>], usize),
    accuracy: Accuracy,
    stop: &AtomicBool,
) -> Option<Vec<Columns>> {
    let spelled = Spelled::new(problem, candidates).in_step(in_step);
    let runs = spelled.runs(problem, Extent::Estimation, accuracy);
    let recorder = |run: usize| Recorder {
        chosen: problem.outputs.iter().map(|output| output.index).collect(),
        n_outputs: problem.model.description().outputs.len(),
        rows: Vec::with_capacity(runs[run].excitation.samples * problem.outputs.len()),
    };
    let pieces = batch::simulate(problem.plant().as_ref(), &runs, stop, recorder)?;
    let empty = || Columns {
        places: vec![(0, 0); candidates.len()],
        failures: vec![None; candidates.len()],
        pieces: Vec::new(),
        n_outputs: problem.outputs.len(),
    };
    let mut columns: Vec<Columns> = problem.experiments.iter().map(|_| empty()).collect();
    for piece in pieces {
        let of_experiment = &mut columns[piece.run];
        for (lane, &member) in piece.members.iter().enumerate() {
            of_experiment.places[member] = (of_experiment.pieces.len(), lane);
            of_experiment.failures[member] = piece.failures[lane];
        }
        of_experiment.pieces.push(piece.sink.rows);
    }
    Some(columns)
}

/// Keeps the outputs that are compared.
struct Recorder {
    chosen: Vec<usize>,
    n_outputs: usize,
    rows: Vec<Lanes>,
}

impl Sink for Recorder {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        for row in outputs.chunks_exact(self.n_outputs) {
            self.rows
                .extend(self.chosen.iter().map(|&output| row[output]));
        }
    }
}
