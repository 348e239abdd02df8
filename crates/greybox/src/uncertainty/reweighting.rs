//! Outputs of unknown noise weighed by what is left of each.
//!
//! The likelihood of several outputs whose noise is not known is largest where each is weighed by
//! the mean square of its own residuals (Y. Bard, *Nonlinear Parameter Estimation*, 1974, ch. 4).
//! So the estimate is fitted again with these weights until they stand. One output alone needs
//! none of it, unless priors stand against its noise.

use crate::estimation::loss::Loss;
use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use crate::estimation::trajectory;
use greybox_simulation::Accuracy;
use std::sync::atomic::AtomicBool;

use super::refits::Refits;
use super::residuals;

/// Fits at the most.
const MOST_FITS: usize = 20;
/// Noise levels that change by less than this share stand.
const STANDS: f64 = 1e-4;
/// A residual is not taken for smaller than this share of what it was scaled with.
const SMALLEST: f64 = 1e-9;

/// The problem with the weights that its own residuals ask for, and the estimate with them; as
/// they are where nothing is to be weighed. Answers nothing when `stop` was raised or the refits
/// were cut.
#[must_use]
pub fn reweighted(
    problem: &Problem,
    report: &Report,
    (refits, stop): (&Refits, &AtomicBool),
) -> Option<(Problem, Report)> {
    let mut problem = problem.clone();
    let mut report = report.clone();
    if !is_needed(&problem) {
        return Some((problem, report));
    }
    for fit in 0..MOST_FITS {
        let Ok(trajectories) = trajectory::simulate(&problem, &report.positions, stop)? else {
            break;
        };
        let levels = residuals::report(&problem, &trajectories);
        let mut change: f64 = 0.0;
        for (output, level) in problem.outputs.iter_mut().zip(&levels) {
            if output.noise_std.is_none() {
                let level = level.noise_std.max(SMALLEST * output.residual_scale);
                change = change.max((level / output.residual_scale - 1.0).abs());
                output.residual_scale = level;
            }
        }
        if change < STANDS {
            break;
        }
        let (name, start) = (format!("reweighted/{fit}"), report.positions.clone());
        let refit = refits.descend(name, || (&problem, start), Accuracy::Full, stop)?;
        report.cost = refit.cost;
        report.values = problem.values(&refit.positions);
        report.positions = refit.positions;
    }
    Some((problem, report))
}

fn is_needed(problem: &Problem) -> bool {
    let has_unknown_noise = problem.outputs.iter().any(|own| own.noise_std.is_none());
    let has_own = problem.coordinates.iter().any(|own| own.prior.is_some());
    let has_priors = has_own || !problem.joint_priors.is_empty();
    let has_rivals = problem.outputs.len() > 1;
    has_unknown_noise && (has_priors || has_rivals) && problem.loss == Loss::Squared
}
