//! Numbers that are taken as known, drawn from what is known of them.
//!
//! They are drawn together, from what the data and the tolerances leave of them about the values
//! that the estimate was made with. Sensors and clock change the measured data to first order.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::assumed_values::{assume, correct};
use super::budget::Budget;
use super::sensors::Sensors;
use super::simulated_estimate::SimulatedEstimate;
use crate::estimation::problem::{Assumed, Assumption, Problem};
use greybox_numerics::rng::{self, Purpose};
use nalgebra::DMatrix;

/// A number outside its limits is drawn again, so many times at the most.
const DRAWS: usize = 1000;

/// The numbers that are taken as known, to be drawn from what is known of them.
#[derive(Debug)]
pub(super) struct DrawnAssumptions {
    assumptions: Arc<Vec<Assumption>>,
    /// A lower triangle whose product with standard normal numbers has the covariance of the
    /// assumptions, in standard deviations of their tolerances.
    spread: DMatrix<f64>,
    sensors: Sensors,
}

impl DrawnAssumptions {
    /// Takes the assumptions of an estimate's problem, as its budget knows them. Answers nothing when
    /// `stop` was raised.
    pub fn of(
        estimate: &SimulatedEstimate,
        budget: &Budget,
        stop: &AtomicBool,
    ) -> Option<DrawnAssumptions> {
        let (problem, positions) = (&estimate.problem, &estimate.report.positions);
        let n = problem.assumptions.len();
        let cholesky = budget.covariance.clone().and_then(DMatrix::cholesky);
        let spread = cholesky.map(|cholesky| cholesky.l());
        let spread = spread.filter(|spread| spread.nrows() == n);
        Some(DrawnAssumptions {
            assumptions: Arc::clone(&problem.assumptions),
            spread: spread.unwrap_or_else(|| DMatrix::identity(n, n)),
            sensors: Sensors::simulate(problem, positions, stop)?,
        })
    }

    /// Has a drawn problem take drawn numbers as known.
    pub fn draw(&self, drawn: &mut Problem, seed: u64, sample: u32) {
        let mut rng = rng::stream(seed, u64::from(sample), Purpose::Assumptions);
        let mut normal: Vec<f64> = Vec::new();
        for (place, assumption) in self.assumptions.iter().enumerate() {
            let row = self.spread.row(place);
            let before: f64 = normal.iter().zip(row.iter()).map(|(z, by)| z * by).sum();
            let shift = |z: f64| assumption.tolerance * (before + row[place] * z);
            let [lower, upper] = assumption.limits.map(|limit| limit.unwrap_or(f64::NAN));
            // A limit that is none is below and above everything.
            let is_possible = |z: &f64| {
                let value = assumption.taken + shift(*z);
                !(value < lower || value > upper)
            };
            let mut draws = (0..DRAWS).map(|_| rng::normal(&mut rng));
            let z = draws.find(is_possible);
            let shift = z.map_or(0.0, shift);
            match assumption.target {
                Assumed::Model(target) | Assumed::Probe(target) | Assumed::Input(target) => {
                    assume(drawn, target, assumption.taken + shift);
                }
                sensor @ (Assumed::Sensor { .. } | Assumed::Clock) => {
                    correct(drawn, sensor, shift, &self.sensors);
                }
            }
            normal.push(z.unwrap_or_default());
        }
    }
}
