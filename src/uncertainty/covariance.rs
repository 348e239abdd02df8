//! Standard errors and correlations from the sensitivities of the residuals.
//!
//! With J the derivatives of the residuals, each divided by its output's noise, the Fisher
//! information of independent noise gives `cov = (JᵀJ)⁻¹` (L. Ljung, *System Identification*,
//! 1999, ch. 9). Where the residuals are coloured that is too small: then
//! `cov = (JᵀJ)⁻¹·B·(JᵀJ)⁻¹` with `B = Σ_b G_b·G_bᵀ`, `G_b` the sum of `Jᵀr` over block b of the
//! record (the sandwich form; P. J. Huber 1967, with batch means for its middle). Several block
//! lengths are tried and the widest result is taken, never narrower than the Fisher one.
//!
//! The noise of an output is the declared one, or larger where the residuals are larger.

use super::residuals::ResidualReport;
use crate::estimation::problem::Problem;
use crate::estimation::sensitivity::{self, SensitivityError};
use crate::numerics::least_squares::Triangle;
use crate::simulation::Accuracy;
use nalgebra::{DMatrix, DVector};
use std::sync::atomic::AtomicBool;

/// Numbers of blocks that the middle of the sandwich is made of. Few long blocks catch long
/// memories, many short ones are less noisy themselves.
const BLOCK_COUNTS: [usize; 3] = [24, 48, 96];
/// Rows that are gathered before they go into the triangle.
const ROWS: usize = 1024;
/// Beyond this condition number of the column-scaled sensitivities a combination of unknowns is
/// not fixed by the data.
const LARGEST_CONDITION: f64 = 1e8;

/// The covariance of the positions.
#[derive(Clone, Debug)]
pub struct Covariance {
    matrix: DMatrix<f64>,
    coloured: bool,
}

impl Covariance {
    /// The standard deviation of a coordinate, as a share of its search range.
    #[must_use]
    pub fn deviation(&self, coordinate: usize) -> Option<f64> {
        let variance = self.matrix[(coordinate, coordinate)];
        (variance.is_finite() && variance >= 0.0).then(|| variance.sqrt())
    }

    /// The correlations of the coordinates.
    #[must_use]
    pub fn correlation(&self) -> Vec<Vec<f64>> {
        let n = self.matrix.nrows();
        let deviation = |index: usize| self.matrix[(index, index)].sqrt();
        let entry = |row: usize, column: usize| {
            if row == column {
                return 1.0;
            }
            let ratio = self.matrix[(row, column)] / (deviation(row) * deviation(column));
            ratio.clamp(-1.0, 1.0)
        };
        (0..n)
            .map(|row| (0..n).map(|column| entry(row, column)).collect())
            .collect()
    }

    /// How it was made: `fisher`, or `fisher_coloured` where it was widened for the colour of the
    /// residuals.
    #[must_use]
    pub fn method(&self) -> &'static str {
        if self.coloured {
            "fisher_coloured"
        } else {
            "fisher"
        }
    }
}

/// Estimates the covariance at a candidate; none where the data do not fix all coordinates.
///
/// # Errors
/// When the stop flag was raised, or a simulation failed.
pub fn estimate(
    problem: &Problem,
    positions: &[f64],
    residuals: &[ResidualReport],
    stop: &AtomicBool,
) -> Result<Option<Covariance>, SensitivityError> {
    let noise: Vec<f64> = problem
        .outputs
        .iter()
        .zip(residuals)
        .map(|(output, report)| report.noise_std / output.residual_scale)
        .collect();
    let mut gathered = Gathered::new(positions.len(), problem.n_residuals());
    sensitivity::visit_rows(problem, positions, Accuracy::Full, stop, |row| {
        gathered.add(row.derivatives, row.residual, 1.0 / noise[row.output]);
    })?;
    let Some((triangle, sums)) = gathered.finish() else {
        return Ok(None);
    };
    let Some(inverse) = inverse_factor(&triangle) else {
        return Ok(None);
    };
    let fisher = &inverse * inverse.transpose();
    let coloured = residuals.iter().any(|report| report.white == Some(false));
    if !coloured {
        return Ok(Some(Covariance {
            matrix: fisher,
            coloured,
        }));
    }
    let matrix = sums
        .iter()
        .map(|sums| sandwich(&fisher, sums))
        .fold(fisher.clone(), widest);
    Ok(Some(Covariance { matrix, coloured }))
}

/// The inverse of the triangle of J; none where J is numerically singular.
fn inverse_factor(triangle: &Triangle) -> Option<DMatrix<f64>> {
    let factor = triangle.factor();
    let norms: Vec<f64> = factor.column_iter().map(|column| column.norm()).collect();
    if norms.iter().any(|norm| !(norm.is_finite() && *norm > 0.0)) {
        return None;
    }
    let scaled = DMatrix::from_fn(factor.nrows(), factor.ncols(), |row, column| {
        factor[(row, column)] / norms[column]
    });
    let singular = scaled.singular_values();
    if singular.max() > LARGEST_CONDITION * singular.min() {
        return None;
    }
    let n = factor.ncols();
    factor.solve_upper_triangular(&DMatrix::identity(n, n))
}

fn sandwich(fisher: &DMatrix<f64>, sums: &[DVector<f64>]) -> DMatrix<f64> {
    let n = fisher.nrows();
    let mut middle = DMatrix::zeros(n, n);
    for sum in sums {
        middle += sum * sum.transpose();
    }
    fisher * middle * fisher
}

/// The covariance with the larger variances: the second scaled up where the first is wider.
fn widest(first: DMatrix<f64>, second: DMatrix<f64>) -> DMatrix<f64> {
    let n = first.nrows();
    let ratio = |index: usize| {
        let (a, b) = (first[(index, index)], second[(index, index)]);
        if b > 0.0 {
            (a / b).max(1.0).sqrt()
        } else {
            1.0
        }
    };
    let grown = |row: usize, column: usize| second[(row, column)] * ratio(row) * ratio(column);
    DMatrix::from_fn(n, n, |row, column| {
        if row == column {
            first[(row, row)].max(second[(row, row)])
        } else {
            grown(row, column)
        }
    })
}

/// The rows on their way into a triangle and into block sums.
struct Gathered {
    triangle: Triangle,
    rows: Vec<f64>,
    columns: usize,
    seen: usize,
    total: usize,
    sums: Vec<Vec<DVector<f64>>>,
}

impl Gathered {
    fn new(columns: usize, total: usize) -> Gathered {
        let zeros = |count: &usize| vec![DVector::zeros(columns); *count];
        Gathered {
            triangle: Triangle::new(columns),
            rows: Vec::with_capacity(ROWS * (columns + 1)),
            columns,
            seen: 0,
            total: total.max(1),
            sums: BLOCK_COUNTS.iter().map(zeros).collect(),
        }
    }

    fn add(&mut self, derivatives: &[f64], residual: f64, weight: f64) {
        self.rows
            .extend(derivatives.iter().map(|derivative| derivative * weight));
        self.rows.push(residual * weight);
        for sums in &mut self.sums {
            let block = (self.seen * sums.len() / self.total).min(sums.len() - 1);
            for (sum, derivative) in sums[block].iter_mut().zip(derivatives) {
                *sum += derivative * residual * weight * weight;
            }
        }
        self.seen += 1;
        if self.rows.len() == ROWS * (self.columns + 1) {
            self.flush();
        }
    }

    fn flush(&mut self) {
        let rows = self.rows.len() / (self.columns + 1);
        if rows > 0 {
            self.triangle
                .push(&DMatrix::from_row_slice(rows, self.columns + 1, &self.rows));
            self.rows.clear();
        }
    }

    fn finish(mut self) -> Option<(Triangle, Vec<Vec<DVector<f64>>>)> {
        self.flush();
        (self.triangle.rows() >= self.columns).then_some((self.triangle, self.sums))
    }
}
