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

/// Half the distance of a central difference, as a share of the search range. All lanes take the
/// same steps, so that only rounding counts against a short one; a long one sees where commands
/// saturate and ports open, and errs with the root of its length.
const SHIFT: f64 = 1e-5;

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
    /// ∂residual/∂position of each coordinate, or along each direction.
    pub derivatives: &'a [f64],
}

/// Along what a problem is differentiated.
#[derive(Clone, Copy, Debug)]
pub struct Directions<'a> {
    /// A point of the search box.
    pub from: &'a [f64],
    /// Vectors of the search box.
    pub vectors: &'a [Vec<f64>],
    /// How much of each vector is gone to both sides.
    pub shift: f64,
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

/// Visits every residual that the problem is estimated from, sample by sample, with its
/// derivatives by the coordinates.
///
/// # Errors
/// When the stop flag was raised, or a simulation failed.
pub fn visit_rows(
    problem: &Problem,
    positions: &[f64],
    accuracy: Accuracy,
    stop: &AtomicBool,
    visit: impl FnMut(Row<'_>),
) -> Result<(), SensitivityError> {
    let n = positions.len();
    let axes: Vec<Vec<f64>> = (0..n)
        .map(|axis| {
            (0..n)
                .map(|index| if index == axis { 1.0 } else { 0.0 })
                .collect()
        })
        .collect();
    let axes = Directions {
        from: positions,
        vectors: &axes,
        shift: SHIFT,
    };
    visit_directions(problem, axes, accuracy, stop, visit)
}

/// The same with derivatives along given directions of the box.
///
/// # Errors
/// As [`visit_rows`].
pub fn visit_directions(
    problem: &Problem,
    directions: Directions<'_>,
    accuracy: Accuracy,
    stop: &AtomicBool,
    mut visit: impl FnMut(Row<'_>),
) -> Result<(), SensitivityError> {
    let Directions {
        from: positions,
        vectors,
        shift,
    } = directions;
    let steps: Vec<(f64, f64)> = vectors
        .iter()
        .map(|direction| steps(positions, direction, shift))
        .collect();
    let candidates = shifted_candidates(positions, vectors, &steps);
    let recorded = record(problem, &candidates, accuracy, stop)?;
    let mut derivatives = vec![0.0; vectors.len()];
    for (experiment, sample, output) in places(problem) {
        let measured = problem.experiments[experiment].measured[output][sample];
        if measured.is_nan() {
            continue;
        }
        let scale = problem.outputs[output].residual_scale;
        let at = |column: usize| recorded[experiment].value(column, sample, output);
        for (column, derivative) in derivatives.iter_mut().enumerate() {
            let (back, ahead) = steps[column];
            let change = at(2 + 2 * column) - at(1 + 2 * column);
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

/// How far one goes back and ahead along a direction: at a bound, to one side only.
fn steps(positions: &[f64], direction: &[f64], shift: f64) -> (f64, f64) {
    let room = |side: f64| {
        let each = positions.iter().zip(direction).map(|(position, part)| {
            let part = side * part;
            if part > 0.0 {
                (1.0 - position).max(0.0) / part
            } else if part < 0.0 {
                position.max(0.0) / -part
            } else {
                f64::INFINITY
            }
        });
        each.fold(shift, f64::min)
    };
    (room(-1.0), room(1.0))
}

/// The candidate, then for each direction its neighbours back and ahead.
fn shifted_candidates(
    positions: &[f64],
    directions: &[Vec<f64>],
    steps: &[(f64, f64)],
) -> Vec<Vec<f64>> {
    let mut candidates = vec![positions.to_vec()];
    for (direction, (back, ahead)) in directions.iter().zip(steps) {
        for step in [-back, *ahead] {
            let pairs = positions.iter().zip(direction);
            candidates.push(
                pairs
                    .map(|(position, part)| position + step * part)
                    .collect(),
            );
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
