//! The steps that an iteration of a descent tries.

use super::linearisation::{Linearisation, SMALLEST_DAMPING};
use crate::estimation::feasible;
use crate::estimation::problem::Problem;

/// The dampings that are tried, relative to the last good one: the first always, of the others as
/// many as fill the lanes.
const DAMPING_FACTORS: [f64; 8] = [1e-4, 1.0, 1e2, 1e-2, 10.0, 1e-1, 1e4, 1e-3];
/// A smaller damping changes no step.
const NEGLIGIBLE_DAMPING: f64 = 1e-6;
/// Standard errors from the minimum within which steps are stretched: further off the way there is no straight one.
const STRETCHED_WITHIN: f64 = 3.0;
/// Shorter and longer steps that are tried in place of negligible dampings, relative to the last good one.
const STRETCHES: [f64; 8] = [1.0, 0.7, 1.4, 0.5, 2.0, 0.85, 1.2, 0.25];
/// Multiples of the last step that are tried in place of the dampings that come last: in a valley with rough ground only
/// short steps gain, one like the other, and together they are the way.
const MOMENTA: [f64; 2] = [3.0, 10.0];
/// Fewer standard errors from the minimum the linear model knows the way.
const MOMENTA_BEYOND: f64 = 0.1;

/// The candidates that the dampings lead to, with their dampings.
#[must_use]
pub fn trial_steps(
    problem: &Problem,
    linearisation: &Linearisation,
    positions: &[f64],
    dampings: impl IntoIterator<Item = f64>,
) -> Vec<(f64, Vec<f64>)> {
    let trial = |damping: f64| {
        let outlook = linearisation.moved(problem, positions, damping)?;
        Some((damping, outlook.positions))
    };
    dampings.into_iter().filter_map(trial).collect()
}

/// A step that is tried.
#[derive(Clone)]
pub(super) struct Trial {
    /// The damping of the step.
    pub(super) damping: f64,
    /// How much longer the step is than the linear model has it.
    pub(super) stretch: f64,
    /// Where the step leads.
    pub(super) positions: Vec<f64>,
}

/// Where a descent stands, and how it came there.
pub(super) struct Standing<'a> {
    /// Where the descent is.
    pub(super) positions: &'a [f64],
    /// The last good damping.
    pub(super) damping: f64,
    /// How much longer the last step was than the linear model had it.
    pub(super) stretch: f64,
    /// The last step; nothing before the first, and in a descent that is simulated coarsely.
    pub(super) last_step: &'a [f64],
    /// How far the linear model's minimum was away, in standard errors.
    pub(super) distance: Option<f64>,
}

impl Standing<'_> {
    /// The steps that are tried, the boldest first. Where dampings change nothing any more, shorter and longer steps
    /// are tried in their place: innovations that are not as the noise model has them have another curvature than
    /// the expected one, by a factor that the descent learns.
    pub(super) fn trials(
        &self,
        problem: &Problem,
        linearisation: &Linearisation,
        at_most: usize,
    ) -> Vec<Trial> {
        let is_undamped = self.damping < NEGLIGIBLE_DAMPING && problem.innovations.is_some();
        let is_curved = self
            .distance
            .is_none_or(|distance| distance > STRETCHED_WITHIN);
        if !is_undamped || is_curved {
            let factors = DAMPING_FACTORS.iter().take(at_most);
            let dampings = factors.map(|factor| (self.damping * factor).max(SMALLEST_DAMPING));
            let trials = trial_steps(problem, linearisation, self.positions, dampings);
            let undamped = trials.into_iter().map(|(damping, positions)| Trial {
                damping,
                stretch: 1.0,
                positions,
            });
            let mut trials: Vec<Trial> = undamped.collect();
            let onwards = self.onwards(problem);
            trials.truncate(at_most - onwards.len());
            trials.extend(onwards);
            return trials;
        }
        let Some(outlook) = linearisation.moved(problem, self.positions, self.damping) else {
            return Vec::new();
        };
        let stretches = STRETCHES.iter().take(at_most);
        let stretched = stretches.filter_map(|factor| {
            let stretch = factor * self.stretch;
            let pairs = self.positions.iter().zip(&outlook.positions);
            let moved = pairs.map(|(here, there)| here + stretch * (there - here));
            let moved = moved.map(|position| position.clamp(0.0, 1.0)).collect();
            Some(Trial {
                damping: self.damping,
                stretch,
                positions: feasible::nearest(problem, moved)?,
            })
        });
        stretched.collect()
    }

    /// Longer steps along the last one of a fine descent.
    fn onwards(&self, problem: &Problem) -> Vec<Trial> {
        let is_off = self
            .distance
            .is_some_and(|distance| distance > MOMENTA_BEYOND);
        if self.last_step.is_empty() || !is_off {
            return Vec::new();
        }
        let longer = MOMENTA.iter().filter_map(|factor| {
            let pairs = self.positions.iter().zip(self.last_step);
            let moved = pairs.map(|(here, step)| (here + factor * step).clamp(0.0, 1.0));
            Some(Trial {
                damping: self.damping,
                stretch: 1.0,
                positions: feasible::nearest(problem, moved.collect())?,
            })
        });
        longer.collect()
    }
}
