//! What a candidate is judged by: its error in each block of data, and its cost over all data.
//!
//! A residual is measured − simulated, divided by its output's residual scale (and more where the
//! sample has more noise than others). The error of a block is the root mean square of its
//! residuals (the paper's `|E_s^k|`, Eq. 10); the cost is their mean square over all the data that
//! are estimated from, and the priors. Where the job asks for another loss than the square
//! ([`loss`](super::loss)), that loss stands in the place of the square. Missing samples count
//! nowhere. Errors are summed while the simulation runs; no trajectory is stored.

use super::loss::Loss;
use super::problem::{Experiment, Extent, Problem, Spelled};
use greybox_numerics::lanes::{LANES, Lanes};
use greybox_simulation::batch::{self, Sink};
use greybox_simulation::{Accuracy, SimulationFailure};
use std::sync::atomic::AtomicBool;

/// How a candidate fared.
#[derive(Clone, Debug)]
pub struct Evaluation {
    /// The mean square of the scaled residuals; infinite for a candidate that failed.
    pub cost: f64,
    /// The root mean square of the scaled residuals in each block; infinite where it failed.
    pub block_errors: Vec<f64>,
    /// The failure of the simulation, where it failed.
    pub failure: Option<SimulationFailure>,
}

/// The data cut into blocks.
#[derive(Clone, Debug)]
pub struct Objective {
    block_samples: usize,
    /// Residuals in each block of each experiment.
    counts: Vec<Vec<usize>>,
    /// The weight of each of the problem's outputs.
    weights: Vec<f64>,
}

impl Objective {
    /// Cuts the experiments of a problem into blocks of `block_samples`.
    #[must_use]
    pub fn new(problem: &Problem, block_samples: usize) -> Objective {
        let counts = problem
            .experiments
            .iter()
            .map(|experiment| count(experiment, block_samples))
            .collect();
        let weights = problem
            .outputs
            .iter()
            .map(|output| 1.0 / output.residual_scale)
            .collect();
        Objective {
            block_samples,
            counts,
            weights,
        }
    }

    /// Blocks with at least one residual, over all experiments.
    #[must_use]
    pub fn n_blocks(&self) -> usize {
        self.counts
            .iter()
            .flatten()
            .filter(|count| **count > 0)
            .count()
    }

    /// Judges candidates. Answers nothing when `stop` was raised.
    #[must_use]
    pub fn evaluate(
        &self,
        problem: &Problem,
        candidates: &[Vec<f64>],
        accuracy: Accuracy,
        stop: &AtomicBool,
    ) -> Option<Vec<Evaluation>> {
        let spelled = Spelled::new(problem, candidates);
        let runs = spelled.runs(problem, Extent::Estimation, accuracy);
        let new_sink = |run: usize| SquareSums {
            experiment: &problem.experiments[run],
            outputs: problem.outputs.iter().map(|output| output.index).collect(),
            n_outputs: problem.model.description().outputs.len(),
            weights: &self.weights,
            loss: problem.loss,
            block_samples: self.block_samples,
            sums: vec![Lanes([0.0; LANES]); self.counts[run].len()],
        };
        let pieces = batch::simulate(problem.plant().as_ref(), &runs, stop, new_sink)?;
        let mut totals: Vec<Total> = vec![Total::default(); candidates.len()];
        // The pieces come experiment by experiment, so each candidate's blocks come in order.
        for piece in &pieces {
            for (lane, &member) in piece.members.iter().enumerate() {
                let sums = piece.sink.sums.iter().map(|sum| sum.0[lane]);
                totals[member].add(sums, &self.counts[piece.run], piece.failures[lane]);
            }
        }
        for (total, positions) in totals.iter_mut().zip(candidates) {
            let (sum, count) = problem.prior_sum(positions);
            total.sum += sum;
            total.count += count;
        }
        Some(totals.into_iter().map(Total::into_evaluation).collect())
    }
}

fn count(experiment: &Experiment, block_samples: usize) -> Vec<usize> {
    let mut counts = vec![0; experiment.estimation_samples.div_ceil(block_samples)];
    for values in &experiment.measured {
        let used = values[..experiment.estimation_samples].iter().enumerate();
        for (sample, _) in used.filter(|(_, value)| !value.is_nan()) {
            counts[sample / block_samples] += 1;
        }
    }
    counts
}

/// Sums the squares of the scaled residuals of each block.
struct SquareSums<'a> {
    experiment: &'a Experiment,
    outputs: Vec<usize>,
    n_outputs: usize,
    weights: &'a [f64],
    loss: Loss,
    block_samples: usize,
    sums: Vec<Lanes>,
}

impl Sink for SquareSums<'_> {
    fn consume(&mut self, first_sample: usize, outputs: &[Lanes]) {
        for (offset, row) in outputs.chunks_exact(self.n_outputs).enumerate() {
            let sample = first_sample + offset;
            let sum = &mut self.sums[sample / self.block_samples];
            let measured = self.experiment.measured.iter().map(|values| values[sample]);
            let outputs = self.outputs.iter().zip(measured).zip(self.weights);
            let present = outputs.enumerate().filter(|(_, ((_, y), _))| !y.is_nan());
            for (place, ((&output, measured), weight)) in present {
                let weight = weight * self.experiment.weight(place, sample);
                let residual = row[output].map(|value| self.loss.bent((measured - value) * weight));
                *sum += residual * residual;
            }
        }
    }
}

#[derive(Clone, Default)]
struct Total {
    sum: f64,
    count: usize,
    block_errors: Vec<f64>,
    failure: Option<SimulationFailure>,
}

impl Total {
    fn add(
        &mut self,
        sums: impl Iterator<Item = f64>,
        counts: &[usize],
        failure: Option<SimulationFailure>,
    ) {
        for (sum, &count) in sums.zip(counts).filter(|(_, count)| **count > 0) {
            self.sum += sum;
            self.count += count;
            self.block_errors.push((sum / count as f64).sqrt());
        }
        self.failure = self.failure.or(failure);
    }

    fn into_evaluation(mut self) -> Evaluation {
        let cost = self.sum / self.count as f64;
        if self.failure.is_none() && !cost.is_finite() {
            self.failure = Some(SimulationFailure::Diverged);
        }
        if self.failure.is_some() {
            self.block_errors.fill(f64::INFINITY);
            return Evaluation {
                cost: f64::INFINITY,
                block_errors: self.block_errors,
                failure: self.failure,
            };
        }
        Evaluation {
            cost,
            block_errors: self.block_errors,
            failure: None,
        }
    }
}
