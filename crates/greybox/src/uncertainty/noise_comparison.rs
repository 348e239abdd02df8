//! Noise models fitted from the estimate of the free run, and the analysis of the one that is taken.

use super::disturbed_estimate::DisturbedEstimate;
use super::linearised::LinearisedEstimate;
use super::noise_analysis::{ComparedFit, ComparedNoise};
use super::noise_choice::{self, WeighedNoise};
use super::refits::{Refit, RefitName, RefitSequence, RefitTask};
use super::settings::{Intervals, Request, SoughtNoise};
use super::solved::Solved;
use super::{fit, probes, residuals, validation_start};
use crate::estimation::noise_ladder::{self, FittedBasis, FittedNoise, NoiseTrial};
use crate::estimation::problem::{Assumption, Problem};
use crate::estimation::process_noise::filtered;
use crate::estimation::report::Report;
use crate::estimation::sought_noise;
use crate::estimation::trajectory;
use greybox_numerics::statistics;
use greybox_simulation::Accuracy;
use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Noise models that are fitted to an estimate of the free run.
#[derive(Debug)]
pub(super) struct NoiseComparison {
    problem: Problem,
    report: Report,
    /// What the free run makes of the unknowns.
    free_run: Arc<LinearisedEstimate>,
    /// All noise models that were tried so far.
    trials: Vec<TrialFit>,
    /// The weighed noise models of earlier rounds, in their order.
    weighed: Vec<Option<Arc<WeighedNoise>>>,
    /// The free run with what is taken as known where the data and the tolerances put it; none where nothing was
    /// moved.
    moved_free_run: Option<TrialFit>,
    /// Whether the noise model was listed in the job, so that the data do not choose it.
    is_listed: bool,
}

/// What follows when all noise models of a round are fitted.
#[derive(Debug)]
pub(super) enum AfterNoiseRound {
    /// Another disturbance is tried beside those of the likeliest model.
    Further(Box<NoiseComparison>),
    /// The noise model that is taken.
    Taken(Box<DisturbedEstimate>),
    /// The free run is taken.
    FreeRun,
}

/// Disturbances of a noise model at the most.
const MOST_DISTURBANCES: usize = 4;

/// A noise model whose descent is a refit.
#[derive(Clone, Debug)]
struct TrialFit {
    model: u32,
    trial: NoiseTrial,
    refit: Option<Refit>,
}

impl TrialFit {
    fn all(trials: Vec<NoiseTrial>, first: u32) -> Vec<TrialFit> {
        let numbered = trials.into_iter().zip(first..);
        let open = numbered.map(|(trial, model)| TrialFit {
            model,
            trial,
            refit: None,
        });
        open.collect()
    }

    /// The fit when the descent has finished; the inner answer is none where it failed. Answers nothing when
    /// `stop` was raised.
    fn fitted(&self, stop: &AtomicBool) -> Option<Option<FittedNoise>> {
        match self.refit.as_ref().filter(|refit| refit.cost.is_some()) {
            Some(refit) => self.trial.clone().fitted(refit.positions.clone(), stop),
            None => Some(None),
        }
    }
}

impl RefitSequence for TrialFit {
    fn next(&self) -> Option<RefitName> {
        let is_open = self.refit.is_none();
        is_open.then_some(RefitName::ProcessNoise { model: self.model })
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        RefitTask {
            problem: Cow::Borrowed(&self.trial.problem),
            start: self.trial.near_start(stop)?,
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
            SoughtNoise::Auto => sought_noise::candidates(problem),
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
        let trials = TrialFit::all(trials?, 0);
        let moved_free_run = match has_moved(moved) && !is_listed {
            true => noise_ladder::trials(moved, at, &[Vec::new()], stop),
            false => Ok(Some(Vec::new())),
        };
        let moved_free_run = moved_free_run.unwrap_or_else(|_| Some(Vec::new()))?;
        let moved_free_run = TrialFit::all(moved_free_run, trials.len() as u32).pop();
        let free_run = LinearisedEstimate::of(problem, report, &request.at_once(), stop)?;
        Some(Some(NoiseComparison {
            problem: problem.clone(),
            report: report.clone(),
            free_run: Arc::new(free_run),
            trials,
            weighed: Vec::new(),
            moved_free_run,
            is_listed,
        }))
    }

    pub fn sequences(&mut self) -> Vec<&mut dyn RefitSequence> {
        let trials = self.trials.iter_mut().chain(&mut self.moved_free_run);
        trials
            .map(|trial| trial as &mut dyn RefitSequence)
            .collect()
    }

    /// Goes on when all noise models of the round are fitted. Answers nothing when `stop` was raised.
    pub fn after_round(&self, request: &Request, stop: &AtomicBool) -> Option<AfterNoiseRound> {
        let weighed = self.weighed(stop)?;
        if let Some(further) = self.further(&weighed, stop)? {
            return Some(AfterNoiseRound::Further(Box::new(further)));
        }
        Some(match self.examined(&weighed, request, stop)? {
            Some(taken) => AfterNoiseRound::Taken(Box::new(taken)),
            None => AfterNoiseRound::FreeRun,
        })
    }

    /// The comparison with another disturbance beside those of the likeliest noise model, where that is one of this
    /// round, misses an effect, and misses it at fewer outputs than the round before: a plant that no disturbance
    /// explains is not asked on and on. The inner answer is none where there is nothing to try. Answers nothing when
    /// `stop` was raised.
    fn further(
        &self,
        weighed: &[Option<Arc<WeighedNoise>>],
        stop: &AtomicBool,
    ) -> Option<Option<NoiseComparison>> {
        let Some((place, likeliest)) = noise_choice::likeliest(weighed) else {
            return Some(None);
        };
        let n_disturbances = likeliest.fit.trial.noise.disturbances.len();
        let is_of_this_round = place >= self.weighed.len() && n_disturbances > 0;
        let may_go_on = !self.is_listed && is_of_this_round && n_disturbances < MOST_DISTURBANCES;
        let before = match noise_choice::likeliest(&self.weighed) {
            Some((_, earlier)) => Some(earlier),
            None => weighed.first().and_then(Option::as_deref),
        };
        let n_coloured = likeliest.coloured.len();
        let has_helped = before.is_some_and(|before| n_coloured < before.coloured.len());
        if !may_go_on || !has_helped || !likeliest.misses_an_effect() {
            return Some(None);
        }
        let basis = FittedBasis {
            fit: &likeliest.fit,
            coloured: &likeliest.coloured,
        };
        let free_run = &self.report.positions;
        let further = noise_ladder::with_another(&self.problem, free_run, basis, stop);
        let further = further.unwrap_or_else(|_| Some(Vec::new()))?;
        if further.is_empty() {
            return Some(None);
        }
        let first = self.trials.len() + usize::from(self.moved_free_run.is_some());
        let further = TrialFit::all(further, first as u32);
        Some(Some(NoiseComparison {
            problem: self.problem.clone(),
            report: self.report.clone(),
            free_run: Arc::clone(&self.free_run),
            trials: self.trials.iter().cloned().chain(further).collect(),
            weighed: weighed.to_vec(),
            moved_free_run: self.moved_free_run.clone(),
            is_listed: self.is_listed,
        }))
    }

    /// The analysis of the noise model that is taken, when all have been fitted; the inner answer is none
    /// where the free run is taken. Answers nothing when `stop` was raised.
    fn examined(
        &self,
        fits: &[Option<Arc<WeighedNoise>>],
        request: &Request,
        stop: &AtomicBool,
    ) -> Option<Option<DisturbedEstimate>> {
        let chosen = match self.is_listed {
            true => 1,
            false => noise_choice::chosen(fits),
        };
        let Some(weighed) = fits[chosen].as_deref() else {
            return Some(None);
        };
        if self.is_explained_by_what_is_known(weighed.fit.bic, stop)? {
            return Some(None);
        }
        let is_free_run = weighed.fit.trial.noise.disturbances.is_empty();
        if is_free_run && !(self.can_examine_free_run(request) && weighed.misses_an_effect()) {
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
        let compared = self.trials.iter().zip(fits);
        let compared = compared.map(|(trial, weighed)| ComparedNoise {
            disturbances: trial.trial.noise.disturbances.clone(),
            fit: weighed.as_ref().map(|weighed| compared_fit(&weighed.fit)),
            is_too_strong: weighed
                .as_ref()
                .is_some_and(|weighed| weighed.is_too_strong),
            misses_an_effect: weighed
                .as_ref()
                .is_some_and(|weighed| weighed.misses_an_effect()),
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
    fn weighed(&self, stop: &AtomicBool) -> Option<Vec<Option<Arc<WeighedNoise>>>> {
        let deviations = self.left_without_disturbances(stop)?;
        let mut weighed = self.weighed.clone();
        for trial in &self.trials[weighed.len()..] {
            weighed.push(match trial.fitted(stop)? {
                Some(fit) => {
                    let weighed = WeighedNoise::of(&self.problem, &deviations, fit, stop)?;
                    Some(Arc::new(weighed))
                }
                None => None,
            });
        }
        Some(weighed)
    }

    /// The root mean square of what each output leaves where nothing but the inputs moves the plant: in the free
    /// run or, where what a controller computed was recorded, in the fit without disturbances. Answers nothing
    /// when `stop` was raised.
    fn left_without_disturbances(&self, stop: &AtomicBool) -> Option<Vec<f64>> {
        let innovations = self
            .trials
            .first()
            .and_then(|first| first.trial.problem.innovations.as_ref());
        if innovations.is_some_and(|rows| !rows.recorded.is_empty())
            && let Some(fit) = self.trials[0].fitted(stop)?
        {
            return noise_ladder::residual_deviations(&fit.trial.problem, &fit.positions, stop);
        }
        noise_ladder::residual_deviations(&self.problem, &self.report.positions, stop)
    }

    /// Whether the free run with what is taken as known where the data and the tolerances put it is likelier than
    /// a noise model with this criterion: what was known with a tolerance then needs no disturbance. Answers
    /// nothing when `stop` was raised.
    fn is_explained_by_what_is_known(&self, bic: f64, stop: &AtomicBool) -> Option<bool> {
        let Some(trial) = &self.moved_free_run else {
            return Some(false);
        };
        let Some(fit) = trial.fitted(stop)? else {
            return Some(false);
        };
        let problem = &fit.trial.problem;
        let each = libm::log(problem.n_residuals() as f64);
        let off = problem.assumptions.iter().map(Assumption::off);
        let of_moved: f64 = off
            .filter(|off| *off != 0.0)
            .map(|off| off * off + each)
            .sum();
        Some(fit.bic + of_moved < bic)
    }

    /// Whether the free run can be examined beside the noise models that were fitted: not where refits are asked
    /// for, or values that are taken as known may have been moved.
    fn can_examine_free_run(&self, request: &Request) -> bool {
        !request.settings.has_independent_refits() && self.problem.assumptions.is_empty()
    }
}

/// Whether something that is taken as known is not at its declared value.
fn has_moved(problem: &Problem) -> bool {
    let mut assumptions = problem.assumptions.iter();
    assumptions.any(|assumption| assumption.off() != 0.0)
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
