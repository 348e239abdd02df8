//! Noise models fitted from the estimate of the free run, and the analysis of the one that is taken.

use super::analysis::CoordinateUncertainty;
use super::hull::Hull;
use super::linearised::LinearisedEstimate;
use super::noise_analysis::{
    Band, ComparedFit, ComparedNoise, DisturbanceEstimate, FreeRunEstimate, NoiseAnalysis,
    NoiseEstimate,
};
use super::noise_choice::{self, WeighedNoise};
use super::refits::{Refit, RefitName, RefitSequence, RefitTask};
use super::settings::{Intervals, Request, SoughtNoise};
use super::solved::Solved;
use super::{Analysis, covariance, fit, probes, residuals, rules, validation_start};
use crate::estimation::noise_ladder::{self, FittedNoise, NoiseTrial};
use crate::estimation::observer::PosteriorRow;
use crate::estimation::problem::Problem;
use crate::estimation::process_noise::{NoiseModel, NoiseNumber, filtered};
use crate::estimation::report::Report;
use crate::estimation::trajectory;
use greybox_numerics::statistics;
use greybox_simulation::Accuracy;
use greybox_simulation::single::Outputs;
use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

/// Lags over which the errors of what was held back are told to hang together.
const BAND_LAGS: usize = 100;

/// Noise models that are fitted to an estimate of the free run.
#[derive(Debug)]
pub(super) struct NoiseComparison {
    problem: Problem,
    report: Report,
    /// What the free run makes of the unknowns.
    free_run: Box<LinearisedEstimate>,
    trials: Vec<TrialFit>,
    /// Whether the noise model was listed in the job, so that the data do not choose it.
    is_listed: bool,
}

/// A noise model whose descent is a refit.
#[derive(Debug)]
struct TrialFit {
    model: u32,
    trial: NoiseTrial,
    refit: Option<Refit>,
}

impl RefitSequence for TrialFit {
    fn next(&self) -> Option<RefitName> {
        let is_open = self.refit.is_none();
        is_open.then_some(RefitName::ProcessNoise { model: self.model })
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        RefitTask {
            problem: Cow::Borrowed(&self.trial.problem),
            start: self.trial.start.clone(),
            accuracy: Accuracy::Full,
        }
        .run(stop)
    }

    fn follow(&mut self, refit: &Refit, _stop: &AtomicBool) -> Option<()> {
        self.refit = Some(refit.clone());
        Some(())
    }
}

/// The request about the noise model that is taken: draws from its posterior, where they are asked for.
fn of_taken(request: &Request) -> Request {
    let mut taken = request.at_once();
    if request.settings.intervals == Intervals::Posterior {
        taken.settings.intervals = Intervals::Posterior;
        taken.settings.posterior_generations = request.settings.posterior_generations;
    }
    taken
}

impl NoiseComparison {
    /// Begins the comparison at the declared values of what is taken as known; the residuals are those of the
    /// estimate that stands, with the values that the data put in their place. The inner answer is none where no noise is asked for, the residuals of the
    /// free run are white, or nothing can be filtered. Answers nothing when `stop` was raised.
    pub fn begin(
        stands: &Solved,
        unmoved: &Solved,
        request: &Request,
        stop: &AtomicBool,
    ) -> Option<Option<NoiseComparison>> {
        let Solved { problem, report } = unmoved;
        let candidates = match &request.noise {
            SoughtNoise::None => return Some(None),
            SoughtNoise::Auto => noise_ladder::candidates(problem),
            SoughtNoise::Listed(listed) => vec![Vec::new(), listed.clone()],
        };
        let is_listed = matches!(request.noise, SoughtNoise::Listed(_));
        let (moved, at) = (&stands.problem, &stands.report.positions);
        let Ok(trajectories) = trajectory::simulate(moved, at, stop)? else {
            return Some(None);
        };
        let residuals = residuals::report(moved, &trajectories);
        let is_white = residuals.iter().all(|output| output.white != Some(false));
        if is_white && !is_listed {
            return Some(None);
        }
        let trials = noise_ladder::trials(problem, &report.positions, &candidates, stop);
        let Ok(trials) = trials else {
            return Some(None);
        };
        let trials = trials?.into_iter().zip(0..);
        let trials = trials.map(|(trial, model)| TrialFit {
            model,
            trial,
            refit: None,
        });
        let free_run = LinearisedEstimate::of(problem, report, &request.at_once(), stop)?;
        Some(Some(NoiseComparison {
            problem: problem.clone(),
            report: report.clone(),
            free_run: Box::new(free_run),
            trials: trials.collect(),
            is_listed,
        }))
    }

    pub fn sequences(&mut self) -> Vec<&mut dyn RefitSequence> {
        let trials = self.trials.iter_mut();
        trials
            .map(|trial| trial as &mut dyn RefitSequence)
            .collect()
    }

    /// The analysis of the noise model that is taken, when all have been fitted; the inner answer is none
    /// where the free run is taken. Answers nothing when `stop` was raised.
    pub fn examined(
        &self,
        request: &Request,
        stop: &AtomicBool,
    ) -> Option<Option<DisturbedEstimate>> {
        let fits = self.weighed(stop)?;
        let chosen = match self.is_listed {
            true => 1,
            false => noise_choice::chosen(&fits, stop)?,
        };
        let Some(weighed) = &fits[chosen] else {
            return Some(None);
        };
        let is_free_run = weighed.fit.trial.noise.disturbances.is_empty();
        if is_free_run && !(self.can_examine_free_run(request) && weighed.misses_an_effect(stop)?) {
            return Some(None);
        }
        let WeighedNoise {
            fit,
            variances_made,
            ..
        } = weighed;
        let n = self.report.positions.len();
        let of_plant = &fit.positions[..n];
        let plant = validation_start::settled(&self.problem, of_plant, stop)?;
        let probed = probes::probed(&plant, of_plant, stop)?;
        let Ok(problem) = filtered(&probed, &fit.trial.noise) else {
            return Some(None);
        };
        let report = moved(&self.report, &problem, &fit.positions);
        let estimate = LinearisedEstimate::of(&problem, &report, &of_taken(request), stop)?;
        let Ok(free) = trajectory::simulate(&plant, of_plant, stop)? else {
            return Some(None);
        };
        let made = variances_made.iter();
        let shares = made.map(|made| shares(&plant, made)).collect();
        let compared = self.trials.iter().zip(&fits);
        let compared = compared.map(|(trial, weighed)| ComparedNoise {
            disturbances: trial.trial.noise.disturbances.clone(),
            fit: weighed.as_ref().map(|weighed| compared_fit(&weighed.fit)),
            is_too_strong: weighed
                .as_ref()
                .is_some_and(|weighed| weighed.is_too_strong),
        });
        Some(Some(DisturbedEstimate {
            report: moved(&self.report, &plant, of_plant),
            estimation_fit: fit::of(&plant, &free, fit::Part::Estimation),
            validation_fit: fit::of(&plant, &free, fit::Part::Validation),
            shares,
            compared: compared.collect(),
            chosen,
            log_likelihood: fit.log_likelihood,
            noise: fit.trial.noise.clone(),
            free_run: self.free_run.analysis()?,
            free_run_values: self.report.values.clone(),
            estimate,
            plant,
        }))
    }
}

impl NoiseComparison {
    /// The fits with what their disturbances make, in the order of the trials; none where a fit failed. Answers
    /// nothing when `stop` was raised.
    fn weighed(&self, stop: &AtomicBool) -> Option<Vec<Option<WeighedNoise>>> {
        let positions = &self.report.positions;
        let deviations = noise_ladder::residual_deviations(&self.problem, positions, stop)?;
        let mut weighed = Vec::new();
        for trial in &self.trials {
            let refit = trial.refit.as_ref().filter(|refit| refit.cost.is_some());
            let fit = match refit {
                Some(refit) => trial.trial.clone().fitted(refit.positions.clone(), stop)?,
                None => None,
            };
            weighed.push(match fit {
                Some(fit) => Some(WeighedNoise::of(&self.problem, &deviations, fit, stop)?),
                None => None,
            });
        }
        Some(weighed)
    }

    /// Whether the free run can be examined beside the noise models that were fitted: not where refits are asked
    /// for, or values that are taken as known may have been moved.
    fn can_examine_free_run(&self, request: &Request) -> bool {
        !request.settings.has_independent_refits() && self.problem.assumptions.is_empty()
    }
}

/// The report of a run whose estimate was moved.
fn moved(report: &Report, problem: &Problem, positions: &[f64]) -> Report {
    Report {
        positions: positions.to_vec(),
        values: problem.values(positions),
        ..report.clone()
    }
}

fn compared_fit(fit: &FittedNoise) -> ComparedFit {
    let factor = fit.linearisation.triangle.factor();
    let covariance = (factor.transpose() * &factor).try_inverse();
    let deviations = covariance.map(|covariance| {
        let variances = covariance.diagonal();
        variances.iter().map(|variance| variance.sqrt()).collect()
    });
    ComparedFit {
        log_likelihood: fit.log_likelihood,
        bic: fit.bic,
        positions: fit.positions.clone(),
        deviations,
    }
}

/// The share of each compared output's variance that a disturbance makes; none where the output does not
/// vary.
fn shares(problem: &Problem, made: &[f64]) -> Vec<Option<f64>> {
    let share = |(place, made): (usize, &f64)| {
        let experiments = problem.experiments.iter();
        let measured = experiments.flat_map(|data| {
            let used = data.measured[place][..data.estimation_samples].iter();
            used.copied().filter(|value| !value.is_nan())
        });
        let measured: Vec<f64> = measured.collect();
        let deviation = statistics::standard_deviation(&measured)?;
        Some((made / (deviation * deviation)).min(1.0)).filter(|share| share.is_finite())
    };
    made.iter().enumerate().map(share).collect()
}

/// The estimate under the noise model that was taken.
#[derive(Debug)]
pub(super) struct DisturbedEstimate {
    /// The problem of the plant, with the starts of experiments that only validate.
    pub plant: Problem,
    /// What the run came to, at the plant's unknowns.
    pub report: Report,
    /// The estimate of the plant's unknowns and those of the noise.
    estimate: LinearisedEstimate,
    /// How well the free run at the estimate follows the data that were estimated from.
    estimation_fit: Vec<fit::OutputFit>,
    /// How well it follows the data that were held back.
    validation_fit: Vec<fit::OutputFit>,
    noise: NoiseModel,
    /// For each disturbance the share of each output's variance that it makes.
    shares: Vec<Vec<Option<f64>>>,
    compared: Vec<ComparedNoise>,
    chosen: usize,
    log_likelihood: f64,
    /// The analysis of the free run's own estimate, and its values.
    free_run: Analysis,
    free_run_values: Vec<f64>,
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
        for (described, free) in analysis
            .coordinates
            .iter_mut()
            .zip(&self.free_run.coordinates)
        {
            described.output_changes.clone_from(&free.output_changes);
        }
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
    found: std::slice::Iter<'a, CoordinateUncertainty>,
    values: std::slice::Iter<'a, f64>,
}

impl<'a> NoiseNumbers<'a> {
    fn new(coordinates: &'a [CoordinateUncertainty], values: &'a [f64]) -> NoiseNumbers<'a> {
        NoiseNumbers {
            found: coordinates.iter(),
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
        let error = self.found.next().and_then(|found| found.standard_error);
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
