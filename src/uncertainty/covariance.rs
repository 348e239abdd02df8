//! Standard errors and correlations from the sensitivities of the residuals.
//!
//! With J the derivatives of the residuals, each divided by its output's noise, the Fisher
//! information of independent noise gives `cov = (JᵀJ)⁻¹` (L. Ljung, *System Identification*,
//! 1999, ch. 9). Where the residuals are coloured that is too small: then
//! `cov = (JᵀJ)⁻¹·B·(JᵀJ)⁻¹` with `B = Σ_b G_b·G_bᵀ`, `G_b` the sum of `Jᵀr` over block b of the
//! record (the sandwich form; P. J. Huber 1967, with batch means for its middle). Several block
//! lengths are tried and the widest result is taken, never narrower than the Fisher one.
//!
//! The noise of an output is the declared one, or larger where the residuals are larger. Under
//! Huber's loss the score of a residual stands in the place of the residual (see `residuals`).

use super::residuals::ResidualReport;
use crate::estimation::problem::Problem;
use crate::estimation::sensitivity::{self, Neighbourhood};
use crate::numerics::least_squares::{Rows, Triangle};
use crate::numerics::singular_values::singular_values;
use crate::simulation::Failure;
use nalgebra::{DMatrix, DVector};

/// Numbers of blocks that the middle of the sandwich is made of. Few long blocks catch long
/// memories, many short ones are less noisy themselves.
const BLOCK_COUNTS: [usize; 3] = [24, 48, 96];
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

/// What the linearised residuals say.
#[derive(Clone, Debug)]
pub struct Linear {
    /// The covariance of the positions; none where the data do not fix all coordinates.
    pub covariance: Option<Covariance>,
    /// The triangle of the derivatives, each divided by its output's noise.
    pub factor: DMatrix<f64>,
    /// The condition number of the derivatives, each column scaled to the same length.
    pub condition: f64,
    /// For each coordinate and output the root mean square of ∂output/∂position, SI.
    pub slopes: Vec<Vec<f64>>,
    /// The mean square of the noise in the units of the residuals.
    pub mean_square_noise: f64,
}

impl Linear {
    /// The standard deviation of a coordinate, as a share of its search range.
    #[must_use]
    pub fn deviation(&self, coordinate: usize) -> Option<f64> {
        self.covariance.as_ref()?.deviation(coordinate)
    }
}

/// What makes a residual one of unit noise, for each output.
#[must_use]
pub fn weights(problem: &Problem, residuals: &[ResidualReport]) -> Vec<f64> {
    let pairs = problem.outputs.iter().zip(residuals);
    pairs
        .map(|(output, report)| output.residual_scale / report.noise_std)
        .collect()
}

/// Linearises the residuals at a candidate that was simulated with its neighbours.
///
/// # Errors
/// How the candidate or a neighbour failed.
pub fn linearise(
    problem: &Problem,
    around: &Neighbourhood<'_>,
    residuals: &[ResidualReport],
) -> Result<Linear, Failure> {
    let weights = weights(problem, residuals);
    let unknowns = around.n_columns();
    let mut gathered = Gathered::new(unknowns, problem.n_residuals());
    let mut slopes = Slopes::new(unknowns, problem.outputs.len());
    around.visit(|row| {
        let score = problem.loss.score(row.residual) / residuals[row.output].inlier_share;
        gathered.add(row.derivatives, score, weights[row.output]);
        slopes.add(&row);
    })?;
    let (triangle, sums) = gathered.finish();
    if !triangle.is_usable() {
        return Err(Failure::Diverged);
    }
    let factor = triangle.factor();
    let condition = condition(&factor);
    let enough = triangle.rows() >= unknowns && condition <= LARGEST_CONDITION;
    let coloured = residuals.iter().any(|report| report.white == Some(false));
    let squares = weights.iter().map(|weight| weight.powi(-2)).sum::<f64>();
    Ok(Linear {
        covariance: inverse(&factor)
            .filter(|_| enough)
            .map(|inverse| covariance(&inverse, coloured, &sums)),
        factor,
        condition,
        slopes: slopes.finish(problem),
        mean_square_noise: squares / weights.len() as f64,
    })
}

fn covariance(inverse: &DMatrix<f64>, coloured: bool, sums: &[Vec<DVector<f64>>]) -> Covariance {
    let fisher = inverse * inverse.transpose();
    let matrix = if coloured {
        let sandwiches = sums.iter().map(|sums| sandwich(&fisher, sums));
        sandwiches.fold(fisher.clone(), widest)
    } else {
        fisher
    };
    Covariance { matrix, coloured }
}

/// The condition number of the columns, each scaled to the same length; infinite where one is
/// without effect.
fn condition(factor: &DMatrix<f64>) -> f64 {
    let norms: Vec<f64> = factor.column_iter().map(|column| column.norm()).collect();
    if norms.iter().any(|norm| !(norm.is_finite() && *norm > 0.0)) {
        return f64::INFINITY;
    }
    let scaled = DMatrix::from_fn(factor.nrows(), factor.ncols(), |row, column| {
        factor[(row, column)] / norms[column]
    });
    singular_values(&scaled)
        .and_then(|found| Some(found.sizes.first()? / found.sizes.last()?))
        .unwrap_or(f64::INFINITY)
}

fn inverse(factor: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = factor.ncols();
    factor.solve_upper_triangular(&DMatrix::identity(n, n))
}

/// Root mean squares of the derivatives.
struct Slopes {
    squares: Vec<Vec<f64>>,
    counts: Vec<usize>,
}

impl Slopes {
    fn new(coordinates: usize, outputs: usize) -> Slopes {
        Slopes {
            squares: vec![vec![0.0; outputs]; coordinates],
            counts: vec![0; outputs],
        }
    }

    fn add(&mut self, row: &sensitivity::Row<'_>) {
        self.counts[row.output] += 1;
        for (squares, derivative) in self.squares.iter_mut().zip(row.derivatives) {
            squares[row.output] += derivative * derivative;
        }
    }

    fn finish(self, problem: &Problem) -> Vec<Vec<f64>> {
        let mean = |(output, square): (usize, f64)| {
            let mean = square / self.counts[output].max(1) as f64;
            mean.sqrt() * problem.outputs[output].residual_scale
        };
        let squares = self.squares.into_iter();
        squares
            .map(|squares| squares.into_iter().enumerate().map(mean).collect())
            .collect()
    }
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
    rows: Rows,
    seen: usize,
    total: usize,
    sums: Vec<Vec<DVector<f64>>>,
}

impl Gathered {
    fn new(columns: usize, total: usize) -> Gathered {
        let zeros = |count: &usize| vec![DVector::zeros(columns); *count];
        Gathered {
            rows: Rows::new(columns),
            seen: 0,
            total: total.max(1),
            sums: BLOCK_COUNTS.iter().map(zeros).collect(),
        }
    }

    fn add(&mut self, derivatives: &[f64], residual: f64, weight: f64) {
        let weighted = derivatives.iter().map(|derivative| derivative * weight);
        self.rows.add(weighted, residual * weight);
        for sums in &mut self.sums {
            let block = (self.seen * sums.len() / self.total).min(sums.len() - 1);
            for (sum, derivative) in sums[block].iter_mut().zip(derivatives) {
                *sum += derivative * residual * weight * weight;
            }
        }
        self.seen += 1;
    }

    fn finish(self) -> (Triangle, Vec<Vec<DVector<f64>>>) {
        (self.rows.finish(), self.sums)
    }
}
