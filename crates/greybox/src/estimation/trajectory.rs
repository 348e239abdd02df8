//! What one candidate's outputs look like beside the measured ones.

use super::problem::{Experiment, Extent, Problem, Spelled};
use super::sensitivity::{Columns, record_runs};
use greybox_numerics::lanes::Lanes;
use greybox_simulation::batch::{self, Sink};
use greybox_simulation::single::{self, Outputs};
use greybox_simulation::{Accuracy, SimulationFailure};
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
) -> Option<Result<Vec<Outputs>, SimulationFailure>> {
    let spelled = Spelled::new(problem, &[positions.to_vec()]);
    let runs = spelled.runs(problem, Extent::Whole, Accuracy::Full);
    let recordings: Vec<_> = runs
        .iter()
        .map(|run| (run.excitation, run.candidates[0]))
        .collect();
    single::outputs(problem.plant().as_ref(), &recordings, stop)
}

/// The errors of a candidate's coordinates.
#[derive(Clone, Debug)]
pub struct Errors {
    /// The standard deviation of each coordinate, as a position.
    pub deviations: Vec<f64>,
    /// The correlations of the errors, row by row.
    pub correlation: Vec<Vec<f64>>,
}

/// Numbers that are held at the most to tell how far outputs are off.
const MOST_NUMBERS: usize = 32 << 20;

/// One standard deviation of each simulated output through the errors of the candidate, over the whole
/// of every experiment: for each experiment, for each output that is compared, its samples `[SI]`.
/// A coordinate moves by one standard deviation to both sides, and the outputs by half the
/// difference. Nothing where a neighbour cannot be simulated or where there are too many samples; answers
/// nothing at all when `stop` was raised.
#[must_use]
pub fn deviations(
    problem: &Problem,
    positions: &[f64],
    errors: &Errors,
    stop: &AtomicBool,
) -> Option<Option<Vec<Outputs>>> {
    let mut candidates = vec![positions.to_vec()];
    // The coordinates that move, each with how many standard deviations lie between its ends.
    let mut moves = Vec::new();
    let moving = errors.deviations.iter().enumerate();
    for (index, deviation) in moving.filter(|(_, deviation)| **deviation > 0.0) {
        let ends = [-deviation, *deviation].map(|by| (positions[index] + by).clamp(0.0, 1.0));
        candidates.extend(ends.map(|end| {
            let mut moved = positions.to_vec();
            moved[index] = end;
            moved
        }));
        moves.push((index, (ends[1] - ends[0]) / deviation));
    }
    let samples: usize = problem.experiments.iter().map(|data| data.samples).sum();
    if candidates.len() * samples * problem.outputs.len() > MOST_NUMBERS {
        return Some(None);
    }
    let spelled = Spelled::new(problem, &candidates).in_step(candidates.len());
    let runs = spelled.runs(problem, Extent::Whole, Accuracy::Full);
    let columns = record_runs(problem, &runs, stop)?;
    let mut failures = columns.iter().flat_map(|columns| &columns.failures);
    if failures.any(Option::is_some) {
        return Some(None);
    }
    let deviation = |columns: &Columns, sample: usize, output: usize| {
        let slope = |(place, (index, moved)): (usize, &(usize, f64))| {
            let [low, high] = [1, 2].map(|end| columns.value(2 * place + end, sample, output));
            (*index, (high - low) / moved)
        };
        let slopes: Vec<(usize, f64)> = moves.iter().enumerate().map(slope).collect();
        let pairs = slopes
            .iter()
            .flat_map(|a| slopes.iter().map(move |b| (a, b)));
        let terms = pairs.map(|(a, b)| errors.correlation[a.0][b.0] * a.1 * b.1);
        terms.sum::<f64>().max(0.0).sqrt()
    };
    let of_experiment = |(columns, experiment): (&Columns, &Experiment)| {
        let of_output = |output: usize| {
            let samples = 0..experiment.samples;
            samples
                .map(|sample| deviation(columns, sample, output))
                .collect()
        };
        (0..problem.outputs.len()).map(of_output).collect()
    };
    let experiments = columns.iter().zip(problem.experiments.iter());
    Some(Some(experiments.map(of_experiment).collect()))
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
