//! Intervals from the likelihood profile.
//!
//! A coordinate is held at a distance from its estimate and all others are fitted again; the sum
//! of squares rises by the *excess*. The end of the interval is where the excess reaches the
//! level at which a 95 % test would reject (D. J. Venzon, S. H. Moolgavkar, "A method for
//! computing profile-likelihood-based confidence intervals", Applied Statistics 37, 1988; A.
//! Raue et al., Bioinformatics 25, 2009). Where the model is linear in its unknowns this is the
//! Fisher interval; the level is chosen so that it is that too where the noise is larger than
//! declared, unknown, or coloured.

use std::sync::Arc;

use super::NORMAL_95;
use super::covariance::Linear;
use super::refits::Refits;
use crate::estimation::objective::Objective;
use crate::estimation::problem::{Coordinate, Problem, Target};
use crate::estimation::refine;
use crate::estimation::sensitivity::SensitivityError;
use greybox_numerics::least_squares::Triangle;
use greybox_simulation::Accuracy;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Fits on the way to an end at the most.
const MOST_FITS: usize = 12;
/// How near the root of the excess comes to that of the level.
const NEAR: f64 = 0.01;
/// The first distance that is tried where no standard error says one, as a share of the range.
const FIRST_DISTANCE: f64 = 0.1;

/// The ends of an interval as positions; none where the data leave it open within the range.
pub type Ends = (Option<f64>, Option<f64>);

/// A point of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where the coordinate was held.
    pub position: f64,
    /// The excess there, as a multiple of that at which the interval ends.
    pub excess: f64,
}

/// What was found out of one coordinate.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The ends of its interval.
    pub ends: Ends,
    /// The fits on the way to them, in the order of their positions.
    pub points: Vec<Point>,
}

impl Found {
    /// The points as values, the estimate at its own position among them.
    #[must_use]
    pub fn values(&self, coordinate: &Coordinate, own: f64) -> Vec<(f64, f64)> {
        let points = self.points.iter();
        let points = points.map(|point| (point.position, point.excess));
        let mut points: Vec<(f64, f64)> = points.chain([(own, 0.0)]).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let value = |(position, excess)| (coordinate.value(position), excess);
        points.into_iter().map(value).collect()
    }
}

/// The interval of each coordinate.
///
/// # Errors
/// When the stop flag was raised, the refits were cut, or the estimate cannot be simulated.
pub fn intervals(
    problem: &Problem,
    positions: &[f64],
    linear: &Linear,
    (refits, stop): (&Refits, &AtomicBool),
) -> Result<Vec<Found>, SensitivityError> {
    let bottom = refine::linearise(problem, positions, Accuracy::Full, stop)?;
    let inverse = information_inverse(&bottom.triangle);
    let sum = bottom.cost * bottom.triangle.rows() as f64;
    let ends = |(coordinate, side): (usize, f64)| {
        let profile = Profile {
            problem,
            positions,
            coordinate,
            sum,
            inverse: inverse.as_ref(),
            deviation: linear.deviation(coordinate),
            noise: linear.mean_square_noise,
            refits,
            stop,
        };
        profile.end(side)
    };
    let sides: Vec<(usize, f64)> = (0..positions.len())
        .flat_map(|coordinate| [(coordinate, -1.0), (coordinate, 1.0)])
        .collect();
    let found: Vec<(Option<f64>, Vec<Point>)> = sides
        .into_par_iter()
        .map(ends)
        .collect::<Result<_, SensitivityError>>()?;
    let both = found.chunks_exact(2).map(|sides| {
        let mut points = [&sides[0].1[..], &sides[1].1].concat();
        points.sort_by(|a, b| a.position.total_cmp(&b.position));
        Found {
            ends: (sides[0].0, sides[1].0),
            points,
        }
    });
    Ok(both.collect())
}

/// `(JᵀJ)⁻¹`; none where J is singular.
fn information_inverse(triangle: &Triangle) -> Option<DMatrix<f64>> {
    let factor = triangle.factor();
    let n = factor.ncols();
    let inverse = factor.solve_upper_triangular(&DMatrix::identity(n, n))?;
    let inverse = &inverse * inverse.transpose();
    inverse
        .iter()
        .all(|entry| entry.is_finite())
        .then_some(inverse)
}

/// One coordinate's profile.
struct Profile<'a> {
    problem: &'a Problem,
    positions: &'a [f64],
    coordinate: usize,
    /// The sum of squares at the estimate.
    sum: f64,
    inverse: Option<&'a DMatrix<f64>>,
    deviation: Option<f64>,
    /// The mean square of the noise in the units of the residuals.
    noise: f64,
    refits: &'a Refits,
    stop: &'a AtomicBool,
}

impl Profile<'_> {
    /// Where the excess reaches its level on one side, none where it does not within the range; and
    /// the points on the way.
    fn end(&self, side: f64) -> Result<(Option<f64>, Vec<Point>), SensitivityError> {
        let mut points = Vec::new();
        let start = self.positions[self.coordinate];
        let level = self.level();
        let mut reduced = without(self.problem, self.coordinate);
        let mut others = self.others();
        let mut inside = (start, 0.0);
        let mut outside: Option<(f64, f64)> = None;
        let first = self
            .deviation
            .map_or(FIRST_DISTANCE, |deviation| NORMAL_95 * deviation);
        let mut next = start + side * first;
        for _ in 0..MOST_FITS {
            let position = next.clamp(0.0, 1.0);
            hold(&mut reduced, self.problem, self.coordinate, position);
            let own = self.prior_square(position);
            let fit = self.fit(position, &reduced, self.guess(position, &others))?;
            let (root, fitted) = match fit.map(|(sum, fitted)| (sum + own, fitted)) {
                Some((sum, fitted)) => (((sum - self.sum).max(0.0) / level).sqrt(), Some(fitted)),
                None => (f64::INFINITY, None),
            };
            if root.is_finite() {
                points.push(Point {
                    position,
                    excess: root * root,
                });
            }
            if (root - 1.0).abs() < NEAR {
                return Ok((Some(position), points));
            }
            if root > 1.0 {
                outside = Some((position, root));
            } else if position <= 0.0 || position >= 1.0 {
                return Ok((None, points));
            } else {
                inside = (position, root);
                others = fitted.map_or(others, |positions| Others {
                    at: position,
                    positions,
                });
            }
            next = between(start, inside, outside);
        }
        Ok((Some(inside.0), points))
    }

    /// The excess at the end of the interval. Near the estimate the excess of a distance d is
    /// `d²/v`, with v the diagonal of `(JᵀJ)⁻¹`.
    fn level(&self) -> f64 {
        let variance = self
            .inverse
            .map(|inverse| inverse[(self.coordinate, self.coordinate)]);
        let ratio = match (self.deviation, variance) {
            (Some(deviation), Some(variance)) => deviation * deviation / variance,
            _ => self.noise,
        };
        NORMAL_95 * NORMAL_95 * ratio
    }

    /// What the held coordinate's own prior adds to the sum of squares.
    fn prior_square(&self, position: f64) -> f64 {
        let held = &self.problem.coordinates[self.coordinate];
        let prior = held.prior;
        prior.map_or(0.0, |prior| prior.residual(held.value(position)).powi(2))
    }

    fn others(&self) -> Others {
        let mut positions = self.positions.to_vec();
        positions.remove(self.coordinate);
        Others {
            at: self.positions[self.coordinate],
            positions,
        }
    }

    /// The others, moved along with the coordinate as the linear model says.
    fn guess(&self, position: f64, others: &Others) -> Vec<f64> {
        let distance = position - others.at;
        let slope = |place: usize| {
            let index = place + usize::from(place >= self.coordinate);
            self.inverse.map_or(0.0, |inverse| {
                inverse[(index, self.coordinate)] / inverse[(self.coordinate, self.coordinate)]
            })
        };
        let places = others.positions.iter().enumerate();
        places
            .map(|(place, other)| (other + slope(place) * distance).clamp(0.0, 1.0))
            .collect()
    }

    /// The lowest sum of squares with the coordinate held, and where the others then are; none
    /// where it cannot be simulated.
    fn fit(
        &self,
        position: f64,
        reduced: &Problem,
        start: Vec<f64>,
    ) -> Result<Option<(f64, Vec<f64>)>, SensitivityError> {
        let samples = (reduced.n_residuals() + reduced.prior_sum(&start).1) as f64;
        if start.is_empty() {
            let objective = Objective::new(reduced, usize::MAX);
            let only = objective
                .evaluate(reduced, &[start], Accuracy::Full, self.stop)
                .ok_or(SensitivityError::Interrupted)?;
            let cost = only[0].cost;
            return Ok(cost.is_finite().then(|| (cost * samples, Vec::new())));
        }
        let name = format!("profile/{}/{position:e}", self.coordinate);
        let refit = self
            .refits
            .descend(name, || (reduced, start), Accuracy::Full, self.stop)
            .ok_or(SensitivityError::Interrupted)?;
        Ok(refit.cost.map(|cost| (cost * samples, refit.positions)))
    }
}

/// Where the other coordinates were when the one was held.
struct Others {
    at: f64,
    positions: Vec<f64>,
}

/// The next position to try: by the secant where both sides of the level are known, else further
/// out in proportion, four times as far at the most.
fn between(start: f64, inside: (f64, f64), outside: Option<(f64, f64)>) -> f64 {
    match outside {
        Some((position, root)) if root.is_finite() => {
            let share = (1.0 - inside.1) / (root - inside.1);
            inside.0 + (position - inside.0) * share.clamp(0.05, 0.95)
        }
        Some((position, _)) => 0.5 * (inside.0 + position),
        None => start + (inside.0 - start) * (1.02 / inside.1).min(4.0),
    }
}

/// The problem with a coordinate that is no longer unknown.
fn without(problem: &Problem, coordinate: usize) -> Problem {
    let mut reduced = problem.clone();
    reduced.coordinates.remove(coordinate);
    reduced
}

/// Holds the coordinate at a position.
fn hold(reduced: &mut Problem, problem: &Problem, coordinate: usize, position: f64) {
    let held = &problem.coordinates[coordinate];
    let value = held.value(position);
    match held.target {
        Target::Parameter(index) => reduced.parameters[index] = value,
        Target::ExperimentParameter {
            experiment,
            parameter,
        } => {
            let experiments = Arc::make_mut(&mut reduced.experiments);
            experiments[experiment].parameters.push((parameter, value));
        }
        Target::InitialState { experiment, state } => {
            let experiments = Arc::make_mut(&mut reduced.experiments);
            experiments[experiment].initial_state[state] = Some(value);
        }
    }
}
