//! Values that are taken as known take part in the fit.
//!
//! Constants with a tolerance, effects that are left out, gains, offsets and lags of sensors and the
//! clock are nuisance unknowns whose tolerances are priors: the estimate is where the data and all
//! priors together are likeliest, in the unknowns and in the nuisances. The linear model of both
//! ([`super::joint`]) says where the data and the tolerances put the nuisances; they are moved there
//! within their limits, the unknowns are fitted again with the nuisances held, and so on until both
//! stand (Gauss–Newton steps of the nuisances about the fit of the unknowns; G. H. Golub, V. Pereyra,
//! "The differentiation of pseudo-inverses and nonlinear least squares problems whose variables
//! separate", SIAM J. Numer. Anal. 10, 1973). A step after which data and tolerances are no
//! likelier is tried again, shorter.
//!
//! Where the data gain no more by it than noise alone makes them gain, all nuisances stay at their
//! declared values: an estimate with exact constants does not scatter for their tolerances.

use super::assumed_values::{correct_sensors, take};
use super::budget::{self, Extended};
use super::covariance;
use super::joint::{Joint, JointStep};
use super::refits::{Refit, RefitName, RefitSequence, RefitTask};
use super::residuals::{self, ResidualReport};
use super::sensors::Sensors;
use super::weighing::{Seen, Weighing};
use super::{fit, reweighting};
use crate::estimation::problem::{Assumed, Problem};
use crate::estimation::report::Report;
use crate::estimation::trajectory;
use greybox_simulation::Accuracy;
use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

/// Steps that are tried at the most.
const MOST_STEPS: u32 = 16;
/// No nuisance moves further in one step, in standard deviations of its tolerance.
const LONGEST_STEP: f64 = 3.0;
/// A step that makes nothing likelier is shortened by this factor, down to `SHORTEST_SHARE`.
const SHORTER: f64 = 0.25;
/// A step that is shortened further is not tried any more.
const SHORTEST_SHARE: f64 = 0.01;
/// The 99 % point of the normal distribution: of a hundred jobs in which all declared values are
/// exact, one leaves them.
const NORMAL_99: f64 = 2.326;
/// Steps end where the next one gains less than this of twice the logarithm of the likelihood: then
/// no unknown moves by more than a hundredth of its total standard error.
const FINISHED: f64 = 1e-4;

/// An estimate whose nuisances are moved to where the data and the tolerances put them.
#[derive(Clone, Debug)]
pub(super) struct NuisanceFit {
    /// The problem with the declared values and the recordings as they were measured.
    declared: Problem,
    /// The problem with the values that are taken.
    pub problem: Problem,
    /// The estimate with these values.
    pub report: Report,
    /// −2·log of how likely the values that are taken make the data and the priors, but for a constant.
    objective: f64,
    /// The steps that were tried.
    tried: u32,
    /// The step that comes next; none where the nuisances stand.
    step: Option<NuisanceStep>,
}

/// A step of the nuisances, in full length.
#[derive(Clone, Debug)]
struct NuisanceStep {
    /// How far each nuisance moves, in standard deviations of its tolerance.
    nuisances: Vec<f64>,
    /// How far each unknown moves along, as a position.
    unknowns: Vec<f64>,
    /// The part of the step that is tried.
    share: f64,
    /// The problem with the declared values, its sensors seen as at the estimate.
    problem: Problem,
    /// Where the refit of the unknowns starts.
    start: Vec<f64>,
}

/// An estimate, simulated and linearised with its nuisances.
struct Standing {
    objective: f64,
    residuals: Vec<ResidualReport>,
    joint: Joint,
    /// The linear model with residuals that are taken for white; none where they are.
    unfiltered: Option<Joint>,
    sensors: Sensors,
    /// For each nuisance whether nothing can be said of it.
    fails: Vec<bool>,
}

impl NuisanceFit {
    /// Looks whether the nuisances of an estimate are to be moved. Answers nothing when `stop` was
    /// raised.
    pub fn begin(problem: &Problem, report: &Report, stop: &AtomicBool) -> Option<NuisanceFit> {
        let mut fit = NuisanceFit {
            declared: problem.clone(),
            problem: problem.clone(),
            report: report.clone(),
            objective: f64::INFINITY,
            tried: 0,
            step: None,
        };
        if let Some(standing) = Standing::of(problem, &report.positions, stop)? {
            fit.objective = standing.objective;
            if fit.is_notable(&standing) {
                fit.step = fit.next_step(&standing);
            }
        }
        Some(fit)
    }

    /// Whether the data gain more by other values of the nuisances than noise alone would make them
    /// gain. What a nuisance leaves behind may itself pass for noise with a memory, so that the
    /// residuals count as they are too.
    fn is_notable(&self, standing: &Standing) -> bool {
        let joints = std::iter::once(&standing.joint).chain(&standing.unfiltered);
        let mut steps = joints.filter_map(|joint| self.step_by(joint, standing));
        steps.any(|step| step.gain > gain_by_chance(&step))
    }

    /// The step within the limits to where the data and the tolerances put the nuisances.
    fn step_by(&self, joint: &Joint, standing: &Standing) -> Option<JointStep> {
        let mut is_held = self.cannot_move(standing);
        loop {
            let step = joint.step(&is_held)?;
            if !self.hold_at_limits(&step.assumptions, &mut is_held) {
                return Some(step);
            }
        }
    }

    /// The step that comes next; none where the nuisances stand.
    fn next_step(&self, standing: &Standing) -> Option<NuisanceStep> {
        if self.tried >= MOST_STEPS {
            return None;
        }
        let step = self.step_by(&standing.joint, standing)?;
        if step.gain <= FINISHED {
            return None;
        }
        let longest = step
            .assumptions
            .iter()
            .fold(0.0, |a: f64, b| a.max(b.abs()));
        let next = NuisanceStep {
            nuisances: step.assumptions,
            unknowns: step.unknowns,
            share: (LONGEST_STEP / longest).min(1.0),
            problem: self.declared.clone(),
            start: Vec::new(),
        };
        Some(self.tried_from(next, standing))
    }

    /// For each nuisance whether it is held: nothing can be said of it, or it acts on measurements
    /// where innovations are compared, which measurements drive.
    fn cannot_move(&self, standing: &Standing) -> Vec<bool> {
        let innovations = self.problem.innovations.is_some();
        let assumptions = self.problem.assumptions.iter().zip(&standing.fails);
        let is_held = assumptions.map(|(assumption, fails)| {
            let acts_on_measurements = !matches!(assumption.target, Assumed::Model(_));
            *fails || innovations && acts_on_measurements
        });
        is_held.collect()
    }

    /// Holds the nuisances that a step would take beyond a limit at which they stand; whether there
    /// are any.
    fn hold_at_limits(&self, step: &[f64], is_held: &mut [bool]) -> bool {
        let mut holds = false;
        for (place, assumption) in self.problem.assumptions.iter().enumerate() {
            let [lower, upper] = assumption.limits;
            let is_at = |limit: Option<f64>, side: f64| {
                let beyond = |limit: f64| side * (assumption.taken - limit) >= 0.0;
                side * step[place] > 0.0 && limit.is_some_and(beyond)
            };
            if !is_held[place] && (is_at(lower, -1.0) || is_at(upper, 1.0)) {
                is_held[place] = true;
                holds = true;
            }
        }
        holds
    }

    /// Readies the share of a step that is to be tried.
    fn tried_from(&self, step: NuisanceStep, standing: &Standing) -> NuisanceStep {
        let share = step.share;
        let assumptions = self.problem.assumptions.iter().zip(&step.nuisances);
        let values = assumptions.map(|(assumption, by)| {
            let [lower, upper] = assumption.limits;
            let value = assumption.taken + share * by * assumption.tolerance;
            let value = lower.map_or(value, |lower| value.max(lower));
            upper.map_or(value, |upper| value.min(upper))
        });
        let values: Vec<f64> = values.collect();
        let mut problem = self.declared.clone();
        take(&mut problem, &values);
        correct_sensors(&mut problem, &standing.sensors);
        if reweighting::is_needed(&problem) {
            let outputs = problem.outputs.iter_mut().zip(&standing.residuals);
            let unknown = outputs.filter(|(output, _)| output.noise_std.is_none());
            unknown.for_each(|(output, report)| output.residual_scale = report.noise_std);
        }
        let pairs = self.report.positions.iter().zip(&step.unknowns);
        NuisanceStep {
            start: pairs
                .map(|(position, by)| (position + share * by).clamp(0.0, 1.0))
                .collect(),
            problem,
            ..step
        }
    }

    /// The step, shorter; none where it is short enough.
    fn shortened(&self, step: &NuisanceStep, stop: &AtomicBool) -> Option<Option<NuisanceStep>> {
        let share = step.share * SHORTER;
        if share < SHORTEST_SHARE || self.tried >= MOST_STEPS {
            return Some(None);
        }
        let standing = Standing::of(&self.problem, &self.report.positions, stop)?;
        let step = NuisanceStep {
            share,
            ..step.clone()
        };
        Some(standing.map(|standing| self.tried_from(step, &standing)))
    }
}

impl RefitSequence for NuisanceFit {
    fn next(&self) -> Option<RefitName> {
        let round = self.tried;
        self.step.as_ref().map(|_| RefitName::Nuisances { round })
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        let (problem, start) = match &self.step {
            Some(step) => (&step.problem, &step.start),
            None => (&self.problem, &self.report.positions),
        };
        RefitTask {
            problem: Cow::Borrowed(problem),
            start: start.clone(),
            accuracy: Accuracy::Full,
        }
        .run(stop)
    }

    fn follow(&mut self, refit: &Refit, stop: &AtomicBool) -> Option<()> {
        let mut next = self.clone();
        let step = next.step.take()?;
        next.tried += 1;
        let standing = match refit.cost {
            Some(_) => Standing::of(&step.problem, &refit.positions, stop)?,
            None => None,
        };
        match standing.filter(|standing| standing.objective < self.objective) {
            Some(standing) => {
                next.objective = standing.objective;
                let declared = next.report.positions.clone();
                next.report.declared_positions.get_or_insert(declared);
                next.report.values = step.problem.values(&refit.positions);
                next.report.positions.clone_from(&refit.positions);
                next.report.cost = refit.cost;
                next.problem = step.problem;
                next.step = next.next_step(&standing);
            }
            None => next.step = next.shortened(&step, stop)?,
        }
        *self = next;
        Some(())
    }
}

impl Standing {
    /// Simulates and linearises an estimate. Nothing where there are no nuisances that something can
    /// be said of; answers nothing at all when `stop` was raised.
    fn of(problem: &Problem, positions: &[f64], stop: &AtomicBool) -> Option<Option<Standing>> {
        let extended = Extended::new(problem, positions, true);
        if extended.assumptions().is_empty() {
            return Some(None);
        }
        let Ok(trajectories) = trajectory::simulate(problem, positions, stop)? else {
            return Some(None);
        };
        let residuals = residuals::report(problem, &trajectories);
        let around = extended.around(Accuracy::Full, stop)?;
        let Ok(linear) = covariance::linearise(problem, &around.neighbourhood, &residuals) else {
            return Some(None);
        };
        let seen = Seen {
            trajectories: &trajectories,
            residuals: &residuals,
            linear: &linear,
        };
        let weighing = Weighing::of(problem, seen);
        let Ok(Some(joint)) = budget::gather(&extended, &around, weighing) else {
            return Some(None);
        };
        let unfiltered = match residuals.iter().any(|report| report.white == Some(false)) {
            true => budget::gather(&extended, &around, Weighing::of(problem, seen).unfiltered()),
            false => Ok(None),
        };
        let samples = fit::of(problem, &trajectories, fit::Part::Estimation);
        let samples = samples.iter().map(|fit| fit.samples as f64);
        let data: f64 = residuals.iter().zip(samples).map(deviance).sum();
        let off = problem
            .assumptions
            .iter()
            .map(|assumption| assumption.off());
        let priors = problem.prior_sum(positions).0 + off.map(|off| off * off).sum::<f64>();
        let fails = |place: usize| around.fails(&extended, place);
        Some(Some(Standing {
            objective: data + priors,
            fails: (0..problem.assumptions.len()).map(fails).collect(),
            sensors: around.sensors().clone(),
            joint,
            unfiltered: unfiltered.ok().flatten(),
            residuals,
        }))
    }
}

/// The gain of a step that noise alone exceeds in one of a hundred jobs: that of a χ² with as many
/// degrees of freedom as the data see nuisances (E. B. Wilson, M. M. Hilferty, 1931).
fn gain_by_chance(step: &JointStep) -> f64 {
    let freedom = step.expected_gain.max(1.0);
    let spread = 2.0 / (9.0 * freedom);
    let quantile = freedom * (1.0 - spread + NORMAL_99 * spread.sqrt()).powi(3);
    quantile * step.expected_gain.min(1.0)
}

/// −2·log of the likelihood of an output's residuals, but for a constant: the noise is the declared
/// one, or larger where the residuals are.
fn deviance((report, samples): (&ResidualReport, f64)) -> f64 {
    let each = match report.chi_square_per_sample {
        Some(chi_square) if chi_square <= 1.0 => chi_square,
        Some(chi_square) => 1.0 + libm::log(chi_square),
        None => 2.0 * libm::log(report.noise_std),
    };
    samples * each
}
