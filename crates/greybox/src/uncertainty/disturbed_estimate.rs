//! The estimate of a plant under the noise model that was taken, and what is said of it.

use super::Analysis;
use super::analysis::CoordinateUncertainty;
use super::hull::Hull;
use super::linearised::LinearisedEstimate;
use super::noise_analysis::{
    Band, ComparedNoise, DisturbanceEstimate, FreeRunEstimate, NoiseAnalysis, NoiseEstimate,
};
use super::refits::RefitSequence;
use super::{covariance, fit, residuals, rules};
use crate::estimation::observer::PosteriorRow;
use crate::estimation::problem::Problem;
use crate::estimation::process_noise::{NoiseModel, NoiseNumber};
use crate::estimation::report::Report;
use greybox_numerics::statistics;
use greybox_simulation::single::Outputs;

/// Lags over which the errors of what was held back are told to hang together.
const BAND_LAGS: usize = 100;

/// The estimate under the noise model that was taken.
#[derive(Debug)]
pub(super) struct DisturbedEstimate {
    /// The problem of the plant, with the starts of experiments that only validate.
    pub plant: Problem,
    /// What the run came to, at the plant's unknowns.
    pub report: Report,
    /// The estimate of the plant's unknowns and those of the noise.
    pub estimate: LinearisedEstimate,
    /// How well the free run at the estimate follows the data that were estimated from.
    pub estimation_fit: Vec<fit::OutputFit>,
    /// How well it follows the data that were held back.
    pub validation_fit: Vec<fit::OutputFit>,
    pub noise: NoiseModel,
    /// For each disturbance the share of each output's variance that it makes.
    pub shares: Vec<Vec<Option<f64>>>,
    pub compared: Vec<ComparedNoise>,
    pub chosen: usize,
    pub log_likelihood: f64,
    /// The analysis of the free run's own estimate, and its values.
    pub free_run: Analysis,
    pub free_run_values: Vec<f64>,
}

impl DisturbedEstimate {
    pub fn sequences(&mut self) -> Vec<&mut dyn RefitSequence> {
        self.estimate.sequences()
    }

    /// Returns how far the chains of a posterior came, a row for each look at them; empty where none was asked for.
    pub fn posterior_looks(&self) -> &[PosteriorRow] {
        self.estimate.posterior_looks()
    }

    /// The analysis of the plant's unknowns and of the disturbances that move the plant.
    pub fn analysis(&self) -> Option<Analysis> {
        let whole = self.estimate.unjudged()?;
        let n = self.report.positions.len();
        let noise = self.noise_analysis(&whole, n);
        let mut analysis = whole.of_first(n);
        analysis.take_over(&self.free_run);
        let hull = Hull {
            problem: &self.plant,
            positions: &self.report.positions,
        };
        hull.cover_windows(&mut analysis);
        hull.cover_moves(&mut analysis);
        hull.cover_rivals(&mut analysis, noise.rivals());
        hull.cover_free_run(&mut analysis, &noise.free_run);
        analysis.estimation_fit.clone_from(&self.estimation_fit);
        analysis.validation_fit.clone_from(&self.validation_fit);
        let unknowns = self.estimate.estimate().report.positions.len();
        analysis.criteria =
            fit::likelihood_criteria(self.log_likelihood, self.plant.n_residuals(), unknowns);
        analysis.noise = Some(Box::new(noise));
        analysis.judge(rules::judge(&self.plant, &self.report, &analysis));
        Some(analysis)
    }

    fn noise_analysis(&self, whole: &Analysis, n: usize) -> NoiseAnalysis {
        let values = &self.estimate.estimate().report.values;
        let mut numbers = NoiseNumbers::new(&whole.coordinates[n..], &values[n..]);
        let mut place = n;
        let mut disturbances = Vec::new();
        for (sought, shares) in self.noise.disturbances.iter().zip(&self.shares) {
            let strength = numbers.next(sought.strength);
            let time_constant = sought.time_constant.map(|number| numbers.next(number));
            let unknowns = sought
                .numbers()
                .filter(|number| number.is_unknown())
                .count();
            let correlation = match (unknowns, &whole.correlation) {
                (2, Some(rows)) => rows[place][place + 1],
                _ => 0.0,
            };
            place += unknowns;
            disturbances.push(DisturbanceEstimate {
                sought: sought.clone(),
                strength,
                time_constant,
                std: time_constant.map(|memory| standard_deviation(strength, memory, correlation)),
                shares: shares.clone(),
            });
        }
        let sensors = self.noise.sensors.iter();
        let free = self.free_run.coordinates.iter().zip(&self.free_run_values);
        let free_run = |(described, value): (&CoordinateUncertainty, &f64)| FreeRunEstimate {
            value: *value,
            standard_error: described.standard_error,
            trust: described.trust,
        };
        let outputs = 0..self.plant.outputs.len();
        let simulated = self.estimate.estimate();
        NoiseAnalysis {
            compared: self.compared.clone(),
            chosen: self.chosen,
            is_white: whole
                .residuals
                .iter()
                .all(|output| output.white != Some(false)),
            log_likelihood: self.log_likelihood,
            disturbances,
            sensors: sensors.map(|sensor| numbers.next(*sensor)).collect(),
            free_run: free.map(free_run).collect(),
            bands: outputs
                .map(|output| band(&simulated.problem, &simulated.trajectories, output))
                .collect(),
        }
    }
}

/// The numbers of a noise model as an analysis found them: those of disturbances, then those of sensors.
struct NoiseNumbers<'a> {
    /// The values and errors of the coordinates behind those of the plant.
    coordinates: std::slice::Iter<'a, CoordinateUncertainty>,
    values: std::slice::Iter<'a, f64>,
}

impl<'a> NoiseNumbers<'a> {
    fn new(coordinates: &'a [CoordinateUncertainty], values: &'a [f64]) -> NoiseNumbers<'a> {
        NoiseNumbers {
            coordinates: coordinates.iter(),
            values: values.iter(),
        }
    }

    /// The next number: the given one, or that of the next coordinate.
    fn next(&mut self, number: NoiseNumber) -> NoiseEstimate {
        if let NoiseNumber::Given(value) = number {
            return NoiseEstimate {
                value,
                relative_error: None,
            };
        }
        let value = self.values.next().copied().unwrap_or(f64::NAN);
        let error = self
            .coordinates
            .next()
            .and_then(|coordinate| coordinate.standard_error);
        NoiseEstimate {
            value,
            relative_error: error.map(|error| error / value),
        }
    }
}

/// The standard deviation of a disturbance with memory: its strength over √(2·time constant).
fn standard_deviation(
    strength: NoiseEstimate,
    memory: NoiseEstimate,
    correlation: f64,
) -> NoiseEstimate {
    let errors = [strength, memory].map(|number| number.relative_error);
    let [of_strength, of_memory] = errors.map(Option::unwrap_or_default);
    let variance = of_strength * of_strength + 0.25 * of_memory * of_memory
        - correlation * of_strength * of_memory;
    let is_known = errors.iter().any(Option::is_some);
    NoiseEstimate {
        value: strength.value / (2.0 * memory.value).sqrt(),
        relative_error: is_known.then(|| variance.max(0.0).sqrt()),
    }
}

/// How what was held back of an output lies within the band that is expected of it; none where nothing was
/// held back.
fn band(problem: &Problem, trajectories: &[Outputs], output: usize) -> Option<Band> {
    let innovations = problem.innovations.as_deref()?;
    let index = problem.outputs[output].index;
    let mut series: Vec<Vec<f64>> = Vec::new();
    for (data, outputs) in problem.experiments.iter().zip(trajectories) {
        let (expected, variances) = (&outputs[index], &outputs[innovations.n_outputs + index]);
        let held_back = data.scored_from..data.samples;
        let errors = held_back.map(|sample| {
            (data.measured[output][sample] - expected[sample]) / variances[sample].sqrt()
        });
        series.push(errors.collect());
    }
    let present = series.iter().flatten().filter(|error| !error.is_nan());
    let samples = present.clone().count();
    let inside = present
        .clone()
        .filter(|error| error.abs() <= covariance::NORMAL_95)
        .count();
    let mean_square = statistics::mean(present.map(|error| error * error))?;
    Some(Band {
        samples,
        inside: inside as f64 / samples as f64,
        mean_square,
        effective_samples: residuals::independent_squares(&series, BAND_LAGS),
    })
}
