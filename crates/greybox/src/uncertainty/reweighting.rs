//! Outputs of unknown noise weighed by what is left of each.
//!
//! The likelihood of several outputs whose noise is not known is largest where each is weighed by
//! the mean square of its own residuals (Y. Bard, *Nonlinear Parameter Estimation*, 1974, ch. 4).
//! So the estimate is fitted again with these weights until they stand. One output alone needs
//! none of it, unless priors stand against its noise.

use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

use super::refits::{Refit, RefitName, RefitSequence, RefitTask};
use super::residuals;
use crate::estimation::loss::Loss;
use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use crate::estimation::trajectory;
use greybox_simulation::Accuracy;

/// Fits at the most.
const MOST_FITS: u32 = 20;
/// Noise levels that change by less than this share stand.
const STANDS: f64 = 1e-4;
/// A residual is not taken for smaller than this share of what it was scaled with.
const SMALLEST: f64 = 1e-9;

/// An estimate that is fitted again until the weights of its outputs stand.
#[derive(Clone, Debug)]
pub(super) struct Reweighting {
    /// The problem with the weights that the residuals at the estimate ask for.
    pub problem: Problem,
    /// The estimate with the weights before.
    pub report: Report,
    fits: u32,
    stands: bool,
}

impl Reweighting {
    /// Weighs the outputs by what an estimate leaves of each; as they are where nothing is to be
    /// weighed. Answers nothing when `stop` was raised.
    pub fn begin(problem: &Problem, report: &Report, stop: &AtomicBool) -> Option<Reweighting> {
        let reweighting = Reweighting {
            problem: problem.clone(),
            report: report.clone(),
            fits: 0,
            stands: !is_needed(problem),
        };
        reweighting.weighed(stop)
    }

    /// Weighs the outputs anew, unless their weights stand.
    fn weighed(mut self, stop: &AtomicBool) -> Option<Reweighting> {
        if self.stands || self.fits == MOST_FITS {
            self.stands = true;
            return Some(self);
        }
        let positions = &self.report.positions;
        let Ok(trajectories) = trajectory::simulate(&self.problem, positions, stop)? else {
            self.stands = true;
            return Some(self);
        };
        let levels = residuals::report(&self.problem, &trajectories);
        let mut change: f64 = 0.0;
        for (output, level) in self.problem.outputs.iter_mut().zip(&levels) {
            if output.noise_std.is_none() {
                let level = level.noise_std.max(SMALLEST * output.residual_scale);
                change = change.max((level / output.residual_scale - 1.0).abs());
                output.residual_scale = level;
            }
        }
        self.stands = change < STANDS;
        Some(self)
    }
}

impl RefitSequence for Reweighting {
    fn next(&self) -> Option<RefitName> {
        (!self.stands).then_some(RefitName::Reweighted { round: self.fits })
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        RefitTask {
            problem: Cow::Borrowed(&self.problem),
            start: self.report.positions.clone(),
            accuracy: Accuracy::Full,
        }
        .run(stop)
    }

    fn follow(&mut self, refit: &Refit, stop: &AtomicBool) -> Option<()> {
        let mut fitted = self.clone();
        fitted.report.cost = refit.cost;
        fitted.report.values = fitted.problem.values(&refit.positions);
        fitted.report.positions.clone_from(&refit.positions);
        fitted.fits += 1;
        *self = fitted.weighed(stop)?;
        Some(())
    }
}

/// Whether the weights of the outputs matter, and are not declared.
pub(super) fn is_needed(problem: &Problem) -> bool {
    let (outputs, coordinates) = (&problem.outputs, &problem.coordinates);
    let has_unknown_noise = outputs.iter().any(|output| output.noise_std.is_none());
    let has_single_priors = coordinates.iter().any(|unknown| unknown.prior.is_some());
    let has_priors = has_single_priors || !problem.joint_priors.is_empty();
    has_unknown_noise && (has_priors || outputs.len() > 1) && problem.loss == Loss::Squared
}
