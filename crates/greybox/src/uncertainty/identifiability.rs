//! What the data could fix, seen before anything is estimated.
//!
//! At several points of the search box the residuals are linearised. With J their derivatives by
//! the positions, each divided by its output's noise, an ideal estimator has the covariance
//! `(JᵀJ)⁻¹` (the Cramér–Rao bound; L. Ljung, *System Identification*, 1999, ch. 7): so much is
//! predicted of each unknown. A direction v along which `1/|J·v|` exceeds half the box at every
//! point is *flat*: the unknowns may move along it together and the outputs stay as they are.
//! A direction is straight in the box, or one of powers: unknowns that are only seen as a product
//! move along a hyperbola where their scales are linear.
//! Where large effects of single unknowns cancel, J·v is all rounding: so the directions that J
//! proposes are tried at each point by going along them.

mod direction;

pub use direction::FlatDirection;

use super::budget::{Budget, Extended};
use super::probes;
use super::width::is_too_wide;
use crate::estimation::feasible;
use crate::estimation::problem::{Coordinate, Problem};
use crate::estimation::sensitivity::{self, SensitivityError, Sides};
use direction::Direction;
use greybox_numerics::least_squares::RowGatherer;
use greybox_numerics::singular_values::{SingularValues, singular_values};
use greybox_simulation::{Accuracy, SimulationFailure};
use nalgebra::DMatrix;
use std::sync::atomic::AtomicBool;

/// Points of the box that are looked at, the middle first.
pub const POINTS: usize = 5;

/// The noise of an output that declares none, as a share of the spread of its signal.
const ASSUMED_NOISE: f64 = 0.01;

/// A direction with a larger standard deviation than this share of the box is flat.
const FLAT: f64 = 0.5;

/// Derivatives by differences have an error of this share of the largest.
const ROUNDING: f64 = 1e-5;

/// How far a proposed direction is gone to both sides, as a share of the search range.
const TRIED: f64 = 1e-2;

/// What is forecast of one coordinate.
#[derive(Clone, Debug)]
pub struct CoordinateForecast {
    /// The predicted standard error in the middle of the box, SI; none where the data do not fix
    /// the coordinate, or the simulation fails there.
    pub standard_error: Option<f64>,
    /// The smallest and the largest predicted standard error over the points, as a share of the
    /// search range.
    pub share_of_range: Option<(f64, f64)>,
}

/// What is forecast of a problem.
#[derive(Clone, Debug)]
pub struct Forecast {
    /// Points of the box that could be simulated.
    pub points: usize,
    /// One for each coordinate.
    pub coordinates: Vec<CoordinateForecast>,
    /// What the data do not see.
    pub flat: Vec<FlatDirection>,
}

/// How the problem is looked at.
#[derive(Clone, Debug)]
struct View<'a> {
    problem: &'a Problem,
    /// What makes a residual one of unit noise, for each output.
    weights: &'a [f64],
    accuracy: Accuracy,
    stop: &'a AtomicBool,
}

/// Looks at a problem before it is estimated. Answers nothing when `stop` was raised.
#[must_use]
pub fn forecast(problem: &Problem, accuracy: Accuracy, stop: &AtomicBool) -> Option<Forecast> {
    let n = problem.coordinates.len();
    let view = View {
        problem,
        weights: &weights(problem),
        accuracy,
        stop,
    };
    let inside = feasible::inside_of_constraints(problem);
    let place = |point| feasible::mirrored(problem, inside.as_deref(), position(point, n));
    let mut seen = Vec::with_capacity(POINTS);
    for point in 0..POINTS {
        match information(&view, &place(point)) {
            Ok(information) => seen.push((point, information)),
            Err(SensitivityError::Interrupted) => return None,
            Err(SensitivityError::Failed(_)) => {}
        }
    }
    let points: Vec<Vec<f64>> = seen.iter().map(|(point, _)| place(*point)).collect();
    let proposed = proposed(problem, &seen);
    let flat = match flat_directions(&view, &points, proposed) {
        Ok(directions) => directions,
        Err(SensitivityError::Interrupted) => return None,
        Err(SensitivityError::Failed(_)) => Vec::new(),
    };
    let deviations: Vec<Vec<f64>> = seen
        .iter()
        .map(|(_, information)| deviations(information))
        .collect();
    let middle_is_there = seen.first().is_some_and(|(point, _)| *point == 0);
    let coordinates = (0..n)
        .map(|index| {
            let of_points = deviations.iter().map(|deviations| deviations[index]);
            let low = of_points.clone().fold(f64::INFINITY, f64::min);
            let high = of_points.fold(0.0, f64::max);
            let slope = problem.coordinates[index].slope(0.5).abs();
            let in_middle = deviations.first().filter(|_| middle_is_there);
            CoordinateForecast {
                standard_error: in_middle
                    .map(|deviations| deviations[index] * slope)
                    .filter(|error| error.is_finite()),
                share_of_range: (low.is_finite() && high.is_finite()).then_some((low, high)),
            }
        })
        .collect();
    Some(Forecast {
        points: seen.len(),
        coordinates,
        flat: flat
            .iter()
            .map(|direction| direction.named(problem))
            .collect(),
    })
}

/// Whether the data could fix a parameter so well that it is not too wide to be used, with the states at the start
/// where the data want them and the other unknowns at `positions`.
///
/// # Errors
/// When the stop flag was raised, or the simulation failed.
pub fn fixes_some(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Result<bool, SensitivityError> {
    let positions = with_fitted_starts(problem, positions, stop)?;
    let view = View {
        problem,
        weights: &weights(problem),
        accuracy: Accuracy::Full,
        stop,
    };
    let deviations = deviations(&information(&view, &positions)?);
    let mut coordinates = problem.coordinates.iter().zip(positions).zip(deviations);
    Ok(coordinates.any(|((coordinate, position), deviation)| {
        let error = deviation * coordinate.slope(position).abs();
        let value = coordinate.value(position);
        !coordinate.is_start() && !is_too_wide(coordinate, value, error)
    }))
}

/// Positions with the states at the start where the data want them by the linearised model, with the other unknowns at
/// `positions`.
///
/// # Errors
/// When the stop flag was raised, or the simulation failed.
pub fn with_fitted_starts(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Result<Vec<f64>, SensitivityError> {
    let view = View {
        problem,
        weights: &weights(problem),
        accuracy: Accuracy::Full,
        stop,
    };
    started(&view, positions)
}

/// Positions with the states at the start where the data want them by the linearised model.
fn started(view: &View<'_>, positions: &[f64]) -> Result<Vec<f64>, SensitivityError> {
    let coordinates = view.problem.coordinates.iter();
    let starts: Vec<bool> = coordinates.map(Coordinate::is_start).collect();
    if !starts.contains(&true) {
        return Ok(positions.to_vec());
    }
    let mut rows = RowGatherer::new(positions.len());
    sensitivity::visit_rows(view.problem, positions, view.accuracy, view.stop, |row| {
        let weight = view.weights[row.output];
        let slopes = row.derivatives.iter().map(|derivative| derivative * weight);
        rows.add(slopes, row.residual * weight);
    })?;
    let step = rows.finish().damped_step(0.0, &starts);
    let step = step.map_or_else(
        || vec![0.0; positions.len()],
        |step| step.as_slice().to_vec(),
    );
    let moved = positions.iter().zip(step);
    Ok(moved
        .map(|(position, step)| (position + step).clamp(0.0, 1.0))
        .collect())
}

/// What the data do not see at a single point, where the triangle of the weighted derivatives is
/// at hand.
///
/// # Errors
/// When the stop flag was raised, or a simulation failed.
pub fn flat_at(
    problem: &Problem,
    positions: &[f64],
    factor: &DMatrix<f64>,
    weights: &[f64],
    stop: &AtomicBool,
) -> Result<Vec<FlatDirection>, SensitivityError> {
    let points = [positions.to_vec()];
    let view = View {
        problem,
        weights,
        accuracy: Accuracy::Full,
        stop,
    };
    let proposed = singular_values(factor).map_or_else(Vec::new, |values| flat_in(&values));
    let proposed = proposed
        .iter()
        .map(|vector| vec![Direction::likely(problem, positions, vector)]);
    let directions = flat_directions(&view, &points, proposed.collect())?;
    Ok(directions
        .iter()
        .map(|direction| direction.named(problem))
        .collect())
}

/// What is to be expected of all that is taken as known, in the middle of the box; empty where
/// that cannot be simulated. Answers nothing when `stop` was raised.
#[must_use]
pub fn budget(problem: &Problem, forecast: &Forecast, stop: &AtomicBool) -> Option<Budget> {
    let middle = vec![0.5; problem.coordinates.len()];
    let probed = probes::probed(problem, &middle, stop)?;
    let extended = Extended::new(&probed, &middle, true);
    let around = extended.around(Accuracy::Full, stop)?;
    let pairs = problem.coordinates.iter().zip(&forecast.coordinates);
    let deviations: Vec<f64> = pairs
        .map(|(coordinate, forecast)| {
            let error = forecast.standard_error.unwrap_or(f64::INFINITY);
            error / coordinate.slope(0.5).abs()
        })
        .collect();
    let budget = Budget::foretold(&extended, &around, &weights(problem), &deviations);
    Some(budget.unwrap_or_default())
}

/// The middle of the box, then points that fill its inner part evenly (steps of the n-dimensional
/// golden ratio; M. Roberts, 2018).
fn position(point: usize, n: usize) -> Vec<f64> {
    if point == 0 {
        return vec![0.5; n];
    }
    let mut ratio = 2.0_f64;
    for _ in 0..40 {
        ratio = libm::pow(1.0 + ratio, 1.0 / (n as f64 + 1.0));
    }
    (1..=n)
        .map(|dimension| {
            let step = libm::pow(ratio, -(dimension as f64));
            0.15 + 0.7 * (0.5 + point as f64 * step).fract()
        })
        .collect()
}

/// What makes a residual one of unit noise, for each output.
fn weights(problem: &Problem) -> Vec<f64> {
    let outputs = problem.outputs.iter();
    outputs
        .map(|output| match output.noise_std {
            Some(noise) => output.residual_scale / noise,
            None => 1.0 / ASSUMED_NOISE,
        })
        .collect()
}

/// The singular values of the weighted derivatives. A point at which they are not finite, or too
/// large to be squared, has failed like one that cannot be simulated.
fn information(view: &View<'_>, positions: &[f64]) -> Result<SingularValues, SensitivityError> {
    let mut rows = RowGatherer::new(positions.len());
    sensitivity::visit_rows(view.problem, positions, view.accuracy, view.stop, |row| {
        let weight = view.weights[row.output];
        rows.add(
            row.derivatives.iter().map(|derivative| derivative * weight),
            0.0,
        );
    })?;
    for prior in view.problem.prior_rows(positions) {
        rows.add((0..positions.len()).map(|column| prior.slope(column)), 0.0);
    }
    singular_values(&rows.finish().factor())
        .ok_or(SensitivityError::Failed(SimulationFailure::Diverged))
}

/// The predicted standard deviation of each coordinate as a share of its range; infinite where
/// the data do not fix it.
fn deviations(information: &SingularValues) -> Vec<f64> {
    let variance = |coordinate: usize| -> f64 {
        let parts = information.sizes.iter().zip(&information.directions);
        parts
            .map(|(size, direction)| {
                let part = direction[coordinate];
                if part.abs() < 1e-6 {
                    0.0
                } else {
                    (part / size).powi(2)
                }
            })
            .sum()
    };
    let n = information.directions.first().map_or(0, Vec::len);
    (0..n)
        .map(|coordinate| variance(coordinate).sqrt())
        .collect()
}

/// The directions that are flat at the point that has fewest of them, each in all its forms: an
/// equilibrium, such as the middle of the box may be, has some that are none elsewhere. Points that
/// have none at all may only lack the digits to see one.
fn proposed(problem: &Problem, seen: &[(usize, SingularValues)]) -> Vec<Vec<Direction>> {
    let flat = seen.iter().map(|(point, seen)| (*point, flat_in(seen)));
    let some = flat.filter(|(_, flat)| !flat.is_empty());
    let Some((point, flat)) = some.min_by_key(|(_, flat)| flat.len()) else {
        return Vec::new();
    };
    let at = position(point, problem.coordinates.len());
    flat.iter()
        .map(|vector| Direction::forms(problem, &at, vector))
        .collect()
}

/// The directions that are flat by the singular values of the derivatives, or would be if those had
/// more digits.
fn flat_in(information: &SingularValues) -> Vec<Vec<f64>> {
    let largest = information.sizes.iter().copied().fold(0.0, f64::max);
    let pairs = information.sizes.iter().zip(&information.directions);
    pairs
        .filter(|(size, _)| **size * FLAT < 1.0 || **size < ROUNDING * largest)
        .map(|(_, direction)| direction.clone())
        .collect()
}

/// The proposed directions along which the outputs stay as they are at every point: of each the
/// first form that does.
fn flat_directions(
    view: &View<'_>,
    points: &[Vec<f64>],
    mut proposed: Vec<Vec<Direction>>,
) -> Result<Vec<Direction>, SensitivityError> {
    for positions in points {
        let vectors: Vec<Vec<f64>> = proposed
            .iter()
            .flatten()
            .map(|direction| direction.at(view.problem, positions))
            .collect();
        if vectors.is_empty() {
            break;
        }
        let mut squares = vec![0.0; vectors.len()];
        let gather = |row: sensitivity::Row<'_>| {
            for (square, derivative) in squares.iter_mut().zip(row.derivatives) {
                *square += (derivative * view.weights[row.output]).powi(2);
            }
        };
        let along = sensitivity::Directions {
            from: positions,
            vectors: &vectors,
            shift: TRIED,
            sides: Sides::Both,
        };
        sensitivity::visit_directions(view.problem, along, view.accuracy, view.stop, gather)?;
        for prior in view.problem.prior_rows(positions) {
            let along = |vector: &Vec<f64>| -> f64 {
                let parts = prior.slopes.iter();
                parts.map(|(index, slope)| vector[*index] * slope).sum()
            };
            for (square, vector) in squares.iter_mut().zip(&vectors) {
                *square += along(vector).powi(2);
            }
        }
        let mut sizes = squares.iter().map(|square| square.sqrt());
        let mut is_flat = |_: &Direction| sizes.next().is_some_and(|size| size * FLAT < 1.0);
        for forms in &mut proposed {
            forms.retain(&mut is_flat);
        }
    }
    let first = |forms: Vec<Direction>| forms.into_iter().next();
    Ok(proposed.into_iter().filter_map(first).collect())
}
