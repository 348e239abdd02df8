//! What is known at present: priors, tolerances, and the data of an earlier estimate, linearised
//! where they are; and points drawn from it.

use super::information::{Known, NOT_FIXED, deviations, sum, triangle, visit, with_zero_right};
use crate::estimation::problem::{Experiment, Problem};
use crate::estimation::sensitivity::SensitivityError;
use crate::uncertainty::covariance::NO_EFFECT;
use greybox_numerics::least_squares::{RowGatherer, Triangle};
use greybox_numerics::rng::{self, Purpose, Rng};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A point that is drawn keeps this distance to the ends of the search ranges, as a share of them.
const MARGIN: f64 = 0.01;
/// Where nothing but its range is known of an unknown, it is drawn from the inner part that begins
/// here.
const INNER: f64 = 0.15;

/// An earlier estimate: its problem, and what is told of it.
#[derive(Clone, Debug)]
pub struct Past {
    /// The problem with its experiments; its unknowns are those of the next experiment's too.
    pub problem: Problem,
    /// What makes a residual of each output one of unit noise.
    pub weights: Vec<f64>,
    /// For each unknown the standard error that was told, SI; none where there was none. The data
    /// count no more than it says: residuals with a memory are worth fewer than they are.
    pub standard_errors: Vec<Option<f64>>,
}

/// The knowledge of the unknowns before a new experiment.
#[derive(Clone, Debug)]
pub struct Present {
    /// The points of the search box that experiments are looked at, the middle first.
    pub(super) points: Vec<Vec<f64>>,
    /// The triangle of the information, columns of the unknowns before those of the assumptions.
    pub(super) known: Triangle,
    /// The columns in the order of elimination: assumptions, other unknowns, wanted ones.
    pub(super) order: Vec<usize>,
    /// Places of the wanted unknowns.
    pub(super) wanted: Vec<usize>,
    /// |dvalue/dposition| of each unknown at the first point.
    pub(super) slopes: Vec<f64>,
}

impl Present {
    /// What is known by priors, tolerances and an earlier estimate, where there is one, of a problem
    /// whose unknowns are at `positions`; `wanted` are the places of those that matter.
    ///
    /// # Errors
    /// When the stop flag was raised, or the earlier experiments cannot be simulated.
    pub fn new(
        next: &Problem,
        positions: &[f64],
        wanted: Vec<usize>,
        past: Option<&Past>,
        stop: &AtomicBool,
    ) -> Result<Present, SensitivityError> {
        let unknowns = positions.len();
        let columns = unknowns + next.assumptions.len();
        let others = (0..unknowns).filter(|index| !wanted.contains(index));
        let order = (unknowns..columns).chain(others);
        let mut present = Present {
            points: vec![positions.to_vec()],
            known: beside_data(next, positions),
            order: order.chain(wanted.iter().copied()).collect(),
            wanted,
            slopes: next
                .coordinates
                .iter()
                .zip(positions)
                .map(|(coordinate, position)| coordinate.slope(*position).abs())
                .collect(),
        };
        if let Some(past) = past {
            let rows = triangle(&past.problem, positions, &past.weights, stop)?;
            let share = present.share(&rows, past);
            let rows = with_zero_right(&(rows.factor() * share));
            present.known.push(&rows);
        }
        Ok(present)
    }

    /// Adds what is measured in any case: an experiment at the first point.
    ///
    /// # Errors
    /// When the stop flag was raised, or the experiment cannot be simulated.
    pub fn measured(
        mut self,
        next: &Problem,
        experiment: Experiment,
        samples: &[usize],
        stop: &AtomicBool,
    ) -> Result<Present, SensitivityError> {
        let mut problem = next.clone();
        problem.experiments = Arc::new(vec![experiment]);
        let mut rows = RowGatherer::new(self.order.len());
        visit(&problem, &self.points[0], stop, |sample, _, columns| {
            for _ in samples.iter().filter(|taken| **taken == sample) {
                rows.add(columns.iter().copied(), 0.0);
            }
        })?;
        self.known = sum(&self.known, &rows.finish());
        Ok(self)
    }

    /// Adds points drawn from what is known, up to `points` in all.
    #[must_use]
    pub fn spread(mut self, next: &Problem, points: usize, seed: u64) -> Present {
        let middle = self.points[0].clone();
        let joint = self.joint_spread();
        for point in 1..points {
            let mut rng = rng::stream(seed, point as u64, Purpose::Design);
            let drawn: Vec<f64> = match &joint {
                Some(spread) => {
                    let normal = DVector::from_fn(middle.len(), |_, _| rng::normal(&mut rng));
                    let moved = spread * normal;
                    let pairs = middle.iter().zip(moved.iter());
                    pairs.map(|(middle, moved)| middle + moved).collect()
                }
                None => {
                    let places = middle.iter().enumerate();
                    let drawn = places.map(|(index, middle)| alone(next, index, *middle, &mut rng));
                    drawn.collect()
                }
            };
            let inside = |position: f64| position.clamp(MARGIN, 1.0 - MARGIN);
            self.points.push(drawn.into_iter().map(inside).collect());
        }
        self
    }

    /// How many points experiments are looked at.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.points.len()
    }

    /// The points of the search box that experiments are looked at, the middle first.
    #[must_use]
    pub fn points(&self) -> &[Vec<f64>] {
        &self.points
    }

    /// What is known of each unknown before any experiment.
    #[must_use]
    pub fn known(&self) -> Option<Vec<Known>> {
        self.known_by(&self.known)
    }

    /// Half the logarithm of the determinant of the wanted unknowns' information.
    pub(super) fn score(&self, sum: &Triangle) -> f64 {
        let factor = sum.of_columns(&self.order).factor();
        let first = self.order.len() - self.wanted.len();
        let wanted = first..self.order.len();
        wanted
            .map(|index| libm::log(factor[(index, index)].abs().max(NO_EFFECT)))
            .sum()
    }

    /// What is known of each unknown by the information at the first point.
    pub(super) fn known_by(&self, sum: &Triangle) -> Option<Vec<Known>> {
        let unknowns = self.slopes.len();
        let alone: Vec<usize> = (0..unknowns).collect();
        let all: Vec<usize> = (unknowns..self.order.len()).chain(0..unknowns).collect();
        let noise = deviations(&sum.of_columns(&alone).factor())?;
        let total = deviations(&sum.of_columns(&all).factor())?;
        let total = &total[all.len() - unknowns..];
        let fixed = |deviation: f64| (deviation < NOT_FIXED).then_some(deviation);
        let pairs = noise.iter().zip(total).zip(&self.slopes);
        Some(
            pairs
                .map(|((noise, total), slope)| Known {
                    noise: fixed(*noise).map(|deviation| deviation * slope),
                    total: fixed(*total).map(|deviation| deviation * slope),
                })
                .collect(),
        )
    }

    /// What standard normal numbers are multiplied with to be errors of all unknowns together; none
    /// where there is one of which too little is known.
    fn joint_spread(&self) -> Option<DMatrix<f64>> {
        let unknowns = self.slopes.len();
        let all: Vec<usize> = (unknowns..self.order.len()).chain(0..unknowns).collect();
        let factor = self.known.of_columns(&all).factor();
        let first = all.len() - unknowns;
        let corner = factor.view((first, first), (unknowns, unknowns));
        let corner = corner.into_owned();
        let are_known = deviations(&corner)?
            .iter()
            .all(|deviation| *deviation < 1.0);
        are_known.then(|| corner.solve_upper_triangular(&DMatrix::identity(unknowns, unknowns)))?
    }

    /// What the rows of the past are multiplied with so that no standard error that follows from
    /// them is smaller than the one that was told.
    fn share(&self, rows: &Triangle, past: &Past) -> f64 {
        let both = sum(&self.known, rows);
        let followed = self.known_by(&both).unwrap_or_default();
        let pairs = followed.iter().zip(&past.standard_errors);
        let ratios = pairs.filter_map(|(followed, told)| Some(followed.noise? / (*told)?));
        ratios
            .filter(|ratio| *ratio > 1.0 / NOT_FIXED)
            .fold(1.0, f64::min)
    }
}

/// A position of one unknown, drawn from its prior about the middle, else from its range.
fn alone(next: &Problem, index: usize, middle: f64, rng: &mut impl Rng) -> f64 {
    let coordinate = &next.coordinates[index];
    let Some(prior) = next.prior_of(index) else {
        return INNER + (1.0 - 2.0 * INNER) * rng::unit(rng);
    };
    let slope = prior.slope(coordinate.value(middle)) * coordinate.slope(middle);
    middle + rng::normal(rng) / slope
}

/// Priors, tolerances, and for every unknown a prior so weak that it tells nothing.
fn beside_data(next: &Problem, positions: &[f64]) -> Triangle {
    let unknowns = positions.len();
    let columns = unknowns + next.assumptions.len();
    let mut rows = RowGatherer::new(columns);
    let mut add = |index: usize, slope: f64| {
        let part = |column: usize| if column == index { slope } else { 0.0 };
        rows.add((0..columns).map(part), 0.0);
    };
    (0..unknowns).for_each(|index| add(index, NO_EFFECT));
    (unknowns..columns).for_each(|index| add(index, 1.0));
    for prior in next.prior_rows(positions) {
        rows.add((0..columns).map(|column| prior.slope(column)), 0.0);
    }
    rows.finish()
}
