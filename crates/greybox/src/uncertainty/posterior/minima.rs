//! What the minima of the cost and the curvature there say of a posterior (P. S. Laplace, 1774).
//!
//! About each minimum the posterior is nearly normal, with the inverse of the information as its
//! covariance. Draws come from Student's distribution with four degrees of freedom about a minimum,
//! whose tails are wider than those of the normal one. A search range of width 1 has the variance 1/12
//! of a uniform density: its information keeps a direction that the data do not see within the range.

use crate::estimation::problem::Problem;
use crate::estimation::refine;
use crate::estimation::report::Report;
use crate::estimation::sensitivity::SensitivityError;
use greybox_numerics::rng::{self, Rng};
use greybox_simulation::Accuracy;
use nalgebra::{DMatrix, DVector};
use std::sync::atomic::AtomicBool;

/// The degrees of freedom of Student's distribution.
const DEGREES: usize = 4;
/// The information of a search range of width 1.
const RANGE_INFORMATION: f64 = 12.0;
/// How often a draw outside the search range is drawn again.
const ATTEMPTS: usize = 20;

/// The minima of the cost with the curvature at each.
#[derive(Debug)]
pub(super) struct Minima {
    minima: Vec<LaplaceMinimum>,
}

/// A minimum of the cost, with the information there.
#[derive(Debug)]
struct LaplaceMinimum {
    middle: DVector<f64>,
    /// The upper triangle R of the information RᵀR.
    triangle: DMatrix<f64>,
}

impl Minima {
    /// Linearises the estimate and its twins. A minimum near which a simulation fails is left out;
    /// `independent_share` is the share of independent samples. Answers nothing when `stop` was raised.
    pub fn of(
        problem: &Problem,
        report: &Report,
        independent_share: f64,
        stop: &AtomicBool,
    ) -> Option<Minima> {
        let twins = report.twins.iter();
        let twins = twins.map(|twin| positions_of(problem, &report.positions, twin));
        let middles = std::iter::once(report.positions.clone()).chain(twins);
        let mut minima = Vec::new();
        for middle in middles {
            match refine::linearise(problem, &middle, Accuracy::Full, stop) {
                Ok(linearisation) => {
                    let factor = linearisation.triangle.factor();
                    let weight = independent_share / linearisation.residual_variance;
                    minima.extend(LaplaceMinimum::of(middle, &factor, weight));
                }
                Err(SensitivityError::Interrupted) => return None,
                Err(SensitivityError::Failed(_)) => {}
            }
        }
        Some(Minima { minima })
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.minima.is_empty()
    }

    /// The positions of a minimum, counted round and round.
    pub fn middle(&self, number: usize) -> Vec<f64> {
        let minimum = &self.minima[number % self.minima.len()];
        minimum.middle.iter().copied().collect()
    }

    /// The standard deviation of each position about the first minimum.
    pub fn deviations(&self) -> Vec<f64> {
        let triangle = &self.minima[0].triangle;
        let n = triangle.ncols();
        let inverse = triangle.solve_upper_triangular(&DMatrix::identity(n, n));
        let inverse = inverse.expect("the information is positive definite");
        inverse.row_iter().map(|row| row.norm()).collect()
    }

    /// Draws about a minimum, counted round and round, within the search range: a draw that lies
    /// outside after many attempts is moved to the border.
    pub fn draw_within(&self, number: usize, rng: &mut impl Rng) -> Vec<f64> {
        let minimum = &self.minima[number % self.minima.len()];
        let is_inside = |draw: &Vec<f64>| draw.iter().all(|part| (0.0..=1.0).contains(part));
        let mut draw = minimum.draw(rng);
        for _ in 1..ATTEMPTS {
            if is_inside(&draw) {
                break;
            }
            draw = minimum.draw(rng);
        }
        draw.iter_mut()
            .for_each(|part| *part = part.clamp(0.0, 1.0));
        draw
    }

    /// Draws about one of the minima, each as often.
    pub fn draw(&self, rng: &mut impl Rng) -> Vec<f64> {
        let number = rng::below(rng, self.minima.len());
        self.minima[number].draw(rng)
    }

    /// The logarithm of the density of [`Minima::draw`] at positions, up to a summand.
    pub fn log_density(&self, positions: &[f64]) -> f64 {
        let at = DVector::from_column_slice(positions);
        let each = self.minima.iter().map(|minimum| minimum.log_density(&at));
        let each: Vec<f64> = each.collect();
        let largest = each.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = each
            .iter()
            .map(|density| libm::exp(density - largest))
            .sum();
        largest + libm::log(sum)
    }
}

impl LaplaceMinimum {
    /// None where the information is not finite.
    fn of(middle: Vec<f64>, factor: &DMatrix<f64>, weight: f64) -> Option<LaplaceMinimum> {
        let n = middle.len();
        let range = DMatrix::identity(n, n) * RANGE_INFORMATION;
        let information = factor.transpose() * factor * weight + range;
        let lower = information.cholesky()?.l();
        let is_finite = lower.iter().all(|entry| entry.is_finite());
        is_finite.then(|| LaplaceMinimum {
            middle: DVector::from_vec(middle),
            triangle: lower.transpose(),
        })
    }

    fn draw(&self, rng: &mut impl Rng) -> Vec<f64> {
        let normal = DVector::from_fn(self.middle.len(), |_, _| rng::normal(rng));
        let squares: f64 = (0..DEGREES).map(|_| rng::normal(rng).powi(2)).sum();
        let step = self.triangle.solve_upper_triangular(&normal);
        let step = step.expect("the information is positive definite");
        let drawn = &self.middle + step * (DEGREES as f64 / squares).sqrt();
        drawn.iter().copied().collect()
    }

    fn log_density(&self, at: &DVector<f64>) -> f64 {
        let distance = (&self.triangle * (at - &self.middle)).norm_squared();
        let degrees = DEGREES as f64;
        let power = 0.5 * (degrees + self.middle.len() as f64);
        let diagonal = self.triangle.diagonal();
        let volume: f64 = diagonal.iter().map(|entry| libm::log(*entry)).sum();
        volume - power * libm::log1p(distance / degrees)
    }
}

/// The positions of another minimum, which has a value for each unknown by its name: an unknown that it does
/// not name stands where the estimate has it.
fn positions_of(problem: &Problem, estimate: &[f64], twin: &[(String, f64)]) -> Vec<f64> {
    let coordinates = problem.coordinates.iter().zip(estimate);
    let positions = coordinates.map(|(coordinate, estimate)| {
        let value = twin.iter().find(|(name, _)| *name == coordinate.name);
        value.map_or(*estimate, |(_, value)| {
            let (lower, upper) = (coordinate.lower, coordinate.upper);
            coordinate.scale.position(*value, lower, upper)
        })
    });
    positions.collect()
}
