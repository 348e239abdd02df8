//! Total uncertainty by drawing, without linear algebra.
//!
//! Every number that is taken as known is drawn from what is known of it, the noise is drawn anew,
//! and the estimate is fitted again, many times over: the propagation of distributions (JCGM
//! 101:2008, *Evaluation of measurement data – Supplement 1 to the GUM*). What the fits come to
//! stands beside the total of the budget ([`super::budget`]), which is linear. Sensors and clock
//! change the measured data to first order.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::bootstrap::{DrawnFit, fitted, quantile};
use super::linearised::Estimate;
use super::sensors::Sensors;
use crate::estimation::problem::{Assumed, Assumption, Problem, Target};
use greybox_numerics::rng::{self, Purpose, Rng};

/// A number outside its limits is drawn again, so many times at the most.
const DRAWS: usize = 1000;

/// How the fits to drawn data and drawn assumptions lie about an estimate, SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// The root mean square of their distances from it.
    pub standard_error: f64,
    /// The range that holds 95 % of them, as many below as above.
    pub interval: (f64, f64),
    /// How many they are.
    pub samples: u32,
}

/// The numbers that are taken as known, to be drawn from what is known of them.
#[derive(Debug)]
pub(super) struct Assumptions {
    assumptions: Arc<Vec<Assumption>>,
    sensors: Sensors,
}

impl Assumptions {
    /// Takes the assumptions of an estimate's problem. Answers nothing when `stop` was raised.
    pub fn of(estimate: &Estimate, stop: &AtomicBool) -> Option<Assumptions> {
        let (problem, positions) = (&estimate.problem, &estimate.report.positions);
        Some(Assumptions {
            assumptions: Arc::clone(&problem.assumptions),
            sensors: Sensors::simulate(problem, positions, stop)?,
        })
    }

    /// Has a drawn problem take drawn numbers as known.
    pub fn draw(&self, drawn: &mut Problem, seed: u64, sample: u32) {
        let mut rng = rng::stream(seed, u64::from(sample), Purpose::Assumptions);
        for assumption in self.assumptions.iter() {
            let value = draw(assumption, &mut rng);
            assume(drawn, assumption, value, &self.sensors);
        }
    }
}

/// How refits to drawn noise and drawn assumptions lie about an estimate, for each coordinate; none
/// where fewer than half of them could be fitted.
pub(super) fn spreads(estimate: &Estimate, refits: &[DrawnFit]) -> Option<Vec<Spread>> {
    let fitted = fitted(refits)?;
    let coordinates = estimate.problem.coordinates.iter();
    let described = coordinates.zip(&estimate.report.positions).enumerate();
    let spread = described.map(|(index, (coordinate, position))| {
        let estimate = coordinate.value(*position);
        let values = fitted.iter().map(|fit| coordinate.value(fit[index]));
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let squares: f64 = values.iter().map(|value| (value - estimate).powi(2)).sum();
        Spread {
            standard_error: (squares / values.len() as f64).sqrt(),
            interval: (quantile(&values, 0.025), quantile(&values, 0.975)),
            samples: values.len() as u32,
        }
    });
    Some(spread.collect())
}

/// A value that an assumption may have: normal about what is taken, within its limits.
fn draw(assumption: &Assumption, rng: &mut impl Rng) -> f64 {
    let [lower, upper] = assumption.limits.map(|limit| limit.unwrap_or(f64::NAN));
    let mut values = (0..DRAWS).map(|_| assumption.value + assumption.tolerance * rng::normal(rng));
    // A limit that is none is below and above everything.
    let possible = |value: &f64| !(*value < lower || *value > upper);
    values.find(possible).unwrap_or(assumption.value)
}

/// Takes another value as known.
fn assume(problem: &mut Problem, assumption: &Assumption, value: f64, sensors: &Sensors) {
    let target = match assumption.target {
        Assumed::Model(target) => target,
        sensor @ (Assumed::Sensor { .. } | Assumed::Clock) => {
            return correct(problem, (sensor, value - assumption.value), sensors);
        }
    };
    if let Target::Parameter(parameter) = target {
        problem.parameters[parameter] = value;
        return;
    }
    let own = Arc::make_mut(&mut problem.experiments).iter_mut();
    for experiment in own.filter(|own| target.experiment() == Some(own.place)) {
        match target {
            Target::Parameter(_) => {}
            Target::ExperimentParameter { parameter, .. } => {
                let values = experiment.parameters.iter_mut();
                let same = values.filter(|(place, _)| *place == parameter);
                same.for_each(|(_, known)| *known = value);
            }
            Target::InitialState { state, .. } => experiment.initial_state[state] = Some(value),
        }
    }
}

/// Takes out of what was measured what a sensor or the clock has added, if its number is off by so
/// much.
fn correct(problem: &mut Problem, (assumed, off): (Assumed, f64), sensors: &Sensors) {
    let mut experiments = Arc::clone(&problem.experiments);
    let own = Arc::make_mut(&mut experiments).iter_mut().enumerate();
    for (experiment, own) in own {
        for (output, measured) in own.measured.iter_mut().enumerate() {
            for (sample, value) in measured.iter_mut().enumerate() {
                let place = (experiment, sample, output);
                *value -= off * sensors.derivative(problem, assumed, place);
            }
        }
    }
    problem.experiments = experiments;
}
