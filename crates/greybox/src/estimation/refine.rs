//! Levenberg–Marquardt within the search box, from several good candidates.
//!
//! In positions (0 to 1 along each coordinate's scale) the scaled residuals are linearised
//! ([`super::sensitivity`]); the damped least-squares steps for several dampings are simulated
//! together and the best of them is taken (K. Levenberg 1944, D. W. Marquardt 1963; with a triangle
//! instead of normal equations: J. J. Moré, "The Levenberg–Marquardt algorithm", Lecture Notes in
//! Mathematics 630, 1978). A coordinate at a bound that is drawn beyond it is held there; under constraints
//! ([`super::feasible`]) the steps are the least squares within them. A descent
//! is coarsely simulated first; the one that came lowest is then polished, simulated finely.

mod end;
mod linearisation;
mod trial;

pub use end::DescentEnd;
pub use linearisation::{Linearisation, Outlook, linearise};
pub use trial::trial_steps;

use super::feasible;
use super::problem::Problem;
use super::sensitivity::{Neighbourhood, SensitivityError, Sides};
use greybox_numerics::lanes::LANES;
use greybox_simulation::Accuracy;
use linearisation::{SHORT, sides};
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;
use trial::{Standing, Trial};

/// Iterations of a descent at the most; a short record may have more of them.
fn most_iterations(accuracy: Accuracy, rows: usize) -> u32 {
    match accuracy {
        Accuracy::Ranking | Accuracy::Screening => 60,
        Accuracy::Full if rows <= SHORT => 500,
        Accuracy::Full | Accuracy::Reference => 120,
    }
}
/// No descent has more, whatever keeps it from its end.
const HARD_LIMIT: u32 = 2000;
/// A descent ends when an iteration gains less than this share of the cost, or moves no coordinate
/// by more than this share of its range; a coarse one where its simulation is no closer to the truth.
fn smallest_progress(accuracy: Accuracy) -> (f64, f64) {
    match accuracy {
        Accuracy::Ranking | Accuracy::Screening => (1e-5, 1e-6),
        Accuracy::Full | Accuracy::Reference => (1e-16, 1e-14),
    }
}
/// A fine descent ends within so many standard errors of its minimum: polishing a short record
/// costs nothing, and its standard errors are large. Noise models are compared by differences of their likelihoods,
/// which a thousandth of a standard error changes by a millionth.
fn polished(problem: &Problem, rows: usize) -> f64 {
    match problem.innovations {
        _ if rows <= SHORT => 1e-8,
        Some(_) => 1e-3,
        None => 1e-4,
    }
}
/// The last step is at most so many standard errors long, and not simulated any more.
const NEAR: f64 = 1e-2;
/// Where the cost cannot tell any more, steps are taken as long as they shrink by this.
const STILL_SHRINKING: f64 = 0.7;
/// The fine descent of a record that is not short ends when so many iterations in a row have gained
/// less of χ² than this: by then derivatives by differences have no digits left to tell the way.
const IDLE_ITERATIONS: u32 = 3;
const IDLE_GAIN: f64 = 1e-6;
/// Two minima that are fewer standard errors apart are one.
const SAME_MINIMUM: f64 = 1.0;
/// On a long record the boldest step is taken, where the residuals are linearised already, if it
/// gains this share of what the best of the others does.
const ENOUGH: f64 = 0.999;
/// At least so many others.
const FEWEST_OTHERS: usize = 3;
const FIRST_DAMPING: f64 = 1e-3;
/// Where none of them gains anything, so many times larger ones are tried.
const DAMPING_RISE: f64 = 1e5;
/// The largest damping that is raised.
const LARGEST_DAMPING: f64 = 1e6;

/// Descends from a start to the end. Nothing when `stop` was raised.
#[must_use]
pub fn descend(
    problem: &Problem,
    start: Vec<f64>,
    accuracy: Accuracy,
    stop: &AtomicBool,
) -> Option<Descent> {
    descend_at_most(problem, start, accuracy, HARD_LIMIT, stop)
}

/// Descends from a start for `iterations` iterations at the most; a descent that they cut short has
/// no end. Nothing when `stop` was raised.
#[must_use]
pub fn descend_at_most(
    problem: &Problem,
    start: Vec<f64>,
    accuracy: Accuracy,
    iterations: u32,
    stop: &AtomicBool,
) -> Option<Descent> {
    let mut descent = Descent::from(start);
    if accuracy == Accuracy::Full {
        descent.polish();
    }
    while descent.end.is_none() && descent.iterations < iterations {
        if !descent.iterate(problem, &[], stop) {
            return None;
        }
    }
    Some(descent)
}

/// What one iteration leads to.
struct Step {
    trial: Trial,
    cost: f64,
    /// The residuals linearised there, if they are.
    linearisation: Option<Linearisation>,
}

impl Step {
    /// No damping leads anywhere.
    fn nowhere() -> Step {
        Step {
            trial: Trial {
                damping: FIRST_DAMPING,
                stretch: 1.0,
                positions: Vec::new(),
            },
            cost: f64::INFINITY,
            linearisation: None,
        }
    }
}

fn unstretched() -> f64 {
    1.0
}

/// A minimum of the cost.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// Where.
    pub positions: Vec<f64>,
    /// The cost there.
    pub cost: f64,
}

/// One descent from one start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Descent {
    /// The search that it started from, counted from 0.
    #[serde(default)]
    pub search: Option<u32>,
    /// Where the descent started.
    pub start: Vec<f64>,
    /// The cost there; none where the start cannot be simulated, or before the first iteration.
    pub start_cost: Option<f64>,
    /// Where the descent is.
    pub positions: Vec<f64>,
    /// The cost there.
    pub cost: Option<f64>,
    /// Iterations done.
    pub iterations: u32,
    /// Candidates simulated.
    pub evaluations: u64,
    /// Why it ended, if it did.
    pub end: Option<DescentEnd>,
    /// The cost where the coarse descent ended: what descents are compared by.
    pub coarse_cost: Option<f64>,
    accuracy: Accuracy,
    damping: f64,
    /// How much longer the last step was than the linear model had it.
    #[serde(default = "unstretched")]
    stretch: f64,
    /// The last step; nothing before the first.
    #[serde(default)]
    last_step: Vec<f64>,
    /// How far the linear model's minimum was away, in standard errors.
    distance: Option<f64>,
    /// How much of the distance before that was left.
    shrinkage: f64,
    /// The residuals linearised where it is, if they are. Not saved: they come out the same again.
    #[serde(skip)]
    linearisation: Option<Linearisation>,
    /// Whether the candidates of the linearisation are among the evaluations.
    is_counted: bool,
    /// Iterations in a row, up to the last, that have gained next to nothing.
    #[serde(default)]
    idle: u32,
}

impl Descent {
    /// A descent that begins at a candidate.
    #[must_use]
    pub fn from(start: Vec<f64>) -> Descent {
        Descent {
            search: None,
            positions: start.clone(),
            start,
            start_cost: None,
            cost: None,
            iterations: 0,
            evaluations: 0,
            end: None,
            coarse_cost: None,
            accuracy: Accuracy::Screening,
            damping: FIRST_DAMPING,
            stretch: unstretched(),
            last_step: Vec::new(),
            distance: None,
            shrinkage: 1.0,
            linearisation: None,
            is_counted: false,
            idle: 0,
        }
    }

    /// Whether the descent is simulated finely.
    #[must_use]
    pub fn is_polished(&self) -> bool {
        self.accuracy == Accuracy::Full
    }

    /// Lets it go on, simulated finely.
    pub fn polish(&mut self) {
        self.accuracy = Accuracy::Full;
        self.coarse_cost = self.cost.take();
        self.end = None;
        self.linearisation = None;
        self.is_counted = false;
    }

    /// One iteration; `minima` are those that other descents have found. Answers false, with nothing
    /// changed, when `stop` was raised.
    pub fn iterate(&mut self, problem: &Problem, minima: &[Minimum], stop: &AtomicBool) -> bool {
        let Some(allowed) = feasible::nearest(problem, self.positions.clone()) else {
            self.end = Some(DescentEnd::Failed);
            return true;
        };
        self.positions = allowed;
        let linearisation = match self.linearisation.take() {
            Some(linearisation) => linearisation,
            None => match linearise(problem, &self.positions, self.accuracy, stop) {
                Ok(linearisation) => {
                    if !self.is_counted {
                        self.evaluations += self.columns(problem);
                    }
                    linearisation
                }
                Err(SensitivityError::Interrupted) => return false,
                Err(SensitivityError::Failed(_)) => {
                    self.end = Some(DescentEnd::Failed);
                    return true;
                }
            },
        };
        self.start_cost.get_or_insert(linearisation.cost);
        if let Some((end, minimum)) = self.predicted_end(problem, &linearisation, minima) {
            self.positions = minimum.positions;
            self.cost = Some(minimum.cost);
            self.end = Some(end);
            return true;
        }
        let Some(step) = self.step(problem, &linearisation, stop) else {
            self.linearisation = Some(linearisation);
            return false;
        };
        self.iterations += 1;
        let gains = step.cost < self.cost.unwrap_or(linearisation.cost);
        if !gains && self.iterations >= HARD_LIMIT {
            self.cost.get_or_insert(linearisation.cost);
            self.end = Some(DescentEnd::IterationLimit);
            return true;
        }
        if !gains && self.is_near() {
            // The cost has no digits left for so short a step; its derivatives have.
            match linearisation.outlook(problem, &self.positions) {
                Some(outlook) if self.shrinkage < STILL_SHRINKING => {
                    self.positions = outlook.positions;
                    self.is_counted = false;
                }
                _ => self.end = Some(DescentEnd::Converged),
            }
            self.cost.get_or_insert(linearisation.cost);
            return true;
        }
        if !gains && self.damping < LARGEST_DAMPING {
            // Downhill it goes, if only the step is short enough.
            self.damping *= DAMPING_RISE;
            self.cost.get_or_insert(linearisation.cost);
            self.linearisation = Some(linearisation);
            self.is_counted = true;
            return true;
        }
        self.take(step, &linearisation);
        true
    }

    /// Whether what the linear model says about the way that is left can be relied on.
    fn is_near(&self) -> bool {
        self.is_polished() && self.distance.is_some_and(|distance| distance < NEAR)
    }

    /// The number of candidates that a linearisation simulates.
    fn columns(&self, problem: &Problem) -> u64 {
        sides(problem, self.accuracy).candidates(self.positions.len())
    }

    /// Simulates what the dampings lead to; the boldest together with its neighbours, because it
    /// mostly wins and is then linearised already. Answers nothing when `stop` was raised.
    fn step(
        &mut self,
        problem: &Problem,
        linearisation: &Linearisation,
        stop: &AtomicBool,
    ) -> Option<Step> {
        let least = self.columns(problem) as usize + FEWEST_OTHERS;
        let others = FEWEST_OTHERS + least.next_multiple_of(LANES) - least;
        let standing = Standing {
            positions: &self.positions,
            damping: self.damping,
            stretch: self.stretch,
            last_step: if self.is_polished() {
                &self.last_step
            } else {
                &[]
            },
            distance: self.distance,
        };
        let trials = standing.trials(problem, linearisation, 1 + others);
        let Some((boldest, others)) = trials.split_first() else {
            return Some(Step::nowhere());
        };
        let middle = (&boldest.positions[..], sides(problem, self.accuracy));
        let beside: Vec<Vec<f64>> = others.iter().map(|trial| trial.positions.clone()).collect();
        let around = Neighbourhood::along_axes(problem, middle, &beside, (self.accuracy, stop))?;
        self.evaluations += self.columns(problem) + others.len() as u64;
        let bold = Linearisation::of(&around).ok();
        let bold = bold.map(|bold| Step {
            trial: boldest.clone(),
            cost: bold.cost,
            linearisation: Some(bold),
        });
        let others = others.iter().enumerate().map(|(place, trial)| Step {
            trial: trial.clone(),
            cost: around.cost(place),
            linearisation: None,
        });
        let other = others.min_by(|a, b| a.cost.total_cmp(&b.cost));
        let gain = |step: &Step| linearisation.cost - step.cost;
        let share = if middle.1 == Sides::One { ENOUGH } else { 1.0 };
        let enough = other.as_ref().map(|other| share * gain(other).max(0.0));
        let best = bold.filter(|bold| enough.is_none_or(|enough| gain(bold) >= enough));
        Some(best.or(other).unwrap_or_else(Step::nowhere))
    }

    /// Takes a step, if it gains anything, and ends where that is not worth another.
    fn take(&mut self, step: Step, here: &Linearisation) {
        let (here, rows) = (here.cost, here.triangle.rows());
        let before = self.cost.map_or(here, |cost| cost.min(here));
        self.cost = Some(before);
        if step.cost.is_nan() || step.cost >= before {
            self.end = Some(DescentEnd::Converged);
            return;
        }
        let pairs = step.trial.positions.iter().zip(&self.positions);
        let distance = pairs
            .map(|(new, old)| (new - old).abs())
            .fold(0.0, f64::max);
        let (gain, shift) = smallest_progress(self.accuracy);
        let is_idle = (before - step.cost) * (rows as f64) < IDLE_GAIN * before;
        self.idle = if is_idle { self.idle + 1 } else { 0 };
        let is_done = self.is_polished() && rows > SHORT && self.idle >= IDLE_ITERATIONS;
        if is_done || before - step.cost < gain * before || distance < shift {
            self.end = Some(DescentEnd::Converged);
        } else if self.iterations >= most_iterations(self.accuracy, rows) {
            self.end = Some(DescentEnd::IterationLimit);
        }
        let pairs = step.trial.positions.iter().zip(&self.positions);
        self.last_step = pairs.map(|(new, old)| new - old).collect();
        self.positions = step.trial.positions;
        self.cost = Some(step.cost);
        self.damping = step.trial.damping;
        self.stretch = step.trial.stretch;
        self.is_counted = step.linearisation.is_some();
        self.linearisation = step.linearisation;
    }

    /// Where a descent can end without another simulation: in a minimum that is known, where the
    /// linear model leads there, or here, where it promises no gain that counts.
    fn predicted_end(
        &mut self,
        problem: &Problem,
        linearisation: &Linearisation,
        minima: &[Minimum],
    ) -> Option<(DescentEnd, Minimum)> {
        let outlook = linearisation.outlook(problem, &self.positions)?;
        let distance = linearisation.distance(&outlook.positions, &self.positions);
        if self.is_polished() {
            // What is left after the next step, if it shrinks as it did last.
            let before = self.distance.replace(distance);
            self.shrinkage = before.map_or(1.0, |before| distance / before);
            let gained = linearisation.cost * (1.0 - outlook.gain);
            let is_there = distance < NEAR
                && distance * self.shrinkage < polished(problem, linearisation.triangle.rows());
            let minimum = Minimum {
                positions: outlook.positions,
                cost: gained,
            };
            return is_there.then_some((DescentEnd::Converged, minimum));
        }
        if outlook.gain < smallest_progress(self.accuracy).0 {
            let here = Minimum {
                positions: self.positions.clone(),
                cost: linearisation.cost,
            };
            return Some((DescentEnd::Converged, here));
        }
        let leads_to = |minimum: &&Minimum| {
            linearisation.distance(&outlook.positions, &minimum.positions) < SAME_MINIMUM
        };
        let led_to = minima.iter().find(leads_to);
        led_to.map(|minimum| (DescentEnd::Merged, minimum.clone()))
    }

    /// The minimum that it has found, if it has converged.
    #[must_use]
    pub fn minimum(&self) -> Option<Minimum> {
        let cost = self.cost?;
        (self.end == Some(DescentEnd::Converged)).then(|| Minimum {
            positions: self.positions.clone(),
            cost,
        })
    }
}
