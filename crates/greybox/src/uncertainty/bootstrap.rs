//! Intervals from refits to resampled residuals.
//!
//! The simulation at the estimate plus residuals drawn from its own is a recording that might
//! have been; the estimate is fitted to it again, many times over (B. Efron, R. J. Tibshirani,
//! *An Introduction to the Bootstrap*, 1993, ch. 9 and 13). Residuals with a memory are drawn in
//! blocks, from a random place on and around the end (D. N. Politis, J. P. Romano, 1992), a few
//! times as long as the memory.

use std::borrow::Cow;
use std::sync::Arc;

use super::drawn_assumptions::DrawnAssumptions;
use super::refits::{Refit, RefitName, RefitSequence, RefitTask};
use super::residuals::{self, ResidualReport};
use super::simulated_estimate::SimulatedEstimate;
use crate::estimation::problem::Problem;
use greybox_numerics::rng::{self, Purpose};
use greybox_simulation::Accuracy;
use std::sync::atomic::AtomicBool;

/// A block is so many times as long as the memory of the residuals.
const BLOCK_MEMORIES: f64 = 4.0;
/// Blocks of a record at the least.
const FEWEST_BLOCKS: usize = 10;

/// What drawn recordings are made from.
#[derive(Debug)]
pub(super) struct Resampling {
    pub estimate: Arc<SimulatedEstimate>,
    /// Where the random numbers come from.
    pub seed: u64,
    /// The assumptions that are drawn along with the noise, where any are.
    pub assumptions: Option<DrawnAssumptions>,
}

/// The refit to one drawn recording.
#[derive(Debug)]
pub(super) struct DrawnFit {
    resampling: Arc<Resampling>,
    sample: u32,
    /// None before the refit has finished.
    refit: Option<Refit>,
}

impl RefitSequence for DrawnFit {
    fn next(&self) -> Option<RefitName> {
        let sample = self.sample;
        self.refit
            .is_none()
            .then(|| match self.resampling.assumptions {
                None => RefitName::Bootstrap { sample },
                Some(_) => RefitName::MonteCarlo { sample },
            })
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        let resampling = &self.resampling;
        let mut drawn = resampling.resampled(self.sample);
        if let Some(assumptions) = &resampling.assumptions {
            assumptions.draw(&mut drawn, resampling.seed, self.sample);
        }
        RefitTask {
            problem: Cow::Owned(drawn),
            start: resampling.estimate.report.positions.clone(),
            accuracy: Accuracy::Full,
        }
        .run(stop)
    }

    fn follow(&mut self, refit: &Refit, _stop: &AtomicBool) -> Option<()> {
        self.refit = Some(refit.clone());
        Some(())
    }
}

/// The positions of the refits that came to a cost; none where fewer than half of them did.
pub(super) fn fitted(refits: &[DrawnFit]) -> Option<Vec<&[f64]>> {
    let finished = refits.iter().filter_map(|drawn| drawn.refit.as_ref());
    let fitted = finished.filter(|refit| refit.cost.is_some());
    let fitted: Vec<&[f64]> = fitted.map(|refit| &refit.positions[..]).collect();
    (fitted.len() * 2 >= refits.len()).then_some(fitted)
}

/// The 2.5 % and 97.5 % points of each coordinate's position over the refits; none where fewer than
/// half of them could be fitted.
pub(super) fn intervals(refits: &[DrawnFit], coordinates: usize) -> Option<Vec<(f64, f64)>> {
    let fitted = fitted(refits)?;
    let of_coordinate = |index: usize| {
        let mut values: Vec<f64> = fitted.iter().map(|positions| positions[index]).collect();
        values.sort_by(f64::total_cmp);
        (quantile(&values, 0.025), quantile(&values, 0.975))
    };
    Some((0..coordinates).map(of_coordinate).collect())
}

impl Resampling {
    /// Lists the refits to so many drawn recordings.
    pub fn fits(self, samples: u32) -> Vec<DrawnFit> {
        let resampling = Arc::new(self);
        let fit = |sample| DrawnFit {
            resampling: Arc::clone(&resampling),
            sample,
            refit: None,
        };
        (0..samples).map(fit).collect()
    }

    /// A recording that might have been.
    fn resampled(&self, sample: u32) -> Problem {
        let SimulatedEstimate {
            problem,
            report,
            trajectories,
            residuals,
        } = &*self.estimate;
        let positions = &report.positions;
        let mut drawn = problem.clone();
        let mut rng = rng::stream(self.seed, u64::from(sample), Purpose::Bootstrap);
        // A prior is one more measurement, and might have come out otherwise.
        for (coordinate, position) in drawn.coordinates.iter_mut().zip(positions) {
            let value = coordinate.value(*position);
            if let Some(prior) = &mut coordinate.prior {
                prior.middle += prior.deviation * (prior.residual(value) + rng::normal(&mut rng));
            }
        }
        for joint in Arc::make_mut(&mut drawn.joint_priors) {
            let value = |parameter: &usize| problem.shared_value(*parameter, positions);
            let values: Vec<f64> = joint.parameters.iter().map(value).collect();
            let noise = values.iter().map(|_| rng::normal(&mut rng)).collect();
            joint.draw_about(&values, noise);
        }
        let experiments = Arc::make_mut(&mut drawn.experiments);
        let outputs = problem.outputs.iter().zip(residuals).enumerate();
        for (output, (measured, report)) in outputs {
            for (experiment, trajectory) in trajectories.iter().enumerate() {
                let series = residuals::series(problem, trajectory, experiment, output);
                let remains = Drawn::new(&series, report, positions.len());
                let recorded = &problem.experiments[experiment];
                let data = &mut experiments[experiment].measured[output];
                let simulated = &trajectory[measured.index];
                let weight = |sample| recorded.weight(output, sample);
                remains.put(&mut rng, data, simulated, weight);
            }
        }
        drawn
    }
}

/// The residuals that are drawn from.
struct Drawn {
    residuals: Vec<f64>,
    block: usize,
}

impl Drawn {
    /// Takes the residuals of a series that are not missing, about their mean, as large as the
    /// noise that they are the remains of.
    fn new(series: &[f64], report: &ResidualReport, unknowns: usize) -> Drawn {
        let mut residuals: Vec<f64> = series.iter().copied().filter(|r| !r.is_nan()).collect();
        let count = residuals.len().max(1) as f64;
        let mean = residuals.iter().sum::<f64>() / count;
        let growth = (count / (count - unknowns as f64).max(1.0)).sqrt();
        for residual in &mut residuals {
            *residual = (*residual - mean) * growth;
        }
        Drawn {
            block: block_length(residuals.len(), report),
            residuals,
        }
    }

    /// Puts what was simulated plus a drawn residual, as large as the noise of the sample, in place
    /// of what was measured in the part that is estimated from.
    fn put(
        &self,
        rng: &mut impl rng::Rng,
        data: &mut [f64],
        simulated: &[f64],
        weight: impl Fn(usize) -> f64,
    ) {
        let count = self.residuals.len();
        let (mut at, mut left) = (0, 0);
        let used = data.iter_mut().zip(simulated).enumerate();
        let used = used.filter(|(_, (y, _))| !y.is_nan());
        for (sample, (value, simulated)) in used.take(count) {
            if left == 0 {
                (at, left) = (rng::below(rng, count), self.block);
            }
            *value = simulated + self.residuals[at] / weight(sample);
            (at, left) = ((at + 1) % count, left - 1);
        }
    }
}

fn block_length(count: usize, report: &ResidualReport) -> usize {
    let coloured = report.white == Some(false);
    let memory = report
        .effective_samples
        .filter(|_| coloured)
        .map_or(0.0, |effective| count as f64 / effective);
    let longest = (count / FEWEST_BLOCKS).max(1);
    ((BLOCK_MEMORIES * memory).ceil() as usize).clamp(1, longest)
}

/// The point below which a share of the sorted values lies.
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, part) = (place.floor() as usize, place.fract());
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + part * (sorted[above] - sorted[below])
}
