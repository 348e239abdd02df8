//! The draws from a posterior in the result document.

use crate::estimation::problem::Problem;
use crate::identification::outcome::{PosteriorDraws, PosteriorQuantile, PosteriorReport};
use crate::uncertainty::posterior::{CHAINS, Posterior, QUANTILES};

/// What the draws say of a coordinate; none where the chains could not begin.
pub(super) fn report(posterior: &Posterior, coordinate: usize) -> Option<PosteriorReport> {
    let described = posterior.coordinates.get(coordinate)?;
    let quantiles = QUANTILES.iter().zip(described.quantile_values);
    let convergence = described.convergence;
    Some(PosteriorReport {
        chains: CHAINS as u32,
        draws: posterior.draws as u64,
        mean: described.mean,
        standard_deviation: described.standard_deviation,
        quantiles: quantiles
            .map(|(&probability, value)| PosteriorQuantile { probability, value })
            .collect(),
        r_hat: convergence.map(|convergence| convergence.r_hat),
        ess_bulk: convergence.map(|convergence| convergence.ess_bulk),
        ess_tail: convergence.map(|convergence| convergence.ess_tail),
    })
}

/// The draws themselves; none where the chains could not begin.
pub(super) fn draws(problem: &Problem, posterior: &Posterior) -> Option<PosteriorDraws> {
    let coordinates = problem.coordinates.iter();
    (posterior.draws > 0).then(|| PosteriorDraws {
        generations: posterior.generations,
        names: coordinates
            .clone()
            .map(|coordinate| coordinate.name.clone())
            .collect(),
        units: coordinates
            .map(|coordinate| coordinate.unit.clone())
            .collect(),
        rows: posterior.thinned.clone(),
    })
}
