//! Noise models compared: none, then a disturbance on each state that a force moves, white and with
//! memory, then a sensor that drifts.
//!
//! Each is fitted from the estimate of the free run. A scan over strengths, memories and sensors finds where
//! its descent begins; the Bayesian information criterion (G. Schwarz, *Annals of Statistics* 6, 1978)
//! compares what the descents come to.

use super::prior::Prior;
use super::problem::Problem;
use super::process_noise::{NoiseFault, NoiseModel, NoiseNumber, ProcessNoise, filtered};
use super::refine::{self, Linearisation};
use super::sensitivity::{Directions, Neighbourhood, SHIFT, Sides};
use super::trajectory;
use greybox_numerics::statistics;
use greybox_simulation::Accuracy;
use greybox_simulation::model::Scale;
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Disturbed states at the most.
const MOST_STATES: usize = 4;

/// Strengths that are scanned, as shares of what makes the residuals of the free run.
const SCANNED_STRENGTHS: [f64; 7] = [1e-3, 1e-2, 0.03, 0.1, 0.3, 1.0, 3.0];

/// Noises of a sensor that are scanned, as shares of the residuals of the free run.
const SCANNED_SENSORS: [f64; 4] = [0.01, 0.05, 0.25, 0.9];

/// Memories that are scanned: the place between the time from sample to sample and the length of the
/// record, on a logarithmic scale.
const SCANNED_MEMORIES: [f64; 3] = [0.25, 0.5, 0.75];

/// The standard deviation of the logarithm of a strength before the data are looked at.
const STRENGTH_DEVIATION: f64 = 4.0;

/// Steps of the covariance between two samples.
const COVARIANCE_STEPS: u32 = 2;

/// A noise model fitted to the data.
#[derive(Debug)]
pub struct FittedNoise {
    /// What moves the plant.
    pub noise: NoiseModel,
    /// The problem whose innovations are compared.
    pub problem: Problem,
    /// The estimate: the positions of the plant's unknowns, then those of the noise.
    pub positions: Vec<f64>,
    /// The rows linearised there.
    pub linearisation: Linearisation,
    /// The natural logarithm of the likelihood there.
    pub log_likelihood: f64,
    /// The Bayesian information criterion: −2·log L and the logarithm of the number of samples for each
    /// unknown.
    pub bic: f64,
}

/// The noise models that a problem may have, the simplest first.
#[must_use]
pub fn candidates(problem: &Problem) -> Vec<Vec<Disturbance>> {
    let mut candidates = vec![Vec::new()];
    let driven = problem.model.driven_states();
    for kind in [DisturbanceKind::White, DisturbanceKind::Memory] {
        let states = driven.iter().take(MOST_STATES);
        candidates.extend(states.map(|state| {
            let acts_on = ActsOn::Rate(*state);
            vec![Disturbance { acts_on, kind }]
        }));
    }
    candidates.extend(problem.outputs.iter().map(|output| {
        let (acts_on, kind) = (ActsOn::Output(output.index), DisturbanceKind::Memory);
        vec![Disturbance { acts_on, kind }]
    }));
    candidates
}

/// Fits each noise model from the estimate of the free run, in the order in which they are named; none where
/// a fit fails. Answers nothing when `stop` was raised.
///
/// # Errors
/// Where the model or the problem does not allow a filter.
pub fn fit(
    problem: &Problem,
    estimate: &[f64],
    candidates: &[Vec<Disturbance>],
    stop: &AtomicBool,
) -> Result<Option<Vec<Option<FittedNoise>>>, NoiseFault> {
    let Some(deviations) = residual_deviations(problem, estimate, stop) else {
        return Ok(None);
    };
    let fits: Result<Vec<_>, NoiseFault> = candidates
        .par_iter()
        .map(|disturbances| {
            let fit = NoiseFit {
                problem,
                estimate,
                deviations: &deviations,
                stop,
            };
            fit.of(disturbances)
        })
        .collect();
    Ok(fits?.into_iter().collect())
}

/// The root mean square of each output's residuals in the free run, SI.
fn residual_deviations(problem: &Problem, estimate: &[f64], stop: &AtomicBool) -> Option<Vec<f64>> {
    let simulated = trajectory::simulate(problem, estimate, stop)?;
    let simulated = simulated.unwrap_or_default();
    let deviation = |place: usize| {
        let index = problem.outputs[place].index;
        let squares = problem
            .experiments
            .iter()
            .zip(&simulated)
            .flat_map(|(data, outputs)| {
                let measured = data.measured[place][..data.estimation_samples].iter();
                let errors = measured
                    .zip(&outputs[index])
                    .map(|(y, simulated)| y - simulated);
                errors
                    .filter(|error| !error.is_nan())
                    .map(|error| error * error)
            });
        statistics::mean(squares).map_or(problem.outputs[place].residual_scale, f64::sqrt)
    };
    Some((0..problem.outputs.len()).map(deviation).collect())
}

/// What a noise model is fitted to.
struct NoiseFit<'a> {
    problem: &'a Problem,
    /// The positions of the free run's estimate.
    estimate: &'a [f64],
    /// The root mean square of each output's residuals there.
    deviations: &'a [f64],
    stop: &'a AtomicBool,
}

impl NoiseFit<'_> {
    /// The outer answer is none when `stop` was raised, the inner one where the fit fails.
    fn of(&self, disturbances: &[Disturbance]) -> Result<Option<Option<FittedNoise>>, NoiseFault> {
        let Some(strengths) = self.strengths(disturbances)? else {
            return Ok(None);
        };
        let noise = self.model(disturbances, &strengths);
        let problem = filtered(self.problem, &noise)?;
        let Some(start) = self.scan(&problem, disturbances) else {
            return Ok(None);
        };
        let Some(descent) = refine::descend(&problem, start, Accuracy::Full, self.stop) else {
            return Ok(None);
        };
        let positions = descent.positions;
        let Ok(linearisation) = refine::linearise(&problem, &positions, Accuracy::Full, self.stop)
        else {
            return Ok(Some(None));
        };
        let Some(around) = compared(&problem, std::slice::from_ref(&positions), self.stop) else {
            return Ok(None);
        };
        let samples = self.problem.n_residuals() as f64;
        let unknowns = positions.len() as f64;
        Ok(Some(around.log_likelihood(0).map(|log_likelihood| {
            FittedNoise {
                bic: unknowns * libm::log(samples) - 2.0 * log_likelihood,
                log_likelihood,
                linearisation,
                positions,
                noise,
                problem: problem.clone(),
            }
        })))
    }

    /// The strength of each disturbance that makes the residuals of the free run. Answers nothing when
    /// `stop` was raised.
    fn strengths(&self, disturbances: &[Disturbance]) -> Result<Option<Vec<f64>>, NoiseFault> {
        let mut strengths = Vec::new();
        for disturbance in disturbances {
            let unit = NoiseModel {
                disturbances: vec![self.disturbance(*disturbance, NoiseNumber::Given(1.0))],
                sensors: vec![NoiseNumber::Given(0.0); self.deviations.len()],
                steps: 1,
            };
            let problem = filtered(self.problem, &unit)?.without_measurements();
            let Some(around) = compared(&problem, &[self.estimate.to_vec()], self.stop) else {
                return Ok(None);
            };
            // Without measurements the variance of each output is what the disturbance makes of it.
            let shares = around.mean_variances(0).into_iter().zip(self.deviations);
            let largest = shares.map(|(variance, deviation)| variance.sqrt() / deviation);
            let largest = largest
                .filter(|share| share.is_finite())
                .fold(0.0, f64::max);
            strengths.push(if largest > 0.0 { 1.0 / largest } else { 1.0 });
        }
        Ok(Some(strengths))
    }

    /// A disturbance of this strength, whose memory is an unknown.
    fn disturbance(&self, disturbance: Disturbance, strength: NoiseNumber) -> ProcessNoise {
        let [shortest, longest] = self.memories();
        let has_memory = disturbance.kind == DisturbanceKind::Memory;
        let prior = Prior {
            middle: libm::log((shortest * longest).sqrt()),
            deviation: libm::log(longest / shortest) / 4.0,
            scale: Scale::Log,
        };
        let memory = match strength {
            NoiseNumber::Given(_) => NoiseNumber::Given((shortest * longest).sqrt()),
            NoiseNumber::Unknown { .. } => NoiseNumber::Unknown {
                lower: shortest,
                upper: longest,
                prior: Some(prior),
            },
        };
        let description = self.problem.model.description();
        let name = match disturbance.acts_on {
            ActsOn::Parameter(index) => &description.parameters[index].name,
            ActsOn::Rate(index) => &description.states[index].name,
            ActsOn::Output(index) => &description.outputs[index].name,
        };
        ProcessNoise {
            name: name.to_string(),
            disturbance,
            strength,
            time_constant: has_memory.then_some(memory),
        }
    }

    /// The shortest memory that is looked for, and the longest [s].
    fn memories(&self) -> [f64; 2] {
        let experiments = self.problem.experiments.iter();
        let intervals = experiments.clone().map(|data| data.sample_time);
        let lengths = experiments.map(|data| data.instant(data.estimation_samples.max(1) - 1));
        let interval = intervals.fold(f64::INFINITY, f64::min);
        [interval, lengths.fold(2.0 * interval, f64::max)]
    }

    /// The noise model whose numbers are unknown; the noise of a sensor is given where the job declares it.
    fn model(&self, disturbances: &[Disturbance], strengths: &[f64]) -> NoiseModel {
        let disturbed = disturbances
            .iter()
            .zip(strengths)
            .map(|(disturbance, scale)| {
                let strength = NoiseNumber::Unknown {
                    lower: 1e-4 * scale,
                    upper: 1e2 * scale,
                    prior: Some(Prior {
                        middle: libm::log(*scale),
                        deviation: STRENGTH_DEVIATION,
                        scale: Scale::Log,
                    }),
                };
                self.disturbance(*disturbance, strength)
            });
        let outputs = self.problem.outputs.iter().zip(self.deviations);
        let sensors = outputs.map(|(output, deviation)| match output.noise_std {
            Some(noise) => NoiseNumber::Given(noise),
            None => NoiseNumber::Unknown {
                lower: 1e-3 * deviation,
                upper: 2.0 * deviation,
                prior: None,
            },
        });
        NoiseModel {
            disturbances: disturbed.collect(),
            sensors: sensors.collect(),
            steps: COVARIANCE_STEPS,
        }
    }

    /// The best of a grid of noises at the free run's estimate: where a descent begins. Answers nothing when
    /// `stop` was raised.
    fn scan(&self, problem: &Problem, disturbances: &[Disturbance]) -> Option<Vec<f64>> {
        let position = |share: f64, [lower, upper]: [f64; 2]| {
            libm::log(share / lower) / libm::log(upper / lower)
        };
        let mut grid = vec![self.estimate.to_vec()];
        // The sensors that are unknown are scanned together.
        let unknown = self.problem.outputs.iter();
        let unknown = unknown.filter(|output| output.noise_std.is_none()).count();
        for disturbance in disturbances {
            let strengths = SCANNED_STRENGTHS.map(|share| position(share, [1e-4, 1e2]));
            grid = extended(&grid, &strengths, 1);
            if disturbance.kind == DisturbanceKind::Memory {
                grid = extended(&grid, &SCANNED_MEMORIES, 1);
            }
        }
        let sensors = SCANNED_SENSORS.map(|share| position(share, [1e-3, 2.0]));
        if unknown > 0 {
            grid = extended(&grid, &sensors, unknown);
        }
        let around = compared(problem, &grid, self.stop)?;
        let costs = (0..grid.len()).map(|place| around.cost(place));
        let best = costs.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b));
        best.map(|(place, _)| grid.swap_remove(place))
    }
}

/// The points of a grid, each with so many more coordinates at each of these positions.
fn extended(grid: &[Vec<f64>], positions: &[f64], more: usize) -> Vec<Vec<f64>> {
    let mut points = Vec::with_capacity(grid.len() * positions.len());
    for point in grid {
        for position in positions {
            let added = std::iter::repeat_n(*position, more);
            points.push(point.iter().copied().chain(added).collect());
        }
    }
    points
}

/// Candidates of a problem, simulated finely. Answers nothing when `stop` was raised.
fn compared<'a>(
    problem: &'a Problem,
    candidates: &[Vec<f64>],
    stop: &AtomicBool,
) -> Option<Neighbourhood<'a>> {
    let nowhere = Directions {
        from: &candidates[0],
        vectors: &[],
        shift: SHIFT,
        sides: Sides::One,
    };
    Neighbourhood::simulate(problem, nowhere, candidates, (Accuracy::Full, stop))
}
