//! Levenberg–Marquardt within the search box, from several good candidates.
//!
//! In positions (0 to 1 along each coordinate's scale) the scaled residuals are linearised
//! ([`super::sensitivity`]); the damped least-squares steps for eight dampings are simulated
//! together and the best of them is taken (K. Levenberg 1944, D. W. Marquardt 1963; the form
//! with a triangle instead of normal equations after J. J. Moré, "The Levenberg–Marquardt
//! algorithm", Lecture Notes in Mathematics 630, 1978). A coordinate that stands at a bound and
//! is drawn beyond it is held there for the step. A descent goes down coarsely simulated first;
//! the one that came lowest is then polished, simulated finely.

use super::objective::Objective;
use super::problem::Problem;
use super::sensitivity::{self, SensitivityError};
use crate::numerics::least_squares::{Rows, Triangle};
use crate::simulation::Accuracy;
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// Iterations at the most from one start.
pub const LARGEST_ITERATION_COUNT: u32 = 60;
/// A descent ends when an iteration gains less than this share of the cost, or moves no
/// coordinate by more than this share of its range. A coarse descent need not come closer to its
/// minimum than its simulation is to the truth.
fn smallest_progress(accuracy: Accuracy) -> (f64, f64) {
    match accuracy {
        Accuracy::Screening => (1e-5, 1e-6),
        Accuracy::Full => (1e-7, 1e-9),
    }
}
/// The dampings that are tried, relative to the last good one.
const DAMPING_FACTORS: [f64; 8] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 1e2, 1e4];
const FIRST_DAMPING: f64 = 1e-3;
const SMALLEST_DAMPING: f64 = 1e-14;

/// The residuals linearised at a candidate.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// The triangle of `[J | r]`.
    pub triangle: Triangle,
    /// The mean square of the residuals.
    pub cost: f64,
}

/// Linearises the residuals at a candidate.
///
/// # Errors
/// When the stop flag was raised, or a simulation failed.
pub fn linearise(
    problem: &Problem,
    positions: &[f64],
    accuracy: Accuracy,
    stop: &AtomicBool,
) -> Result<Linearisation, SensitivityError> {
    let mut rows = Rows::new(positions.len());
    let mut sum = 0.0;
    sensitivity::visit_rows(problem, positions, accuracy, stop, |row| {
        rows.add(row.derivatives.iter().copied(), row.residual);
        sum += row.residual * row.residual;
    })?;
    let triangle = rows.finish();
    let cost = sum / triangle.rows() as f64;
    Ok(Linearisation { triangle, cost })
}

/// The candidates that the dampings lead to, with their dampings.
#[must_use]
pub fn trial_steps(
    linearisation: &Linearisation,
    positions: &[f64],
    damping: f64,
) -> Vec<(f64, Vec<f64>)> {
    let gradient = linearisation.triangle.gradient();
    let free: Vec<bool> = positions
        .iter()
        .zip(gradient.iter())
        .map(|(z, slope)| !((*z <= 0.0 && *slope > 0.0) || (*z >= 1.0 && *slope < 0.0)))
        .collect();
    let trial = |factor: &f64| {
        let damping = (damping * factor).max(SMALLEST_DAMPING);
        let step = linearisation.triangle.damped_step(damping, &free)?;
        let moved = positions
            .iter()
            .zip(step.iter())
            .map(|(z, d)| (z + d).clamp(0.0, 1.0));
        Some((damping, moved.collect()))
    };
    DAMPING_FACTORS.iter().filter_map(trial).collect()
}

/// Why a descent ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DescentEnd {
    /// No step gains anything more.
    Converged,
    /// The iterations are used up.
    IterationLimit,
    /// The candidate or its neighbours cannot be simulated.
    Failed,
}

/// Descends from a start, simulated finely, to the end. Nothing when `stop` was raised.
#[must_use]
pub fn descend(problem: &Problem, start: Vec<f64>, stop: &AtomicBool) -> Option<Descent> {
    let objective = Objective::new(problem, usize::MAX);
    let mut descent = Descent::from(start);
    descent.polish();
    while descent.end.is_none() {
        if !descent.iterate(problem, &objective, stop) {
            return None;
        }
    }
    Some(descent)
}

/// One descent from one start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Descent {
    /// Where it started.
    pub start: Vec<f64>,
    /// The cost there; none where the start cannot be simulated, or before the first iteration.
    pub start_cost: Option<f64>,
    /// Where it is.
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
}

impl Descent {
    /// A descent that begins at a candidate.
    #[must_use]
    pub fn from(start: Vec<f64>) -> Descent {
        Descent {
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
        }
    }

    /// Whether it is simulated finely.
    #[must_use]
    pub fn is_polished(&self) -> bool {
        self.accuracy == Accuracy::Full
    }

    /// Lets it go on, simulated finely.
    pub fn polish(&mut self) {
        self.accuracy = Accuracy::Full;
        self.coarse_cost = self.cost.take();
        self.end = None;
    }

    /// One iteration. Answers false, with nothing changed, when `stop` was raised.
    pub fn iterate(&mut self, problem: &Problem, objective: &Objective, stop: &AtomicBool) -> bool {
        let linearisation = match linearise(problem, &self.positions, self.accuracy, stop) {
            Ok(linearisation) => linearisation,
            Err(SensitivityError::Interrupted) => return false,
            Err(SensitivityError::Failed(_)) => {
                self.end = Some(DescentEnd::Failed);
                return true;
            }
        };
        let trials = trial_steps(&linearisation, &self.positions, self.damping);
        let candidates: Vec<Vec<f64>> = trials.iter().map(|(_, moved)| moved.clone()).collect();
        let Some(evaluations) = objective.evaluate(problem, &candidates, self.accuracy, stop)
        else {
            return false;
        };
        self.iterations += 1;
        self.evaluations += (1 + 2 * self.positions.len() + candidates.len()) as u64;
        self.start_cost.get_or_insert(linearisation.cost);
        let before = self
            .cost
            .map_or(linearisation.cost, |cost| cost.min(linearisation.cost));
        self.cost = Some(before);
        let best = evaluations
            .iter()
            .zip(trials)
            .min_by(|(a, _), (b, _)| a.cost.total_cmp(&b.cost))
            .filter(|(evaluation, _)| evaluation.cost < before);
        let Some((evaluation, (damping, moved))) = best else {
            self.end = Some(DescentEnd::Converged);
            return true;
        };
        let distance = moved
            .iter()
            .zip(&self.positions)
            .map(|(new, old)| (new - old).abs())
            .fold(0.0, f64::max);
        self.positions = moved;
        self.cost = Some(evaluation.cost);
        self.damping = damping;
        let (gain, shift) = smallest_progress(self.accuracy);
        if before - evaluation.cost < gain * before || distance < shift {
            self.end = Some(DescentEnd::Converged);
        } else if self.iterations >= LARGEST_ITERATION_COUNT {
            self.end = Some(DescentEnd::IterationLimit);
        }
        true
    }
}
