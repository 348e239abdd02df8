//! Which of several fitted noise models is taken.
//!
//! The Bayesian information criterion compares them, with two limits. A disturbance that would have left far
//! more in the free run than was left is no explanation, whatever its likelihood: errors of one step alone do
//! not show it. And where the likeliest model's innovations follow each other as closely as those of a model
//! that misses an effect, another disturbance is tried beside its own; where none helps, no likelihood can be
//! relied on, and the free run stands with the hull of all.

use super::residuals;
use crate::estimation::noise_ladder::{self, FittedNoise};
use crate::estimation::problem::Problem;
use crate::estimation::trajectory;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A disturbance is too strong where the variance that it makes of an output is this many times what the free
/// run left: with two integrations a fitted start takes up nearly as much.
const TOO_STRONG: f64 = 100.0;

/// A fitted noise model with what its disturbances make.
#[derive(Debug)]
pub(super) struct WeighedNoise {
    pub fit: FittedNoise,
    /// For each disturbance the variance that it makes of each compared output `[SI²]`.
    pub variances_made: Vec<Vec<f64>>,
    /// Whether the disturbances of the model would have left far more in the free run than was left.
    pub is_too_strong: bool,
    /// The places of the compared outputs whose innovations follow each other so closely that the model misses
    /// an effect.
    pub coloured: Vec<usize>,
}

impl WeighedNoise {
    /// Weighs a fit against the root mean squares of each output's residuals in the free run. Answers nothing
    /// when `stop` was raised.
    pub fn of(
        problem: &Problem,
        deviations: &[f64],
        fit: FittedNoise,
        stop: &AtomicBool,
    ) -> Option<WeighedNoise> {
        let of_plant = &fit.positions[..problem.coordinates.len()];
        let disturbances = fit.estimated_noise().disturbances;
        let made = noise_ladder::variances_made(problem, of_plant, &disturbances, stop);
        let variances_made = made.unwrap_or_default()?;
        let is_too_strong = deviations.iter().enumerate().any(|(output, deviation)| {
            let made: f64 = variances_made.iter().map(|made| made[output]).sum();
            made > TOO_STRONG * deviation * deviation
        });
        let coloured = coloured(&fit, stop)?;
        Some(WeighedNoise {
            fit,
            variances_made,
            is_too_strong,
            coloured,
        })
    }

    /// Whether the innovations of an output follow each other so closely that the model misses an effect.
    pub fn misses_an_effect(&self) -> bool {
        !self.coloured.is_empty()
    }
}

/// The places of the compared outputs whose innovations follow each other closely: all of them where a fit
/// cannot be simulated. Answers nothing when `stop` was raised.
fn coloured(fit: &FittedNoise, stop: &AtomicBool) -> Option<Vec<usize>> {
    let problem = &fit.trial.problem;
    let Ok(expected) = trajectory::simulate(problem, &fit.positions, stop)? else {
        return Some((0..problem.outputs.len()).collect());
    };
    let innovations = residuals::report(problem, &expected);
    let coloured = innovations.iter().enumerate();
    let coloured = coloured.filter(|(_, output)| output.is_misfit_by_colour());
    Some(coloured.map(|(place, _)| place).collect())
}

/// The place of the likeliest noise model that is not too strong, with it.
pub(super) fn likeliest(weighed: &[Option<Arc<WeighedNoise>>]) -> Option<(usize, &WeighedNoise)> {
    let fitted = weighed.iter().enumerate();
    let fitted = fitted.filter_map(|(place, weighed)| Some((place, weighed.as_deref()?)));
    let standing = fitted.filter(|(_, weighed)| !weighed.is_too_strong);
    standing.min_by(|(_, a), (_, b)| a.fit.bic.total_cmp(&b.fit.bic))
}

/// The place of the noise model that is taken: the first is that without disturbances.
pub(super) fn chosen(weighed: &[Option<Arc<WeighedNoise>>]) -> usize {
    match likeliest(weighed) {
        Some((place, weighed)) if !weighed.misses_an_effect() => place,
        _ => 0,
    }
}
