//! How the residuals move with the coordinates, by central differences.
//!
//! All columns are simulated together as one batch, with the same integration steps, so that the
//! differences are those of the equations and not of the step control. Positions, not values,
//! are shifted: what comes out is ∂residual/∂position.

use super::problem::{Extent, Problem, Spelled};
use crate::simulation::batch::{self, Sink};
use crate::simulation::lanes::{LANES, Lanes};
use crate::simulation::{Accuracy, Failure};
use std::sync::atomic::AtomicBool;

/// Half the distance of a central difference, as a share of the search range. Its truncation
/// error is of the order of its square; the integrator's noise counts against its inverse.
const SHIFT: f64 = 1e-3;

/// One residual and its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    /// The experiment.
    pub experiment: usize,
    /// The output, by its place in the problem.
    pub output: usize,
    /// The sample.
    pub sample: usize,
    /// (measured − simulated)/scale.
    pub residual: f64,
    /// ∂residual/∂position of each coordinate.
    pub derivatives: &'a [f64],
}

/// Why there are no derivatives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SensitivityError {
    /// The stop flag was raised.
    #[error("interrupted")]
    Interrupted,
    /// The candidate itself, or its neighbour along a coordinate, cannot be simulated.
    #[error("the simulation near the estimate fails ({0:?})")]
    Failed(Failure),
}

/// Visits every residual that the problem is estimated from, sample by sample.
///
/// # Errors
/// When the stop flag was raised, or a simulation failed.
pub fn visit_rows(
    problem: &Problem,
    positions: &[f64],
    accuracy: Accuracy,
    stop: &AtomicBool,
    mut visit: impl FnMut(Row<'_>),
) -> Result<(), SensitivityError> {
    let shifts: Vec<(f64, f64)> = positions.iter().map(|z| shifts(*z)).collect();
    let candidates = shifted_candidates(positions, &shifts);
    let recorded = record(problem, &candidates, accuracy, stop)?;
    let mut derivatives = vec![0.0; positions.len()];
    for (experiment, sample, output) in places(problem) {
        let measured = problem.experiments[experiment].measured[output][sample];
        if measured.is_nan() {
            continue;
        }
        let scale = problem.outputs[output].residual_scale;
        let at = |column: usize| recorded[experiment].value(column, sample, output);
        for (coordinate, derivative) in derivatives.iter_mut().enumerate() {
            let (back, ahead) = shifts[coordinate];
            let change = at(2 + 2 * coordinate) - at(1 + 2 * coordinate);
            *derivative = -change / (back + ahead) / scale;
        }
        let residual = (measured - at(0)) / scale;
        let derivatives = &derivatives;
        visit(Row {
            experiment,
            output,
            sample,
            residual,
            derivatives,
        });
    }
    Ok(())
}

/// Every (experiment, sample, output) that is estimated from, sample by sample.
fn places(problem: &Problem) -> impl Iterator<Item = (usize, usize, usize)> {
    let n_outputs = problem.outputs.len();
    problem
        .experiments
        .iter()
        .enumerate()
        .flat_map(move |(experiment, data)| {
            (0..data.estimation_samples).flat_map(move |sample| {
                (0..n_outputs).map(move |output| (experiment, sample, output))
            })
        })
}

/// How far a position is shifted back and ahead: at a bound, to one side only.
fn shifts(position: f64) -> (f64, f64) {
    (
        SHIFT.min(position.max(0.0)),
        SHIFT.min((1.0 - position).max(0.0)),
    )
}

/// The candidate, then for each coordinate its neighbours back and ahead.
fn shifted_candidates(positions: &[f64], shifts: &[(f64, f64)]) -> Vec<Vec<f64>> {
    let mut candidates = vec![positions.to_vec()];
    for (coordinate, (back, ahead)) in shifts.iter().enumerate() {
        for shift in [-back, *ahead] {
            let mut shifted = positions.to_vec();
            shifted[coordinate] += shift;
            candidates.push(shifted);
        }
    }
    candidates
}

/// The outputs of all candidates over one experiment.
struct Columns {
    /// For each candidate the piece that holds it and its lane there.
    places: Vec<(usize, usize)>,
    pieces: Vec<Vec<Lanes>>,
    n_outputs: usize,
}

impl Columns {
    fn value(&self, candidate: usize, sample: usize, output: usize) -> f64 {
        let (piece, lane) = self.places[candidate];
        self.pieces[piece][sample * self.n_outputs + output].0[lane]
    }
}

fn record(
    problem: &Problem,
    candidates: &[Vec<f64>],
    accuracy: Accuracy,
    stop: &AtomicBool,
) -> Result<Vec<Columns>, SensitivityError> {
    let spelled = Spelled::new(
        problem,
        candidates,
        Some(problem.resolved_rate(&candidates[0])),
    );
    let runs = spelled.runs(problem, Extent::Estimation, accuracy);
    let recorder = |run: usize| Recorder {
        chosen: problem.outputs.iter().map(|output| output.index).collect(),
        n_outputs: problem.model.description().outputs.len(),
        rows: Vec::with_capacity(runs[run].excitation.samples * problem.outputs.len()),
    };
    let pieces = batch::simulate(problem.model.plant(), &runs, stop, recorder)
        .ok_or(SensitivityError::Interrupted)?;
    let empty = || Columns {
        places: vec![(0, 0); candidates.len()],
        pieces: Vec::new(),
        n_outputs: problem.outputs.len(),
    };
    let mut columns: Vec<Columns> = problem.experiments.iter().map(|_| empty()).collect();
    for piece in pieces {
        if let Some(failure) = piece.failures[..piece.members.len().min(LANES)]
            .iter()
            .find_map(|failure| *failure)
        {
            return Err(SensitivityError::Failed(failure));
        }
        let of_experiment = &mut columns[piece.run];
        for (lane, &member) in piece.members.iter().enumerate() {
            of_experiment.places[member] = (of_experiment.pieces.len(), lane);
        }
        of_experiment.pieces.push(piece.sink.rows);
    }
    Ok(columns)
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
