//! Intervals from refits to resampled residuals.
//!
//! The simulation at the estimate plus residuals drawn from its own is a recording that might
//! have been; the estimate is fitted to it again, many times over (B. Efron, R. J. Tibshirani,
//! *An Introduction to the Bootstrap*, 1993, ch. 9 and 13). Residuals with a memory are drawn in
//! blocks, from a random place on and around the end (D. N. Politis, J. P. Romano, 1992), a few
//! times as long as the memory.

use std::sync::Arc;

use super::refits::Refits;
use super::residuals::{self, ResidualReport};
use crate::estimation::problem::Problem;
use greybox_numerics::rng::{self, Purpose};
use greybox_simulation::Accuracy;
use greybox_simulation::single::Outputs;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// A block is so many times as long as the memory of the residuals.
const BLOCK_MEMORIES: f64 = 4.0;
/// Blocks of a record at the least.
const FEWEST_BLOCKS: usize = 10;

/// What the refits are made from.
#[derive(Clone, Copy, Debug)]
pub struct Bootstrap<'a> {
    /// The problem.
    pub problem: &'a Problem,
    /// The estimate.
    pub positions: &'a [f64],
    /// The simulation there.
    pub trajectories: &'a [Outputs],
    /// What its residuals look like.
    pub residuals: &'a [ResidualReport],
    /// How many refits.
    pub samples: u32,
    /// Where the random numbers come from.
    pub seed: u64,
}

impl Bootstrap<'_> {
    /// The 2.5 % and 97.5 % points of each coordinate's position over the refits; none where
    /// fewer than half of them could be fitted, nothing at all when `stop` was raised or the
    /// refits were cut.
    #[must_use]
    pub fn intervals(&self, refits: &Refits, stop: &AtomicBool) -> Option<Option<Vec<(f64, f64)>>> {
        let fitted: Vec<Option<Vec<f64>>> = (0..self.samples)
            .into_par_iter()
            .map(|sample| {
                let resampled = || (self.resampled(sample), self.positions.to_vec());
                let name = format!("bootstrap/{sample}");
                let refit = refits.descend(name, resampled, Accuracy::Full, stop)?;
                Some(refit.cost.map(|_| refit.positions))
            })
            .collect::<Option<_>>()?;
        let fitted: Vec<Vec<f64>> = fitted.into_iter().flatten().collect();
        if fitted.len() * 2 < self.samples as usize {
            return Some(None);
        }
        let of_coordinate = |index: usize| {
            let mut values: Vec<f64> = fitted.iter().map(|positions| positions[index]).collect();
            values.sort_by(f64::total_cmp);
            (quantile(&values, 0.025), quantile(&values, 0.975))
        };
        Some(Some((0..self.positions.len()).map(of_coordinate).collect()))
    }

    /// A recording that might have been.
    pub(super) fn resampled(&self, sample: u32) -> Problem {
        let mut problem = self.problem.clone();
        let mut rng = rng::stream(self.seed, u64::from(sample), Purpose::Bootstrap);
        // A prior is one more measurement, and might have come out otherwise.
        let own = problem.coordinates.iter_mut().zip(self.positions);
        for (coordinate, position) in own {
            let value = coordinate.value(*position);
            if let Some(prior) = &mut coordinate.prior {
                prior.middle += prior.deviation * (prior.residual(value) + rng::normal(&mut rng));
            }
        }
        for joint in Arc::make_mut(&mut problem.joint_priors) {
            let value = |parameter: &usize| self.problem.shared_value(*parameter, self.positions);
            let values: Vec<f64> = joint.parameters.iter().map(value).collect();
            let noise = values.iter().map(|_| rng::normal(&mut rng)).collect();
            joint.draw_about(&values, noise);
        }
        let experiments = Arc::make_mut(&mut problem.experiments);
        let outputs = self.problem.outputs.iter().zip(self.residuals).enumerate();
        for (output, (measured, report)) in outputs {
            for (experiment, trajectory) in self.trajectories.iter().enumerate() {
                let series = residuals::series(self.problem, trajectory, experiment, output);
                let drawn = Drawn::new(&series, report, self.positions.len());
                let own = &self.problem.experiments[experiment];
                let data = &mut experiments[experiment].measured[output];
                let simulated = &trajectory[measured.index];
                let weight = |sample| own.weight(output, sample);
                drawn.put(&mut rng, data, simulated, weight);
            }
        }
        problem
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
