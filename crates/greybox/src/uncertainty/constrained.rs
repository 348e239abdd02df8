//! Intervals where constraints cut into them.
//!
//! With C the covariance and d₀ the step to where the data alone would have the unknowns, the sum
//! of squares of a step d exceeds its least by `(d − d₀)ᵀC⁻¹(d − d₀)`. An end of an interval is as
//! far as an unknown can go before the least such excess, among the steps that break no
//! constraint, reaches the level at which a 95 % test would reject: the profile of the linear
//! model. Where a constraint binds, the interval ends at it; on its other side it is what it would
//! be without, or narrower.

use super::covariance::{Linear, NORMAL_95};
use super::profile::Ends;
use crate::estimation::feasible::Limit;
use greybox_numerics::inequalities::{Inequality, least_squares};
use nalgebra::{DMatrix, DVector};

/// A constraint farther off than so many standard deviations of the way to it cuts no interval.
const REACH: f64 = 4.0;
/// A constraint binds whose border is nearer than this, as a share of the search ranges.
const AT_BORDER: f64 = 1e-6;
/// Halvings on the way to an end.
const HALVINGS: usize = 45;

/// A constraint that keeps the estimate from where the data would have it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Binding {
    /// Which, by its place among the problem's.
    pub constraint: usize,
    /// How far the data would go beyond it, in standard deviations of noise.
    pub deviations: f64,
}

/// The estimate's covariance with the constraints near it.
#[derive(Debug)]
pub struct Constrained<'a> {
    covariance: &'a DMatrix<f64>,
    /// The step to where the data alone would have the unknowns.
    unconstrained: &'a DVector<f64>,
    limits: &'a [Limit],
}

impl<'a> Constrained<'a> {
    /// None where no constraint is near enough to matter, or there is no covariance.
    #[must_use]
    pub fn of(linear: &'a Linear) -> Option<Constrained<'a>> {
        let covariance = linear.covariance.as_ref()?.matrix();
        let unconstrained = linear.unconstrained.as_ref()?;
        let constrained = Constrained {
            covariance,
            unconstrained,
            limits: &linear.limits,
        };
        let is_sound = covariance.iter().all(|entry| entry.is_finite());
        let is_near = |limit: &Limit| limit.slack < REACH * constrained.deviation(limit);
        (is_sound && linear.limits.iter().any(is_near)).then_some(constrained)
    }

    /// The standard deviation of what is left of a constraint.
    fn deviation(&self, limit: &Limit) -> f64 {
        let slopes = DVector::from_column_slice(&limit.slopes);
        slopes.dot(&(self.covariance * &slopes)).sqrt()
    }

    /// The constraints that bind, each once.
    #[must_use]
    pub fn bindings(&self) -> Vec<Binding> {
        let mut bindings: Vec<Binding> = Vec::new();
        for limit in self.limits {
            let slopes = DVector::from_column_slice(&limit.slopes);
            let beyond = -(limit.slack + slopes.dot(self.unconstrained));
            let binding = Binding {
                constraint: limit.constraint,
                deviations: beyond / self.deviation(limit),
            };
            let is_listed = bindings
                .iter()
                .any(|listed| listed.constraint == limit.constraint);
            if limit.distance() < AT_BORDER && binding.deviations > 0.0 && !is_listed {
                bindings.push(binding);
            }
        }
        bindings
    }

    /// The interval of each unknown about its position, were its standard deviation `factors` times
    /// as large. None where the covariance is singular.
    #[must_use]
    pub fn ends(&self, positions: &[f64], factors: &[f64]) -> Option<Vec<Ends>> {
        let n = positions.len();
        let scaled = DMatrix::from_fn(n, n, |row, column| {
            self.covariance[(row, column)] * factors[row] * factors[column]
        });
        let factor = scaled
            .clone()
            .cholesky()?
            .inverse()
            .cholesky()?
            .l()
            .transpose();
        let right = &factor * self.unconstrained;
        let inequalities: Vec<Inequality> = self.limits.iter().map(Limit::inequality).collect();
        let excess = |inequalities: &[Inequality]| {
            let step = least_squares(&factor, &right, inequalities)?;
            Some((&factor * step - &right).norm_squared())
        };
        let least = excess(&inequalities)?;
        let end = |index: usize, side: f64| {
            let is_inside = |distance: f64| {
                let mut row = vec![0.0; n];
                row[index] = side;
                let mut all = inequalities.clone();
                all.push(Inequality {
                    row,
                    least: distance,
                });
                excess(&all).is_some_and(|sum| sum - least <= NORMAL_95 * NORMAL_95)
            };
            let deviation = scaled[(index, index)].sqrt();
            let mut inner = 0.0;
            let mut outer = self.unconstrained[index].abs() + 2.0 * NORMAL_95 * deviation;
            for _ in 0..HALVINGS {
                let middle = 0.5 * (inner + outer);
                match is_inside(middle) {
                    true => inner = middle,
                    false => outer = middle,
                }
            }
            positions[index] + side * inner
        };
        let both = |index| (Some(end(index, -1.0)), Some(end(index, 1.0)));
        Some((0..n).map(both).collect())
    }
}
