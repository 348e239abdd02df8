//! The residuals linearised at a candidate, and what the linear model promises.

use crate::estimation::feasible::{self, Limit};
use crate::estimation::problem::{Coordinate, Problem};
use crate::estimation::sensitivity::{Neighbourhood, SensitivityError, Sides};
use greybox_numerics::least_squares::{RowGatherer, Triangle};
use greybox_simulation::{Accuracy, SimulationFailure};
use std::sync::atomic::AtomicBool;

/// Residuals of a record that costs next to nothing to go on with.
pub(super) const SHORT: usize = 1000;

/// Where a descent differentiates. Differences to one side brought 200 descents to the floor of
/// recording A within 2e-6 of its chi-square (`benches/README.md`); a short record affords both.
pub(super) fn sides(problem: &Problem, accuracy: Accuracy) -> Sides {
    match accuracy {
        Accuracy::Full if problem.n_residuals() <= SHORT => Sides::Both,
        _ => Sides::One,
    }
}

/// The smallest damping of a step.
pub(super) const SMALLEST_DAMPING: f64 = 1e-14;

/// A step does not make a variance smaller than this share of what it was.
const SMALLEST_VARIANCE: f64 = 1e-3;

/// The residuals linearised at a candidate.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// The triangle of `[J | r]`.
    pub triangle: Triangle,
    /// The mean square of the residuals, those of the priors among them; where innovations are
    /// compared −2·log L but for a constant, per row.
    pub cost: f64,
    /// What the variance of a residual is taken for: the cost, or 1 where innovations are compared,
    /// which have their variances.
    pub residual_variance: f64,
    /// The constraints.
    pub limits: Vec<Limit>,
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
    let middle = (positions, sides(problem, accuracy));
    Neighbourhood::along_axes(problem, middle, &[], (accuracy, stop))
        .ok_or(SensitivityError::Interrupted)
        .and_then(|around| Linearisation::of(&around).map_err(SensitivityError::Failed))
}

impl Linearisation {
    pub(super) fn of(around: &Neighbourhood<'_>) -> Result<Linearisation, SimulationFailure> {
        let mut rows = RowGatherer::new(around.n_columns());
        let mut sum = 0.0;
        let loss = around.loss();
        around.visit(|row| {
            let (residual, slope) = (loss.bent(row.residual), loss.slope(row.residual));
            rows.add(row.derivatives.iter().map(|d| d * slope), residual);
            sum += residual * residual;
        })?;
        for prior in around.prior_rows() {
            let row = (0..around.n_columns()).map(|column| prior.slope(column));
            rows.add(row, prior.residual);
            sum += prior.residual * prior.residual;
        }
        let triangle = rows.finish();
        let likelihood = around.likelihood_cost();
        let cost = likelihood.unwrap_or(sum / triangle.rows() as f64);
        if !cost.is_finite() || !triangle.is_usable() {
            return Err(SimulationFailure::Diverged);
        }
        let limits = around.limits();
        Ok(Linearisation {
            triangle,
            cost,
            residual_variance: likelihood.map_or(cost, |_| 1.0),
            limits,
        })
    }

    /// Where a damped step leads, which breaks no constraint, and what the linear model promises of
    /// it. None where there is none.
    pub(super) fn moved(
        &self,
        problem: &Problem,
        positions: &[f64],
        damping: f64,
    ) -> Option<Outlook> {
        let step = if self.limits.is_empty() {
            let free = feasible::movable(&self.triangle, positions);
            self.triangle.damped_step(damping, &free)?
        } else {
            let inequalities = feasible::inequalities(&self.limits, positions);
            self.triangle.damped_step_within(damping, &inequalities)?
        };
        let mut along: Vec<f64> = step.iter().copied().collect();
        bend(problem, &mut along);
        let pairs = positions.iter().zip(along);
        let moved = pairs.map(|(z, d)| (z + d).clamp(0.0, 1.0)).collect();
        let sum = self.cost * self.triangle.rows() as f64;
        Some(Outlook {
            // Constraints that are not linear are broken a little.
            positions: feasible::nearest(problem, moved)?,
            gain: self.triangle.reduction(&step) / sum,
        })
    }

    /// Where the linear model has its minimum, and how much of the cost, as a share, is gained
    /// there. Nothing where the data do not fix it.
    #[must_use]
    pub fn outlook(&self, problem: &Problem, positions: &[f64]) -> Option<Outlook> {
        self.moved(problem, positions, SMALLEST_DAMPING)
    }

    /// How far two candidates are apart, in standard errors.
    pub fn distance(&self, from: &[f64], to: &[f64]) -> f64 {
        let step: Vec<f64> = from.iter().zip(to).map(|(a, b)| a - b).collect();
        (self.triangle.movement(&step) / self.residual_variance).sqrt()
    }
}

/// Bends steps to smaller noises as the likelihood of a variance bends. A standard deviation that is e^d times the
/// likeliest one linearises to a step of (e^(−2d) − 1)/2 of its logarithm, no longer than 1/2 however far it has to
/// go; half the logarithm of 1 plus twice that step is −d.
fn bend(problem: &Problem, step: &mut [f64]) {
    let innovations = problem.innovations.iter();
    for &place in innovations.flat_map(|innovations| &innovations.sizes) {
        let Coordinate { lower, upper, .. } = problem.coordinates[place];
        if step[place] < 0.0 {
            let range = libm::log(upper / lower);
            let variance = (1.0 + 2.0 * range * step[place]).max(SMALLEST_VARIANCE);
            step[place] = 0.5 * libm::log(variance) / range;
        }
    }
}

/// What the linear model promises of a step.
#[derive(Clone, Debug)]
pub struct Outlook {
    /// The positions that the step leads to.
    pub positions: Vec<f64>,
    /// The share of the cost that is gained there.
    pub gain: f64,
}
