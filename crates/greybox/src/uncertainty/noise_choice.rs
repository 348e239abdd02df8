//! Which of several fitted noise models is taken.
//!
//! The Bayesian information criterion compares them, with two limits. A disturbance that would have left far
//! more in the free run than was left is no explanation, whatever its likelihood: errors of one step alone do
//! not show it. And where the likeliest model's innovations follow each other as closely as those of a model
//! that misses an effect, no likelihood can be relied on, and the free run stands with the hull of all.

use super::residuals::{self, ResidualReport};
use crate::estimation::noise_ladder::{self, FittedNoise};
use crate::estimation::problem::Problem;
use crate::estimation::process_noise::{NoiseNumber, ProcessNoise};
use crate::estimation::trajectory;
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
    /// Whether its disturbances would have left far more in the free run than was left.
    pub is_too_strong: bool,
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
        let made = noise_ladder::variances_made(problem, of_plant, &given(&fit), stop);
        let variances_made = made.unwrap_or_default()?;
        let is_too_strong = deviations.iter().enumerate().any(|(output, deviation)| {
            let made: f64 = variances_made.iter().map(|made| made[output]).sum();
            made > TOO_STRONG * deviation * deviation
        });
        Some(WeighedNoise {
            fit,
            variances_made,
            is_too_strong,
        })
    }

    /// Whether the innovations follow each other so closely that the model misses an effect. Answers nothing
    /// when `stop` was raised.
    pub fn misses_an_effect(&self, stop: &AtomicBool) -> Option<bool> {
        let problem = &self.fit.trial.problem;
        let Ok(expected) = trajectory::simulate(problem, &self.fit.positions, stop)? else {
            return Some(true);
        };
        let innovations = residuals::report(problem, &expected);
        Some(innovations.iter().any(ResidualReport::is_misfit_by_colour))
    }
}

/// The place of the noise model that is taken: the first is that without disturbances. Answers nothing when
/// `stop` was raised.
pub(super) fn chosen(weighed: &[Option<WeighedNoise>], stop: &AtomicBool) -> Option<usize> {
    let standing = weighed
        .iter()
        .enumerate()
        .filter_map(|(place, weighed)| Some((place, weighed.as_ref()?)));
    let standing = standing.filter(|(_, weighed)| !weighed.is_too_strong);
    let likeliest = standing.min_by(|(_, a), (_, b)| a.fit.bic.total_cmp(&b.fit.bic));
    match likeliest {
        Some((place, weighed)) if place > 0 && !weighed.misses_an_effect(stop)? => Some(place),
        _ => Some(0),
    }
}

/// The disturbances of a fit with the values of the estimate.
fn given(fit: &FittedNoise) -> Vec<ProcessNoise> {
    let mut values = fit.trial.problem.values(&fit.positions).into_iter();
    let n_plant = fit.positions.len() - fit.trial.noise.unknowns();
    values.by_ref().take(n_plant).for_each(drop);
    let mut estimate = |number: NoiseNumber| match number {
        NoiseNumber::Given(_) => number,
        NoiseNumber::Unknown { .. } => NoiseNumber::Given(values.next().unwrap_or_default()),
    };
    let mut disturbances = Vec::new();
    for noise in &fit.trial.noise.disturbances {
        let strength = estimate(noise.strength);
        let time_constant = noise.time_constant.map(&mut estimate);
        disturbances.push(ProcessNoise {
            strength,
            time_constant,
            ..noise.clone()
        });
    }
    disturbances
}
