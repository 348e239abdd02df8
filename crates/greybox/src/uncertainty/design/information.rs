//! The information that experiments carry, as triangles of their weighted derivatives: columns of
//! the unknowns, then those of the assumptions per standard deviation of their tolerances.

use crate::estimation::problem::Problem;
use crate::estimation::sensitivity::SensitivityError;
use crate::uncertainty::budget::Extended;
use crate::uncertainty::covariance::NO_EFFECT;
use greybox_numerics::least_squares::{RowGatherer, Triangle};
use greybox_simulation::Accuracy;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::sync::atomic::AtomicBool;

/// An unknown with a larger standard deviation than so many search ranges is not fixed: all that
/// is known of it is the weak prior that keeps the sums regular.
pub(super) const NOT_FIXED: f64 = 0.1 / NO_EFFECT;

/// What is known of one unknown, as standard deviations in SI.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// With everything that is assumed taken for right.
    pub noise: Option<f64>,
    /// With everything that is assumed known within its tolerance.
    pub total: Option<f64>,
}

/// The standard deviations that belong to the triangle of an information.
pub(super) fn deviations(factor: &DMatrix<f64>) -> Option<Vec<f64>> {
    let n = factor.ncols();
    let inverse = factor.solve_upper_triangular(&DMatrix::identity(n, n))?;
    let deviations: Vec<f64> = inverse.row_iter().map(|row| row.norm()).collect();
    deviations
        .iter()
        .all(|deviation| deviation.is_finite())
        .then_some(deviations)
}

/// The triangle of two sets of rows.
pub(super) fn sum(first: &Triangle, second: &Triangle) -> Triangle {
    let mut both = first.clone();
    both.push(&with_zero_right(&second.factor()));
    both
}

/// Rows with nothing on their right-hand sides.
pub(super) fn with_zero_right(factor: &DMatrix<f64>) -> DMatrix<f64> {
    factor.clone().insert_column(factor.ncols(), 0.0)
}

/// The triangle of all rows of a problem at a candidate: columns of the unknowns, then those of the
/// assumptions, each row times the weight of its output.
pub(super) fn triangle(
    problem: &Problem,
    positions: &[f64],
    weights: &[f64],
    stop: &AtomicBool,
) -> Result<Triangle, SensitivityError> {
    let mut rows = RowGatherer::new(positions.len() + problem.assumptions.len());
    visit(problem, positions, stop, |_, output, columns| {
        let weight = weights[output];
        rows.add(columns.iter().map(|column| column * weight), 0.0);
    })?;
    Ok(rows.finish())
}

/// Visits every row of a problem at a candidate with its sample and its output.
pub(super) fn visit(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
    mut visit: impl FnMut(usize, usize, &[f64]),
) -> Result<(), SensitivityError> {
    let extended = Extended::new(problem, positions, true);
    let around = extended.around(Accuracy::Full, stop);
    let around = around.ok_or(SensitivityError::Interrupted)?;
    let mut columns = Vec::new();
    around
        .neighbourhood
        .visit_along(positions.len(), |row| {
            columns.clear();
            columns.extend(around.columns(&extended, &row));
            visit(row.sample, row.output, &columns);
        })
        .map_err(SensitivityError::Failed)
}
