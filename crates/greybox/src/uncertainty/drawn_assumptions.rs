//! Numbers that are taken as known, drawn from what is known of them.
//!
//! Sensors and clock change the measured data to first order.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::sensors::Sensors;
use super::simulated_estimate::SimulatedEstimate;
use crate::estimation::problem::{Assumed, Assumption, Problem, Target};
use crate::estimation::sensitivity::ResidualPlace;
use greybox_numerics::rng::{self, Purpose, Rng};

/// A number outside its limits is drawn again, so many times at the most.
const DRAWS: usize = 1000;

/// The numbers that are taken as known, to be drawn from what is known of them.
#[derive(Debug)]
pub(super) struct DrawnAssumptions {
    assumptions: Arc<Vec<Assumption>>,
    sensors: Sensors,
}

impl DrawnAssumptions {
    /// Takes the assumptions of an estimate's problem. Answers nothing when `stop` was raised.
    pub fn of(estimate: &SimulatedEstimate, stop: &AtomicBool) -> Option<DrawnAssumptions> {
        let (problem, positions) = (&estimate.problem, &estimate.report.positions);
        Some(DrawnAssumptions {
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
        Assumed::Model(target) | Assumed::Probe(target) => target,
        sensor @ (Assumed::Sensor { .. } | Assumed::Clock) => {
            return correct(problem, sensor, value - assumption.value, sensors);
        }
    };
    if let Target::Parameter(parameter) = target {
        problem.parameters[parameter] = value;
        return;
    }
    let experiments = Arc::make_mut(&mut problem.experiments).iter_mut();
    for experiment in experiments.filter(|data| target.experiment() == Some(data.place)) {
        match target {
            Target::Parameter(_) => {}
            Target::ExperimentParameter { parameter, .. } => {
                let values = experiment.parameters.iter_mut();
                let same = values.filter(|(place, _)| *place == parameter);
                same.for_each(|(_, given)| *given = value);
            }
            Target::InitialState { state, .. } => experiment.initial_state[state] = Some(value),
        }
    }
}

/// Takes out of what was measured what a sensor or the clock has added, if its number is off by so
/// much.
fn correct(problem: &mut Problem, assumed: Assumed, off: f64, sensors: &Sensors) {
    let mut experiments = Arc::clone(&problem.experiments);
    let changed = Arc::make_mut(&mut experiments).iter_mut().enumerate();
    for (experiment, data) in changed {
        for (output, measured) in data.measured.iter_mut().enumerate() {
            for (sample, value) in measured.iter_mut().enumerate() {
                let place = ResidualPlace {
                    experiment,
                    sample,
                    output,
                };
                *value -= off * sensors.derivative(problem, assumed, place);
            }
        }
    }
    problem.experiments = experiments;
}
