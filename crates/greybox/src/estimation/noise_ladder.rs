//! Noise models compared: none, then a disturbance on each state that a force moves, white and with
//! memory, then a sensor that drifts.
//!
//! Each is fitted from the estimate of the free run. A scan over strengths, memories and sensors finds where
//! its descent begins; the Bayesian information criterion (G. Schwarz, *Annals of Statistics* 6, 1978)
//! compares what the descents come to. A plant on which several things act takes another disturbance beside
//! those of a model that was fitted ([`with_another`]).

use super::noise_scan::{NoiseScan, ScannedBasis, compared};
use super::prior::Prior;
use super::problem::Problem;
use super::process_noise::{
    NoiseFault, NoiseModel, NoiseNumber, ProcessNoise, filtered, filtered_by, layout_of,
    recorded_quantities,
};
use super::refine::{self, Linearisation};
use super::sensitivity::SensitivityError;
use super::sought_noise::{SoughtDisturbance, SoughtNumber, candidates};
use super::trajectory;
use greybox_numerics::statistics;
use greybox_simulation::Accuracy;
use greybox_simulation::filter::StartVariance;
use greybox_simulation::model::Scale;
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// The least noise of a sensor, as a share of the residuals of the free run: a position encoder may be so much
/// better than the model.
const LEAST_SENSOR: f64 = 1e-6;

/// The standard deviation of the logarithm of a strength before the data are looked at.
const STRENGTH_DEVIATION: f64 = 4.0;

/// Residuals of a record whose beginning says where its estimate is, and that is long to go through.
const LONG_RECORD: usize = 8000;

/// The share of a long record that is gone through first.
const BEGINNING: f64 = 0.25;

/// Steps of the covariance between two samples, where one is not enough.
pub const COVARIANCE_STEPS: u32 = 2;

/// One step is enough where more change the logarithm of the likelihood by less.
const SAME_LIKELIHOOD: f64 = 0.05;

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

impl FittedNoise {
    /// The noise model with the values of the estimate.
    #[must_use]
    pub fn estimated_noise(&self) -> NoiseModel {
        let noise = &self.trial.noise;
        let values = self.trial.problem.values(&self.positions);
        noise.with_values(&values[values.len() - noise.unknowns()..])
    }
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
        beside: None,
        stop,
    };
    fit.trials(candidates)
}

/// A noise model that was fitted, which leaves something unexplained.
#[derive(Clone, Copy, Debug)]
pub struct FittedBasis<'a> {
    /// The fit.
    pub fit: &'a FittedNoise,
    /// The places of the compared outputs whose innovations are not white: the noises of their sensors are
    /// looked for anew.
    pub coloured: &'a [usize],
}

/// Finds where the descents begin of noise models that have another disturbance beside those of a fitted one: of a
/// state that has none, or of the sensor of a coloured output. Empty where there is none. Answers nothing when
/// `stop` was raised.
///
/// # Errors
/// Where the model or the problem does not allow a filter.
pub fn with_another(
    problem: &Problem,
    free_run: &[f64],
    basis: FittedBasis<'_>,
    stop: &AtomicBool,
) -> Result<Option<Vec<NoiseTrial>>, NoiseFault> {
    let Some(deviations) = residual_deviations(problem, free_run, stop) else {
        return Ok(None);
    };
    let fit = NoiseFit {
        problem,
        estimate: &basis.fit.positions[..problem.coordinates.len()],
        deviations: &deviations,
        beside: Some(basis),
        stop,
    };
    let present = &basis.fit.trial.noise.disturbances;
    let may_explain = |added: &SoughtDisturbance| match added.disturbance.acts_on {
        ActsOn::Output(index) => {
            let mut coloured = basis.coloured.iter();
            coloured.any(|place| problem.outputs[*place].index == index)
        }
        ActsOn::Rate(_) | ActsOn::Parameter(_) | ActsOn::Sampled(_) => true,
    };
    let is_new = |added: &SoughtDisturbance| {
        let mut present = present.iter().map(|noise| noise.disturbance);
        present.all(|present| present.acts_on != added.disturbance.acts_on)
    };
    let added = candidates(problem).into_iter().flatten();
    let added = added.filter(|added| is_new(added) && may_explain(added));
    let before = present.iter().map(|noise| {
        let Disturbance { acts_on, kind } = noise.disturbance;
        SoughtDisturbance::open(acts_on, kind)
    });
    let before: Vec<SoughtDisturbance> = before.collect();
    let sought = added.map(|added| before.iter().cloned().chain([added]).collect());
    fit.trials(&sought.collect::<Vec<_>>())
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
    /// A start near the estimate: that of the trial or, where a long record is likelier there, the end of a descent
    /// over a part of the record. Answers nothing when `stop` was raised.
    #[must_use]
    pub fn near_start(&self, stop: &AtomicBool) -> Option<Vec<f64>> {
        let start = self.start.clone();
        if self.problem.n_residuals() < LONG_RECORD {
            return Some(start);
        }
        let beginning = self.problem.beginning(BEGINNING);
        let descent = refine::descend(&beginning, start.clone(), Accuracy::Screening, stop)?;
        let starts = [start, descent.positions];
        let around = compared(&self.problem, &starts, stop)?;
        let is_likelier = around.cost(1) < around.cost(0);
        let [start, nearer] = starts;
        Some(if is_likelier { nearer } else { start })
    }

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
        let mut layout = layout_of(problem, &alone)?;
        // The error of a start is not made by a disturbance.
        for start in &mut layout.starts {
            if let StartVariance::Known(variance) = start {
                *variance = 0.0;
            }
        }
        let alone = filtered_by(problem, &alone, &layout)?.without_measurements();
        let Some(around) = compared(&alone, &[positions.to_vec()], stop) else {
            return Ok(None);
        };
        // Without measurements the variance of each output is what the disturbance makes of it.
        variances.push(around.mean_variances(0));
    }
    Ok(Some(variances))
}

/// The root mean square of what each output leaves where nothing but the inputs moves the plant, SI, and what was
/// recorded of a controller: one that the model computes would hold disturbances down that the recorded one has
/// not. Answers nothing when `stop` was raised.
#[must_use]
pub fn residual_deviations(
    problem: &Problem,
    estimate: &[f64],
    stop: &AtomicBool,
) -> Option<Vec<f64>> {
    let driven = driven_as_recorded(problem);
    let problem = driven.as_ref().unwrap_or(problem);
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

/// The problem with the recorded values of what a controller within the model computes; none where no output
/// shows such a quantity.
fn driven_as_recorded(problem: &Problem) -> Option<Problem> {
    if problem.innovations.is_some() || recorded_quantities(problem, &[]).is_empty() {
        return None;
    }
    let outputs = problem.outputs.iter();
    let nothing_acts = NoiseModel {
        disturbances: Vec::new(),
        sensors: outputs
            .map(|output| NoiseNumber::Given(output.residual_scale))
            .collect(),
        steps: 1,
    };
    filtered(problem, &nothing_acts).ok()
}

/// What a noise model is fitted to.
struct NoiseFit<'a> {
    problem: &'a Problem,
    /// The positions at which noises are scanned.
    estimate: &'a [f64],
    /// The root mean square of each output's residuals in the free run.
    deviations: &'a [f64],
    /// The noise model beside which another disturbance is fitted, where there is one.
    beside: Option<FittedBasis<'a>>,
    stop: &'a AtomicBool,
}

impl NoiseFit<'_> {
    /// The trial of each noise model. Answers nothing when `stop` was raised.
    fn trials(
        &self,
        candidates: &[Vec<SoughtDisturbance>],
    ) -> Result<Option<Vec<NoiseTrial>>, NoiseFault> {
        let trials = candidates.par_iter().map(|sought| self.trial(sought));
        let trials: Result<Vec<_>, NoiseFault> = trials.collect();
        Ok(trials?.into_iter().collect())
    }

    /// Answers nothing when `stop` was raised.
    fn trial(&self, sought: &[SoughtDisturbance]) -> Result<Option<NoiseTrial>, NoiseFault> {
        let Some(strengths) = self.strengths(sought)? else {
            return Ok(None);
        };
        let noise = self.model(sought, &strengths);
        let problem = filtered(self.problem, &noise)?;
        let scan = NoiseScan {
            estimate: self.estimate,
            deviations: self.deviations,
            noise: &noise,
            strengths: &strengths,
            beside: self.beside.map(|basis| ScannedBasis {
                noise: basis.fit.estimated_noise(),
                coloured: basis.coloured.to_vec(),
            }),
        };
        match scan.best(&problem, self.stop) {
            Some(start) => self.close_enough(NoiseTrial {
                noise,
                problem,
                start,
            }),
            None => Ok(None),
        }
    }

    /// The trial with as many steps of the covariance as the likelihood at its start needs. Answers nothing when
    /// `stop` was raised.
    fn close_enough(&self, trial: NoiseTrial) -> Result<Option<NoiseTrial>, NoiseFault> {
        let noise = NoiseModel {
            steps: COVARIANCE_STEPS,
            ..trial.noise.clone()
        };
        let problem = filtered(self.problem, &noise)?;
        let start = std::slice::from_ref(&trial.start);
        let likelihoods = [&trial.problem, &problem].map(|problem| {
            let around = compared(problem, start, self.stop)?;
            Some(around.log_likelihood(0).unwrap_or(f64::NAN))
        });
        let [Some(coarse), Some(fine)] = likelihoods else {
            return Ok(None);
        };
        Ok(Some(match (coarse - fine).abs() < SAME_LIKELIHOOD {
            true => trial,
            false => NoiseTrial {
                noise,
                problem,
                start: trial.start,
            },
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
            ActsOn::Sampled(index) => &description.sampled[index].name,
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
        let disturbances: Vec<ProcessNoise> = disturbed.collect();
        let recorded = recorded_quantities(self.problem, &disturbances);
        let outputs = self.problem.outputs.iter().zip(self.deviations);
        let sensors = outputs.map(|(output, deviation)| {
            let is_recorded = recorded.iter().any(|shown| shown.output == output.index);
            match output.noise_std {
                Some(noise) => NoiseNumber::Given(noise),
                // What acted has no residuals that a noise would explain.
                None if is_recorded => NoiseNumber::Given(*deviation),
                None => NoiseNumber::Unknown {
                    lower: LEAST_SENSOR * deviation,
                    upper: 2.0 * deviation,
                    prior: None,
                },
            }
        });
        NoiseModel {
            disturbances,
            sensors: sensors.collect(),
            steps: 1,
        }
    }
}
