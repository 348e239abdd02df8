//! Noise models compared: none, then a disturbance on each state that a force moves, white and with
//! memory, then a sensor that drifts.
//!
//! Each is fitted from the estimate of the free run. A scan over strengths, memories and sensors finds where
//! its descent begins; the Bayesian information criterion (G. Schwarz, *Annals of Statistics* 6, 1978)
//! compares what the descents come to.

use super::prior::Prior;
use super::problem::{Coordinate, Problem};
use super::process_noise::{NoiseFault, NoiseModel, NoiseNumber, ProcessNoise, filtered};
use super::refine::{self, Linearisation};
use super::sensitivity::{Directions, Neighbourhood, SHIFT, SensitivityError, Sides};
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

/// The largest share of a point of which the likelihood says how large all noises are together.
const LARGEST_SHARE: f64 = 1.0;

/// Noises of the sensors that are scanned, as shares of the residuals of the free run. Where strengths and sensors
/// are all unknown, one of the shares of a point is 1: the likelihood itself says how large all are together.
const SCANNED_SENSORS: [f64; 6] = [1.0, 0.3, 0.1, 1e-2, 1e-3, 1e-5];

/// The least noise of a sensor, as a share of the residuals of the free run: a position encoder may be so much
/// better than the model.
const LEAST_SENSOR: f64 = 1e-6;

/// Memories that are scanned: the place between the time from sample to sample and the length of the
/// record, on a logarithmic scale.
const SCANNED_MEMORIES: [f64; 3] = [0.25, 0.5, 0.75];

/// Points of a scan that are simulated, and held, at once.
const SCANNED_TOGETHER: usize = 32;

/// The standard deviation of the logarithm of a strength before the data are looked at.
const STRENGTH_DEVIATION: f64 = 4.0;

/// Steps of the covariance between two samples.
pub const COVARIANCE_STEPS: u32 = 2;

/// A number of a disturbance that is looked for, or given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SoughtNumber {
    /// The number as the filter takes it.
    Stated(NoiseNumber),
    /// An unknown whose range follows from the residuals of the free run and from the record.
    Open,
}

/// A disturbance whose numbers are looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct SoughtDisturbance {
    /// The quantity that the disturbance acts on, and how it moves.
    pub disturbance: Disturbance,
    /// How strong it is `[unit of what it acts on · √s]`.
    pub strength: SoughtNumber,
    /// How long one with memory remembers `[s]`.
    pub time_constant: SoughtNumber,
}

impl SoughtDisturbance {
    /// A disturbance of which nothing is known.
    #[must_use]
    pub fn open(acts_on: ActsOn, kind: DisturbanceKind) -> SoughtDisturbance {
        SoughtDisturbance {
            disturbance: Disturbance { acts_on, kind },
            strength: SoughtNumber::Open,
            time_constant: SoughtNumber::Open,
        }
    }
}

/// A noise model that is about to be fitted to the data.
#[derive(Clone, Debug)]
pub struct NoiseTrial {
    /// What may move the plant.
    pub noise: NoiseModel,
    /// The problem whose innovations are compared.
    pub problem: Problem,
    /// The positions at which a descent begins: those of the plant's unknowns, then those of the noise.
    pub start: Vec<f64>,
}

/// A noise model fitted to the data.
#[derive(Debug)]
pub struct FittedNoise {
    /// The noise model with the problem whose innovations are compared.
    pub trial: NoiseTrial,
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
pub fn candidates(problem: &Problem) -> Vec<Vec<SoughtDisturbance>> {
    let mut candidates = vec![Vec::new()];
    let driven = problem.model.driven_states();
    for kind in [DisturbanceKind::White, DisturbanceKind::Memory] {
        let states = driven.iter().take(MOST_STATES);
        let on_rate = |state: &usize| SoughtDisturbance::open(ActsOn::Rate(*state), kind);
        candidates.extend(states.map(|state| vec![on_rate(state)]));
    }
    let outputs = problem.outputs.iter().map(|output| output.index);
    candidates.extend(outputs.map(|output| {
        let acts_on = ActsOn::Output(output);
        vec![SoughtDisturbance::open(acts_on, DisturbanceKind::Memory)]
    }));
    candidates
}

/// Finds for each noise model where its descent begins, from the estimate of the free run. Answers
/// nothing when `stop` was raised.
///
/// # Errors
/// Where the model or the problem does not allow a filter.
pub fn trials(
    problem: &Problem,
    estimate: &[f64],
    candidates: &[Vec<SoughtDisturbance>],
    stop: &AtomicBool,
) -> Result<Option<Vec<NoiseTrial>>, NoiseFault> {
    let Some(deviations) = residual_deviations(problem, estimate, stop) else {
        return Ok(None);
    };
    let fit = NoiseFit {
        problem,
        estimate,
        deviations: &deviations,
        stop,
    };
    let trials = candidates.par_iter().map(|sought| fit.trial(sought));
    let trials: Result<Vec<_>, NoiseFault> = trials.collect();
    Ok(trials?.into_iter().collect())
}

/// Fits each noise model from the estimate of the free run, in the order in which they are named; none where
/// a fit fails. Answers nothing when `stop` was raised.
///
/// # Errors
/// Where the model or the problem does not allow a filter.
pub fn fit(
    problem: &Problem,
    estimate: &[f64],
    candidates: &[Vec<SoughtDisturbance>],
    stop: &AtomicBool,
) -> Result<Option<Vec<Option<FittedNoise>>>, NoiseFault> {
    let Some(trials) = trials(problem, estimate, candidates, stop)? else {
        return Ok(None);
    };
    let fits = trials.into_par_iter().map(|trial| {
        let start = trial.start.clone();
        let descent = refine::descend(&trial.problem, start, Accuracy::Full, stop)?;
        trial.fitted(descent.positions, stop)
    });
    Ok(fits.collect())
}

impl NoiseTrial {
    /// What a descent came to; the inner answer is none where it cannot be simulated. Answers nothing when
    /// `stop` was raised.
    #[must_use]
    pub fn fitted(self, positions: Vec<f64>, stop: &AtomicBool) -> Option<Option<FittedNoise>> {
        let linearisation = match refine::linearise(&self.problem, &positions, Accuracy::Full, stop)
        {
            Ok(linearisation) => linearisation,
            Err(SensitivityError::Interrupted) => return None,
            Err(SensitivityError::Failed(_)) => return Some(None),
        };
        let around = compared(&self.problem, std::slice::from_ref(&positions), stop)?;
        let Some(log_likelihood) = around.log_likelihood(0) else {
            return Some(None);
        };
        drop(around);
        let samples = self.problem.n_residuals() as f64;
        let unknowns = positions.len() as f64;
        Some(Some(FittedNoise {
            bic: unknowns * libm::log(samples) - 2.0 * log_likelihood,
            log_likelihood,
            linearisation,
            positions,
            trial: self,
        }))
    }
}

/// The variance that each disturbance alone makes of each compared output, as a mean over all samples
/// `[SI²]`. Answers nothing when `stop` was raised.
///
/// # Errors
/// Where the model or the problem does not allow a filter.
pub fn variances_made(
    problem: &Problem,
    positions: &[f64],
    disturbances: &[ProcessNoise],
    stop: &AtomicBool,
) -> Result<Option<Vec<Vec<f64>>>, NoiseFault> {
    let mut variances = Vec::new();
    for disturbance in disturbances {
        let alone = NoiseModel {
            disturbances: vec![disturbance.clone()],
            sensors: vec![NoiseNumber::Given(0.0); problem.outputs.len()],
            steps: 1,
        };
        let alone = filtered(problem, &alone)?.without_measurements(|_| 0);
        let Some(around) = compared(&alone, &[positions.to_vec()], stop) else {
            return Ok(None);
        };
        // Without measurements the variance of each output is what the disturbance makes of it.
        variances.push(around.mean_variances(0));
    }
    Ok(Some(variances))
}

/// The root mean square of each output's residuals in the free run, SI. Answers nothing when `stop` was raised.
#[must_use]
pub fn residual_deviations(
    problem: &Problem,
    estimate: &[f64],
    stop: &AtomicBool,
) -> Option<Vec<f64>> {
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
    /// Answers nothing when `stop` was raised.
    fn trial(&self, sought: &[SoughtDisturbance]) -> Result<Option<NoiseTrial>, NoiseFault> {
        let Some(strengths) = self.strengths(sought)? else {
            return Ok(None);
        };
        let noise = self.model(sought, &strengths);
        let problem = filtered(self.problem, &noise)?;
        let start = self.scan(&problem, &noise, &strengths);
        Ok(start.map(|start| NoiseTrial {
            noise,
            problem,
            start,
        }))
    }

    /// The strength of each disturbance that makes the residuals of the free run. Answers nothing when
    /// `stop` was raised.
    fn strengths(&self, sought: &[SoughtDisturbance]) -> Result<Option<Vec<f64>>, NoiseFault> {
        let unit = |sought: &SoughtDisturbance| {
            let time_constant = match sought.time_constant {
                SoughtNumber::Stated(number) => number.typical(),
                SoughtNumber::Open => self.memories().typical(),
            };
            let given = NoiseNumber::Given(time_constant);
            self.disturbance(sought, NoiseNumber::Given(1.0), given)
        };
        let units: Vec<ProcessNoise> = sought.iter().map(unit).collect();
        let made = variances_made(self.problem, self.estimate, &units, self.stop)?;
        let strength = |variances: &Vec<f64>| {
            let shares = variances.iter().zip(self.deviations);
            let shares = shares.map(|(variance, deviation)| variance.sqrt() / deviation);
            let largest = shares.filter(|share| share.is_finite()).fold(0.0, f64::max);
            if largest > 0.0 { 1.0 / largest } else { 1.0 }
        };
        Ok(made.map(|made| made.iter().map(strength).collect()))
    }

    fn disturbance(
        &self,
        sought: &SoughtDisturbance,
        strength: NoiseNumber,
        time_constant: NoiseNumber,
    ) -> ProcessNoise {
        let description = self.problem.model.description();
        let name = match sought.disturbance.acts_on {
            ActsOn::Parameter(index) => &description.parameters[index].name,
            ActsOn::Rate(index) => &description.states[index].name,
            ActsOn::Output(index) => &description.outputs[index].name,
        };
        let has_memory = sought.disturbance.kind == DisturbanceKind::Memory;
        ProcessNoise {
            name: name.to_string(),
            disturbance: sought.disturbance,
            strength,
            time_constant: has_memory.then_some(time_constant),
        }
    }

    /// The memories that are looked for [s]: from the time between two samples to the length of the record.
    fn memories(&self) -> NoiseNumber {
        let experiments = self.problem.experiments.iter();
        let intervals = experiments.clone().map(|data| data.sample_time);
        let lengths = experiments.map(|data| data.instant(data.estimation_samples.max(1) - 1));
        let shortest = intervals.fold(f64::INFINITY, f64::min);
        let longest = lengths.fold(2.0 * shortest, f64::max);
        let prior = Prior {
            middle: libm::log((shortest * longest).sqrt()),
            deviation: libm::log(longest / shortest) / 4.0,
            scale: Scale::Log,
        };
        NoiseNumber::Unknown {
            lower: shortest,
            upper: longest,
            prior: Some(prior),
        }
    }

    /// The noise model with the ranges of its unknowns; the noise of a sensor is given where the job declares
    /// it.
    fn model(&self, sought: &[SoughtDisturbance], strengths: &[f64]) -> NoiseModel {
        let disturbed = sought.iter().zip(strengths).map(|(sought, scale)| {
            let strength = NoiseNumber::Unknown {
                lower: 1e-4 * scale,
                upper: 1e2 * scale,
                prior: Some(Prior {
                    middle: libm::log(*scale),
                    deviation: STRENGTH_DEVIATION,
                    scale: Scale::Log,
                }),
            };
            let number = |sought: SoughtNumber, open: NoiseNumber| match sought {
                SoughtNumber::Stated(number) => number,
                SoughtNumber::Open => open,
            };
            let time_constant = number(sought.time_constant, self.memories());
            self.disturbance(sought, number(sought.strength, strength), time_constant)
        });
        let outputs = self.problem.outputs.iter().zip(self.deviations);
        let sensors = outputs.map(|(output, deviation)| match output.noise_std {
            Some(noise) => NoiseNumber::Given(noise),
            None => NoiseNumber::Unknown {
                lower: LEAST_SENSOR * deviation,
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
    fn scan(&self, problem: &Problem, noise: &NoiseModel, strengths: &[f64]) -> Option<Vec<f64>> {
        let is_concentrated = noise.sizes().all(NoiseNumber::is_unknown);
        let points = self.grid(noise, strengths, is_concentrated);
        let mut lowest: Option<(f64, Vec<f64>)> = None;
        for part in points.chunks(SCANNED_TOGETHER) {
            let around = compared(problem, part, self.stop)?;
            for (place, point) in part.iter().enumerate() {
                let (cost, by) = match is_concentrated {
                    true => around.concentrated_cost(place),
                    false => (around.cost(place), 1.0),
                };
                if lowest.as_ref().is_none_or(|(lowest, _)| cost < *lowest) {
                    lowest = Some((cost, self.enlarged(problem, noise, point, by)));
                }
            }
        }
        lowest.map(|(_, point)| point)
    }

    /// Points of the free run's estimate with noises.
    fn grid(&self, noise: &NoiseModel, strengths: &[f64], is_concentrated: bool) -> Vec<Vec<f64>> {
        let mut grid = vec![GridPoint {
            positions: self.estimate.to_vec(),
            largest_share: 0.0,
        }];
        for (disturbance, scale) in noise.disturbances.iter().zip(strengths) {
            let shares = SCANNED_STRENGTHS.iter();
            let shares = shares.filter(|share| !is_concentrated || **share <= LARGEST_SHARE);
            let shares: Vec<f64> = shares.copied().collect();
            grid = extended(&grid, &scanned(disturbance.strength, &shares, &[*scale]));
            if let Some(NoiseNumber::Unknown { .. }) = disturbance.time_constant {
                let memories = SCANNED_MEMORIES.map(|position| Scanned {
                    share: 0.0,
                    positions: vec![position],
                });
                grid = extended(&grid, &memories);
            }
        }
        // The sensors that are unknown are scanned together.
        let sensors = noise.sensors.iter().zip(self.deviations);
        let unknown: Vec<_> = sensors.filter(|(sensor, _)| sensor.is_unknown()).collect();
        if let Some((first, _)) = unknown.first() {
            let scales: Vec<f64> = unknown.iter().map(|(_, deviation)| **deviation).collect();
            grid = extended(&grid, &scanned(**first, &SCANNED_SENSORS, &scales));
        }
        let points = grid.into_iter();
        let points =
            points.filter(|point| !is_concentrated || point.largest_share == LARGEST_SHARE);
        points.map(|point| point.positions).collect()
    }

    /// A point with all strengths and sensors larger by a factor, as far as their ranges go.
    fn enlarged(&self, problem: &Problem, noise: &NoiseModel, point: &[f64], by: f64) -> Vec<f64> {
        let mut enlarged = point.to_vec();
        // A disturbance has a strength, which is a size, and where it remembers a time constant, which is none.
        let of_disturbances = noise.disturbances.iter().flat_map(|disturbance| {
            let numbers = disturbance.numbers().zip([true, false]);
            let unknown = numbers.filter(|(number, _)| number.is_unknown());
            unknown.map(|(_, is_size)| is_size)
        });
        let is_size = of_disturbances.chain(std::iter::repeat(true));
        let places = self.estimate.len()..problem.coordinates.len();
        for (place, is_size) in places.zip(is_size) {
            let coordinate = &problem.coordinates[place];
            if is_size && by.is_finite() {
                let value = by * coordinate.value(point[place]);
                let Coordinate { lower, upper, .. } = *coordinate;
                enlarged[place] = Scale::Log.position(value.clamp(lower, upper), lower, upper);
            }
        }
        enlarged
    }
}

/// Positions of one or more numbers of a grid.
struct Scanned {
    /// The share of the free run's residuals; 0 for what is no size.
    share: f64,
    positions: Vec<f64>,
}

/// A point of a grid.
#[derive(Clone)]
struct GridPoint {
    positions: Vec<f64>,
    /// The largest share of the free run's residuals among its noises.
    largest_share: f64,
}

/// The positions of shares of scales within the range of an unknown, its middle where all lie outside; a given
/// number has none.
fn scanned(number: NoiseNumber, shares: &[f64], scales: &[f64]) -> Vec<Scanned> {
    let NoiseNumber::Unknown { lower, upper, .. } = number else {
        return Vec::new();
    };
    let first = scales[0];
    let at = |share: f64| Scanned {
        share,
        // Ranges of sensors are proportional to their scales.
        positions: vec![Scale::Log.position(share * first, lower, upper); scales.len()],
    };
    let inside = |scanned: &Scanned| (0.0..=1.0).contains(&scanned.positions[0]);
    let within: Vec<Scanned> = shares
        .iter()
        .map(|share| at(*share))
        .filter(inside)
        .collect();
    if within.is_empty() {
        let middle = Scanned {
            share: LARGEST_SHARE,
            positions: vec![0.5; scales.len()],
        };
        return vec![middle];
    }
    within
}

/// The points of a grid, each with more numbers; the grid as it is where there are none.
fn extended(grid: &[GridPoint], numbers: &[Scanned]) -> Vec<GridPoint> {
    let points = grid.iter().flat_map(|point| {
        let with = |scanned: &Scanned| GridPoint {
            positions: [&point.positions[..], &scanned.positions].concat(),
            largest_share: point.largest_share.max(scanned.share),
        };
        numbers.iter().map(with).collect::<Vec<_>>()
    });
    match numbers.is_empty() {
        true => grid.iter().map(GridPoint::clone).collect(),
        false => points.collect(),
    }
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
