//! What the draws of a posterior say of each unknown.

use super::chains::CHAINS;
use crate::estimation::problem::Problem;
use greybox_numerics::convergence::Convergence;
use greybox_numerics::statistics;
use rayon::prelude::*;

/// R̂ has to stay below this (A. Vehtari et al., *Bayesian Analysis* 16, 2021).
pub const LARGEST_R_HAT: f64 = 1.01;
/// The effective sample sizes have to exceed this.
pub const LEAST_ESS: f64 = 400.0;
/// The quantiles that are told.
pub const QUANTILES: [f64; 3] = [0.025, 0.5, 0.975];
/// Draws that are given out at the most.
const MOST_DRAWS: usize = 1000;

/// The draws from a posterior. Numbers are in the order of the coordinates.
#[derive(Clone, Debug, Default)]
pub struct Posterior {
    /// How many generations the chains moved.
    pub generations: u32,
    /// How many draws the figures are made from; 0 where the chains could not begin.
    pub draws: usize,
    /// What the draws say of each coordinate.
    pub coordinates: Vec<CoordinatePosterior>,
    /// Some of the draws, evenly: a value for each coordinate, SI.
    pub thinned: Vec<Vec<f64>>,
}

/// What the draws say of one coordinate.
#[derive(Clone, Debug)]
pub struct CoordinatePosterior {
    /// The mean of the values, SI.
    pub mean: f64,
    /// The standard deviation of the values, SI.
    pub standard_deviation: f64,
    /// The 2.5 %, 50 % and 97.5 % quantiles of the positions.
    quantiles: [f64; 3],
    /// The 2.5 %, 50 % and 97.5 % quantiles of the values, SI.
    pub quantile_values: [f64; 3],
    /// How well the chains have converged; none where all draws are one number.
    pub convergence: Option<Convergence>,
}

impl CoordinatePosterior {
    /// Whether the chains have converged by the thresholds of Vehtari et al.
    #[must_use]
    pub fn has_converged(&self) -> bool {
        self.convergence.is_some_and(has_converged)
    }
}

fn has_converged(convergence: Convergence) -> bool {
    let least = convergence.ess_bulk.min(convergence.ess_tail);
    convergence.r_hat < LARGEST_R_HAT && least > LEAST_ESS
}

/// The worst figures of several coordinates.
pub(super) struct WorstConvergence {
    pub convergence: Option<Convergence>,
    pub has_converged: bool,
}

impl WorstConvergence {
    /// Judges rows of positions, one row for each chain and then again from the first chain.
    pub fn of(rows: &[Vec<f64>]) -> WorstConvergence {
        let each: Option<Vec<Convergence>> = convergences(rows).into_iter().collect();
        let worst = |worse: Convergence, of: Convergence| Convergence {
            r_hat: worse.r_hat.max(of.r_hat),
            ess_bulk: worse.ess_bulk.min(of.ess_bulk),
            ess_tail: worse.ess_tail.min(of.ess_tail),
        };
        let convergence = each.and_then(|each| each.into_iter().reduce(worst));
        WorstConvergence {
            has_converged: convergence.is_some_and(has_converged),
            convergence,
        }
    }
}

/// How well the chains of each position have converged.
fn convergences(rows: &[Vec<f64>]) -> Vec<Option<Convergence>> {
    let n = rows.first().map_or(0, Vec::len);
    let of_position = |index: usize| {
        let chain = |chain: usize| {
            let rows = rows[chain..].iter().step_by(CHAINS);
            rows.map(|row| row[index]).collect()
        };
        let chains: Vec<Vec<f64>> = (0..CHAINS).map(chain).collect();
        Convergence::of(&chains)
    };
    (0..n).into_par_iter().map(of_position).collect()
}

impl Posterior {
    /// Describes rows of positions, one row for each chain and then again from the first chain.
    pub(super) fn of(problem: &Problem, generations: u32, rows: &[Vec<f64>]) -> Posterior {
        let pairs = problem.coordinates.iter().zip(convergences(rows));
        let described = pairs.enumerate().map(|(index, (coordinate, convergence))| {
            let positions: Vec<f64> = rows.iter().map(|row| row[index]).collect();
            let values = positions.iter().map(|position| coordinate.value(*position));
            let values: Vec<f64> = values.collect();
            let quantile = |share| statistics::quantile(&positions, share).unwrap_or(f64::NAN);
            let quantiles = QUANTILES.map(quantile);
            CoordinatePosterior {
                mean: statistics::mean(values.iter().copied()).unwrap_or(f64::NAN),
                standard_deviation: statistics::standard_deviation(&values).unwrap_or(f64::NAN),
                quantiles,
                quantile_values: quantiles.map(|quantile| coordinate.value(quantile)),
                convergence,
            }
        });
        // An odd step comes to every chain.
        let every = rows.len().div_ceil(MOST_DRAWS) | 1;
        Posterior {
            generations,
            draws: rows.len(),
            coordinates: described.collect(),
            thinned: rows
                .iter()
                .step_by(every)
                .map(|row| problem.values(row))
                .collect(),
        }
    }

    /// The ends of the 95 % interval of each coordinate, as positions.
    pub(in crate::uncertainty) fn ends(&self) -> impl Iterator<Item = (f64, f64)> {
        let coordinates = self.coordinates.iter();
        coordinates.map(|coordinate| (coordinate.quantiles[0], coordinate.quantiles[2]))
    }

    /// The posterior of the first coordinates alone.
    pub(in crate::uncertainty) fn of_first(mut self, n: usize) -> Posterior {
        self.coordinates.truncate(n);
        self.thinned.iter_mut().for_each(|row| row.truncate(n));
        self
    }
}
