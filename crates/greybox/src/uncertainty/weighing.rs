//! The linearised residuals twice: weighed as in the estimate, and white.
//!
//! What the estimate is moved by follows from its own weights; what the residuals say beyond chance
//! follows from rows of independent unit noise, for which residuals with a memory are filtered
//! first ([`super::whitening`]).

use super::covariance::{Linear, NoiseLevels};
use super::residuals::{self, ResidualReport};
use super::whitening::{Filter, Whitening};
use crate::estimation::problem::Problem;
use crate::estimation::sensitivity::{Neighbourhood, Row};
use greybox_numerics::least_squares::{RowGatherer, Triangle};
use greybox_simulation::SimulationFailure;
use greybox_simulation::single::Outputs;

/// What the residuals look like, where there are some.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The simulation at the estimate.
    pub trajectories: &'a [Outputs],
    /// What the residuals of each output at the estimate look like.
    pub residuals: &'a [ResidualReport],
    /// What follows for noise alone.
    pub linear: &'a Linear,
}

/// How residuals are weighed.
#[derive(Debug)]
pub(super) struct Weighing {
    /// The weight of each output's residuals in the estimate.
    plain: Vec<f64>,
    /// The weight of the priors' residuals in the estimate.
    prior: f64,
    /// The weight of each output's residuals by its noise.
    white: Vec<f64>,
    /// What makes an output's residuals white, where they are not.
    filters: Vec<Option<Filter>>,
}

impl Weighing {
    /// Weighs the residuals of an estimate.
    pub fn of(problem: &Problem, seen: Seen<'_>) -> Weighing {
        let levels = NoiseLevels::of(problem, seen.residuals);
        let white = levels.weights();
        Weighing {
            plain: vec![levels.weight; white.len()],
            prior: levels.weight,
            filters: filters(problem, seen, &white),
            white,
        }
    }

    /// Weighs residuals that are noise alone, which these weights make noise of unit size.
    pub fn of_noise_alone(weights: &[f64]) -> Weighing {
        Weighing {
            plain: weights.to_vec(),
            white: weights.to_vec(),
            prior: 1.0,
            filters: vec![None; weights.len()],
        }
    }

    /// The weighing with residuals that are taken for white, whatever their memory.
    pub fn unfiltered(mut self) -> Weighing {
        self.filters.iter_mut().for_each(|filter| *filter = None);
        self
    }

    /// Whether the estimate's own rows are white ones.
    fn is_white(&self, has_priors: bool) -> bool {
        self.filters.iter().all(Option::is_none)
            && self.plain == self.white
            && (!has_priors || self.prior == 1.0)
    }

    /// The triangles of the rows, weighed as in the estimate and white. `columns` makes the `n`
    /// derivatives of a row, of which those by the `unknowns` stand first; priors are residuals of
    /// these.
    ///
    /// # Errors
    /// How the candidate or a neighbour along an unknown failed.
    pub fn triangles(
        mut self,
        neighbourhood: &Neighbourhood<'_>,
        unknowns: usize,
        n: usize,
        columns: impl Fn(&Row<'_>) -> Vec<f64>,
    ) -> Result<(Triangle, Triangle), SimulationFailure> {
        let loss = neighbourhood.loss();
        let is_white = self.is_white(!neighbourhood.prior_rows().is_empty());
        let (mut plain, mut white) = (RowGatherer::new(n), RowGatherer::new(n));
        neighbourhood.visit_along(unknowns, |row: Row<'_>| {
            let mut values = columns(&row);
            values.push(loss.score(row.residual));
            let weight = self.plain[row.output];
            let (columns, residual) = (&values[..n], values[n]);
            plain.add(
                columns.iter().map(|value| value * weight),
                residual * weight,
            );
            if is_white {
                return;
            }
            let weight = self.white[row.output];
            values.iter_mut().for_each(|value| *value *= weight);
            let filtered = match &mut self.filters[row.output] {
                Some(filter) if !row.is_variance => filter.take(row.experiment, row.sample, values),
                _ => Some(values),
            };
            if let Some(mut filtered) = filtered {
                let residual = filtered.pop().unwrap_or_default();
                white.add(filtered, residual);
            }
        })?;
        for prior in neighbourhood.prior_rows() {
            let slopes = || (0..n).map(|column| prior.slope(column));
            plain.add(
                slopes().map(|slope| slope * self.prior),
                prior.residual * self.prior,
            );
            white.add(slopes(), prior.residual);
        }
        let plain = plain.finish();
        let white = match is_white {
            true => plain.clone(),
            false => white.finish(),
        };
        Ok((plain, white))
    }
}

/// For each output the filter that its residuals need.
fn filters(problem: &Problem, seen: Seen<'_>, weights: &[f64]) -> Vec<Option<Filter>> {
    let reports = seen.residuals.iter().zip(&problem.outputs).enumerate();
    reports
        .map(|(output, (report, measured))| {
            if report.white != Some(false) {
                return None;
            }
            let weighted = |experiment: usize| -> Vec<f64> {
                let trajectory = &seen.trajectories[experiment];
                let series = residuals::series(problem, trajectory, experiment, output);
                // An innovation is in units of its standard deviation.
                let unit = match problem.innovations {
                    Some(_) => 1.0,
                    None => measured.residual_scale,
                };
                let scale = weights[output] / unit;
                series.iter().map(|residual| residual * scale).collect()
            };
            let series: Vec<Vec<f64>> = (0..problem.experiments.len()).map(weighted).collect();
            Whitening::of(&series).map(Filter::new)
        })
        .collect()
}
