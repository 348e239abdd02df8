//! Standard errors and correlations from the sensitivities of the residuals.
//!
//! With J the derivatives of the residuals, each divided by its output's noise, the Fisher
//! information of independent noise gives `cov = (JᵀJ)⁻¹` (L. Ljung, *System Identification*,
//! 1999, ch. 9). Where the residuals are coloured that is too small: then
//! `cov = (JᵀJ)⁻¹·B·(JᵀJ)⁻¹` with `B = Σ_b G_b·G_bᵀ`, `G_b` the sum of `Jᵀr` over block b of the
//! record (the sandwich form; P. J. Huber 1967, with batch means for its middle). Several block
//! lengths are tried and the widest result is taken, never narrower than the Fisher one.
//!
//! The noise of an output is the declared one, or larger where the residuals are larger. Where that
//! makes the weights of the outputs others than those that the estimate was made with, or with
//! priors that count against a larger noise, the middle of the sandwich is the variance that the
//! estimate's own weights leave: `B = Σ_k ρ_k²·J_kᵀJ_k`, ρ_k the noise of output k in units of its
//! residuals. A prior is a residual of unit noise. Under
//! Huber's loss the score of a residual stands in the place of the residual (see `residuals`).

use super::residuals::ResidualReport;
use crate::estimation::feasible::Limit;
use crate::estimation::prior::PriorRow;
use crate::estimation::problem::Problem;
use crate::estimation::sensitivity::Neighbourhood;
use greybox_numerics::least_squares::RowGatherer;
use greybox_numerics::singular_values::singular_values;
use greybox_simulation::SimulationFailure;
use nalgebra::{DMatrix, DVector};

/// Half the width of a 95 % interval in standard errors.
pub(super) const NORMAL_95: f64 = 1.959_964;

/// Numbers of blocks that the middle of the sandwich is made of. Few long blocks catch long
/// memories, many short ones are less noisy themselves.
const BLOCK_COUNTS: [usize; 3] = [24, 48, 96];
/// Beyond this condition number of the column-scaled sensitivities a combination of unknowns is
/// not fixed by the data.
const LARGEST_CONDITION: f64 = 1e8;

/// An unknown that changes no more than this over its whole range, in units of the noise of all
/// residuals together, has no effect that others could be mistaken for.
pub(super) const NO_EFFECT: f64 = 1e-3;
/// Levels that differ by less than this share are one.
const SAME_LEVEL: f64 = 1e-3;

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

    /// The covariances.
    #[must_use]
    pub fn matrix(&self) -> &DMatrix<f64> {
        &self.matrix
    }

    /// The name of the method: `fisher`, or `fisher_coloured` where the covariance was widened for the colour of the
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
    /// The covariance of the positions; none where the data do not fix all coordinates that have
    /// any effect.
    pub covariance: Option<Covariance>,
    /// The triangle of the derivatives, each divided by its output's noise.
    pub factor: DMatrix<f64>,
    /// The condition number of the derivatives, each column scaled to the same length.
    pub condition: f64,
    /// For each coordinate and output the root mean square of ∂output/∂position, SI.
    pub slopes: Vec<Vec<f64>>,
    /// The mean square of the noise in the units of the residuals.
    pub mean_square_noise: f64,
    /// The constraints.
    pub limits: Vec<Limit>,
    /// The step to where the data alone would have the unknowns, where there are constraints.
    pub unconstrained: Option<DVector<f64>>,
}

impl Linear {
    /// Adds what else noise does to the unknowns, where their errors have a covariance.
    pub fn widen(&mut self, by: &DMatrix<f64>) {
        if let Some(covariance) = &mut self.covariance {
            covariance.matrix += by;
        }
    }

    /// The standard deviation of a coordinate, as a share of its search range.
    #[must_use]
    pub fn deviation(&self, coordinate: usize) -> Option<f64> {
        self.covariance.as_ref()?.deviation(coordinate)
    }
}

/// The noise of each output in units of its residuals.
#[derive(Clone, Debug)]
pub struct NoiseLevels {
    levels: Vec<f64>,
    /// What all residuals are multiplied with, those of the priors too: one over the level where
    /// there is one, else over the root of their mean square.
    pub weight: f64,
}

impl NoiseLevels {
    /// Returns the noise levels that the residuals show.
    #[must_use]
    pub fn of(problem: &Problem, residuals: &[ResidualReport]) -> NoiseLevels {
        if problem.innovations.is_some() {
            // An innovation is divided by its own standard deviation.
            let levels = vec![1.0; problem.outputs.len()];
            return NoiseLevels {
                levels,
                weight: 1.0,
            };
        }
        let pairs = problem.outputs.iter().zip(residuals);
        let levels: Vec<f64> = pairs
            .map(|(output, report)| report.noise_std / output.residual_scale)
            .collect();
        let squares = levels.iter().map(|level| level * level).sum::<f64>();
        let weight = match levels[..] {
            [only] => 1.0 / only,
            _ => 1.0 / (squares / levels.len() as f64).sqrt(),
        };
        NoiseLevels { levels, weight }
    }

    /// What makes a residual one of unit noise, for each output.
    #[must_use]
    pub fn weights(&self) -> Vec<f64> {
        self.levels.iter().map(|level| 1.0 / level).collect()
    }

    /// The mean square of the noise in the units of the residuals.
    #[must_use]
    pub fn mean_square(&self) -> f64 {
        self.levels.iter().map(|level| level * level).sum::<f64>() / self.levels.len() as f64
    }

    /// The variance of an output's weighted residuals.
    fn variance(&self, output: usize) -> f64 {
        (self.levels[output] * self.weight).powi(2)
    }

    /// Whether the weights are not those of the noise: outputs differ, or there are priors and
    /// the noise is not the one that they stand against.
    fn are_others(&self, has_priors: bool) -> bool {
        let differ = |level: &f64| (level * self.weight - 1.0).abs() > SAME_LEVEL;
        self.levels.iter().any(differ) || (has_priors && (self.weight - 1.0).abs() > SAME_LEVEL)
    }
}

/// Linearises the residuals at a candidate that was simulated with its neighbours.
///
/// # Errors
/// How the candidate or a neighbour failed.
pub fn linearise(
    problem: &Problem,
    around: &Neighbourhood<'_>,
    residuals: &[ResidualReport],
) -> Result<Linear, SimulationFailure> {
    let levels = NoiseLevels::of(problem, residuals);
    let unknowns = problem.coordinates.len();
    let mut gathered = Gathered::new(unknowns, problem.n_rows());
    let mut slopes = Slopes::new(unknowns, problem.outputs.len());
    around.visit_along(unknowns, |row| {
        let score = problem.loss.score(row.residual) / residuals[row.output].inlier_share;
        let derivatives = &row.derivatives[..unknowns];
        gathered.add(
            derivatives,
            score,
            levels.variance(row.output),
            levels.weight,
        );
        if !row.is_variance {
            slopes.add(row.output, derivatives);
        }
    })?;
    let mut has_priors = false;
    for prior in around.prior_rows() {
        gathered.add_prior(&prior, levels.weight);
        has_priors = true;
    }
    let Gathered {
        rows, sums, middle, ..
    } = gathered;
    let triangle = rows.finish();
    if !triangle.is_usable() {
        return Err(SimulationFailure::Diverged);
    }
    let factor = triangle.factor();
    let fixed = effective(&factor);
    let reduced = triangle.of_columns(&fixed).factor();
    let condition = condition(&reduced);
    let enough = triangle.rows() >= unknowns && condition <= LARGEST_CONDITION;
    let coloured = residuals.iter().any(|report| report.white == Some(false));
    let middle = levels.are_others(has_priors).then_some(middle);
    let mut limits = around.limits();
    limits
        .iter_mut()
        .for_each(|limit| limit.slopes.truncate(unknowns));
    Ok(Linear {
        covariance: inverse(&reduced).filter(|_| enough).map(|inverse| {
            let curvature = among(&(&inverse * inverse.transpose()), &fixed, unknowns);
            let fisher = match &middle {
                Some(middle) => &curvature * middle * &curvature,
                None => curvature.clone(),
            };
            let sums = if coloured { &sums[..] } else { &[] };
            let sandwiches = sums.iter().map(|sums| sandwich(&curvature, sums));
            let mut matrix = sandwiches.fold(fisher, widest);
            for index in (0..unknowns).filter(|index| !fixed.contains(index)) {
                matrix[(index, index)] = f64::INFINITY;
            }
            Covariance { matrix, coloured }
        }),
        factor,
        condition,
        slopes: slopes.finish(problem),
        mean_square_noise: levels.mean_square(),
        unconstrained: (!limits.is_empty())
            .then(|| triangle.damped_step(0.0, &vec![true; unknowns]))
            .flatten(),
        limits,
    })
}

/// The columns of a triangle that have an effect.
pub(super) fn effective(factor: &DMatrix<f64>) -> Vec<usize> {
    let columns = factor.column_iter().enumerate();
    columns
        .filter(|(_, column)| column.norm() > NO_EFFECT)
        .map(|(index, _)| index)
        .collect()
}

/// A matrix of some of the coordinates as one of all, zero for the others.
fn among(matrix: &DMatrix<f64>, fixed: &[usize], n: usize) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(n, n);
    for (row, of_row) in fixed.iter().enumerate() {
        for (column, of_column) in fixed.iter().enumerate() {
            all[(*of_row, *of_column)] = matrix[(row, column)];
        }
    }
    all
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
        .and_then(|values| Some(values.sizes.first()? / values.sizes.last()?))
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

    fn add(&mut self, output: usize, derivatives: &[f64]) {
        self.counts[output] += 1;
        for (squares, derivative) in self.squares.iter_mut().zip(derivatives) {
            squares[output] += derivative * derivative;
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

fn sandwich(curvature: &DMatrix<f64>, sums: &[DVector<f64>]) -> DMatrix<f64> {
    let n = curvature.nrows();
    let mut middle = DMatrix::zeros(n, n);
    for sum in sums {
        middle += sum * sum.transpose();
    }
    curvature * middle * curvature
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
    rows: RowGatherer,
    seen: usize,
    total: usize,
    sums: Vec<Vec<DVector<f64>>>,
    /// The sum of the squares of the derivatives, each with the variance of its residual.
    middle: DMatrix<f64>,
}

impl Gathered {
    fn new(columns: usize, total: usize) -> Gathered {
        let zeros = |count: &usize| vec![DVector::zeros(columns); *count];
        Gathered {
            rows: RowGatherer::new(columns),
            seen: 0,
            total: total.max(1),
            sums: BLOCK_COUNTS.iter().map(zeros).collect(),
            middle: DMatrix::zeros(columns, columns),
        }
    }

    fn add(&mut self, derivatives: &[f64], residual: f64, variance: f64, weight: f64) {
        let weighted = || derivatives.iter().map(|derivative| derivative * weight);
        self.rows.add(weighted(), residual * weight);
        for (row, first) in weighted().enumerate() {
            for (column, second) in weighted().enumerate() {
                self.middle[(row, column)] += first * second * variance;
            }
        }
        for sums in &mut self.sums {
            let block = (self.seen * sums.len() / self.total).min(sums.len() - 1);
            for (sum, derivative) in sums[block].iter_mut().zip(derivatives) {
                *sum += derivative * residual * weight * weight;
            }
        }
        self.seen += 1;
    }

    /// A prior has unit noise before it is weighted, and is a block of its own.
    fn add_prior(&mut self, prior: &PriorRow, weight: f64) {
        let columns = self.middle.ncols();
        let part = |column: usize| prior.slope(column) * weight;
        self.rows
            .add((0..columns).map(part), prior.residual * weight);
        let sum = DVector::from_fn(columns, |column, _| part(column) * weight);
        self.middle += &sum * sum.transpose();
        for sums in &mut self.sums {
            sums.push(sum.clone());
        }
    }
}
