//! The posterior density of candidates: how likely they make the data, times what is known of the
//! unknowns before.
//!
//! The density is that of the positions. A prior is a density of a value or of its logarithm; its
//! derivative by the position turns it into one of the position, so that the draws have the density
//! of the prior in the unit of the value. An unknown without a prior has a uniform density along the
//! scale of its search range: in its value, or on a log scale in its logarithm. Outside the search
//! range, where a constraint is broken and where the simulation fails the density is zero.
//!
//! With r the residuals of an output the logarithm of the likelihood is
//! - `−½·Σ(r/σ)²` where the level σ of the noise is given;
//! - `−½·n·ln Σr²` where it is not: the integral over σ with the density 1/σ (A. Gelman et al.,
//!   *Bayesian Data Analysis*, 2013, ch. 3), which is also the largest likelihood over σ;
//! - `−½·Σ(ε²/S + ln S)` for innovations ε with the variances S.
//!
//! Where residuals have a memory the logarithm is multiplied by the share of independent samples
//! among them.

use super::feasible;
use super::loss::Loss;
use super::problem::{Experiment, Extent, Problem, Spelled};
use greybox_numerics::lanes::{LANES, Lanes};
use greybox_simulation::batch::{self, Sink};
use greybox_simulation::{Accuracy, SimulationFailure};
use std::sync::atomic::AtomicBool;

/// How large the noise of an output is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NoiseLevel {
    /// The standard deviation is given, SI.
    Given(f64),
    /// The standard deviation is integrated out.
    Integrated,
}

/// How the residuals of an output count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutputNoise {
    /// How large the noise is; of no account where innovations are compared.
    pub level: NoiseLevel,
    /// How many independent samples the residuals are worth, where they have a memory.
    pub effective_samples: Option<f64>,
}

/// The posterior density of a problem, up to a factor.
#[derive(Debug)]
pub struct LogPosterior<'a> {
    problem: &'a Problem,
    /// How the residuals of each compared output count.
    noise: &'a [OutputNoise],
    /// The number of samples of each compared output.
    counts: Vec<f64>,
}

impl<'a> LogPosterior<'a> {
    /// The density under a noise of each compared output.
    #[must_use]
    pub fn new(problem: &'a Problem, noise: &'a [OutputNoise]) -> LogPosterior<'a> {
        LogPosterior {
            problem,
            noise,
            counts: counts(problem),
        }
    }

    /// The share of independent samples among those of an output: 1 where residuals have no memory.
    fn independent_share(&self, output: usize) -> f64 {
        let effective = self.noise[output].effective_samples;
        effective.map_or(1.0, |effective| (effective / self.counts[output]).min(1.0))
    }

    /// The least share of independent samples of any output.
    #[must_use]
    pub fn least_independent_share(&self) -> f64 {
        let outputs = 0..self.noise.len();
        let shares = outputs.map(|output| self.independent_share(output));
        shares.fold(1.0, f64::min)
    }

    /// The logarithm of the density at the positions of each candidate, −∞ where the density is
    /// zero. Answers nothing when `stop` was raised.
    #[must_use]
    pub fn evaluate(&self, candidates: &[Vec<f64>], stop: &AtomicBool) -> Option<Vec<f64>> {
        let problem = self.problem;
        let is_allowed = |positions: &[f64]| {
            let mut inside = positions.iter();
            inside.all(|position| (0.0..=1.0).contains(position))
                && feasible::holds(problem, positions)
        };
        let indices = 0..candidates.len();
        let allowed: Vec<usize> = indices.filter(|at| is_allowed(&candidates[*at])).collect();
        let members: Vec<Vec<f64>> = allowed.iter().map(|at| candidates[*at].clone()).collect();
        let mut densities = vec![f64::NEG_INFINITY; candidates.len()];
        let sums = self.simulate(&members, stop)?;
        for (at, sums) in allowed.into_iter().zip(sums) {
            let density = self.log_likelihood(&sums) + log_prior(problem, &candidates[at]);
            if sums.failure.is_none() && density.is_finite() {
                densities[at] = density;
            }
        }
        Some(densities)
    }

    /// Sums what the residuals of each candidate come to, experiment by experiment.
    fn simulate(&self, candidates: &[Vec<f64>], stop: &AtomicBool) -> Option<Vec<Sums>> {
        let problem = self.problem;
        let n_outputs = problem.outputs.len();
        let mut totals = vec![Sums::new(n_outputs); candidates.len()];
        if candidates.is_empty() {
            return Some(totals);
        }
        let spelled = Spelled::new(problem, candidates);
        let runs = spelled.runs(problem, Extent::Estimation, Accuracy::Full);
        let new_sink = |run: usize| ResidualSums {
            problem,
            noise: self.noise,
            experiment: &problem.experiments[run],
            n_columns: problem.model.description().outputs.len(),
            squares: vec![Lanes([0.0; LANES]); n_outputs],
            log_variances: vec![Lanes([0.0; LANES]); n_outputs],
        };
        let pieces = batch::simulate(problem.plant().as_ref(), &runs, stop, new_sink)?;
        for piece in &pieces {
            for (lane, &member) in piece.members.iter().enumerate() {
                totals[member].add(&piece.sink, lane, piece.failures[lane]);
            }
        }
        Some(totals)
    }

    fn log_likelihood(&self, sums: &Sums) -> f64 {
        let of_output = |(output, noise): (usize, &OutputNoise)| {
            let squares = sums.squares[output];
            let twice = match noise.level {
                _ if self.problem.innovations.is_some() => squares + sums.log_variances[output],
                NoiseLevel::Given(_) => squares,
                NoiseLevel::Integrated if self.counts[output] == 0.0 => 0.0,
                NoiseLevel::Integrated => self.counts[output] * libm::log(squares),
            };
            -0.5 * self.independent_share(output) * twice
        };
        self.noise.iter().enumerate().map(of_output).sum()
    }
}

/// The number of samples of each compared output that are estimated from.
pub(crate) fn counts(problem: &Problem) -> Vec<f64> {
    let count = |output: usize| {
        let used = problem.experiments.iter().map(|data| {
            let measured = &data.measured[output][..data.estimation_samples];
            measured.iter().filter(|value| !value.is_nan()).count()
        });
        used.sum::<usize>() as f64
    };
    (0..problem.outputs.len()).map(count).collect()
}

/// The logarithm of the density of the priors in the positions, up to a summand.
fn log_prior(problem: &Problem, positions: &[f64]) -> f64 {
    let (squares, _) = problem.prior_sum(positions);
    let coordinates = problem.coordinates.iter().zip(positions).enumerate();
    let jacobian = coordinates.filter_map(|(index, (coordinate, position))| {
        let prior = problem.prior_of(index)?;
        let slope = prior.slope(coordinate.value(*position)) * coordinate.slope(*position);
        Some(libm::log(slope.abs()))
    });
    jacobian.sum::<f64>() - 0.5 * squares
}

/// What the residuals of one candidate come to, by compared output.
#[derive(Clone, Debug)]
struct Sums {
    /// The sum of the squares, each over the variance of its noise where that is given.
    squares: Vec<f64>,
    /// The sum of the logarithms of the variances of innovations.
    log_variances: Vec<f64>,
    failure: Option<SimulationFailure>,
}

impl Sums {
    fn new(n_outputs: usize) -> Sums {
        Sums {
            squares: vec![0.0; n_outputs],
            log_variances: vec![0.0; n_outputs],
            failure: None,
        }
    }

    /// Adds what one lane came to over an experiment.
    fn add(
        &mut self,
        of_lanes: &ResidualSums<'_>,
        lane: usize,
        failure: Option<SimulationFailure>,
    ) {
        self.failure = self.failure.or(failure);
        for (sum, squares) in self.squares.iter_mut().zip(&of_lanes.squares) {
            *sum += squares.0[lane];
        }
        let pairs = self.log_variances.iter_mut().zip(&of_lanes.log_variances);
        pairs.for_each(|(sum, logarithms)| *sum += logarithms.0[lane]);
    }
}

/// Sums residuals while the simulation runs.
struct ResidualSums<'a> {
    problem: &'a Problem,
    noise: &'a [OutputNoise],
    experiment: &'a Experiment,
    n_columns: usize,
    squares: Vec<Lanes>,
    log_variances: Vec<Lanes>,
}

impl Sink for ResidualSums<'_> {
    fn consume(&mut self, first_sample: usize, outputs: &[Lanes]) {
        for (offset, row) in outputs.chunks_exact(self.n_columns).enumerate() {
            let sample = first_sample + offset;
            for output in 0..self.noise.len() {
                self.add(output, sample, row);
            }
        }
    }
}

impl ResidualSums<'_> {
    fn add(&mut self, output: usize, sample: usize, row: &[Lanes]) {
        let measured = self.experiment.measured[output][sample];
        if measured.is_nan() {
            return;
        }
        let described = &self.problem.outputs[output];
        let simulated = row[described.index];
        if let Some(innovations) = self.problem.innovations.as_deref() {
            let variance = row[described.index + innovations.n_outputs];
            let error = simulated.map(|value| measured - value);
            self.squares[output] += error * error / variance;
            self.log_variances[output] += variance.map(libm::log);
            return;
        }
        let unit = match self.noise[output].level {
            NoiseLevel::Given(level) => level,
            NoiseLevel::Integrated => described.residual_scale,
        };
        let weight = self.experiment.weight(output, sample) / unit;
        let loss: Loss = self.problem.loss;
        let residual = simulated.map(|value| loss.bent((measured - value) * weight));
        self.squares[output] += residual * residual;
    }
}
