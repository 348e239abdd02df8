//! Total uncertainty by drawing, without linear algebra.
//!
//! Every number that is taken as known is drawn from what is known of it, the noise is drawn anew,
//! and the estimate is fitted again, many times over: the propagation of distributions (JCGM
//! 101:2008, *Evaluation of measurement data – Supplement 1 to the GUM*). What the fits come to
//! stands beside the total of the budget ([`super::budget`]), which is linear. Sensors and clock
//! change the measured data to first order.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use rayon::prelude::*;

use super::bootstrap::{Bootstrap, quantile};
use super::refits::Refits;
use super::sensors::Sensors;
use crate::estimation::problem::{Assumed, Assumption, Problem, Target};
use greybox_numerics::rng::{self, Purpose, Rng};
use greybox_simulation::Accuracy;

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

/// The fits to `samples` draws of noise and assumptions, for each coordinate; none where fewer than
/// half of them could be fitted, nothing at all when `stop` was raised or the refits were cut.
#[must_use]
pub fn spreads(
    bootstrap: &Bootstrap<'_>,
    refits: &Refits,
    stop: &AtomicBool,
) -> Option<Option<Vec<Spread>>> {
    let problem = bootstrap.problem;
    let sensors = Sensors::simulate(problem, bootstrap.positions, stop)?;
    let fitted: Vec<Option<Vec<f64>>> = (0..bootstrap.samples)
        .into_par_iter()
        .map(|sample| {
            let drawn = || {
                let mut drawn = bootstrap.resampled(sample);
                let mut rng = rng::stream(bootstrap.seed, u64::from(sample), Purpose::Assumptions);
                for assumption in problem.assumptions.iter() {
                    let value = draw(assumption, &mut rng);
                    assume(&mut drawn, assumption, value, &sensors);
                }
                (drawn, bootstrap.positions.to_vec())
            };
            let name = format!("monte_carlo/{sample}");
            let refit = refits.descend(name, drawn, Accuracy::Full, stop)?;
            Some(refit.cost.map(|_| refit.positions))
        })
        .collect::<Option<_>>()?;
    let fitted: Vec<Vec<f64>> = fitted.into_iter().flatten().collect();
    if fitted.len() * 2 < bootstrap.samples as usize {
        return Some(None);
    }
    let of_coordinate = |index: usize| {
        let coordinate = &problem.coordinates[index];
        let estimate = coordinate.value(bootstrap.positions[index]);
        let values = fitted.iter().map(|own| coordinate.value(own[index]));
        let mut values: Vec<f64> = values.collect();
        values.sort_by(f64::total_cmp);
        let squares: f64 = values.iter().map(|value| (value - estimate).powi(2)).sum();
        Spread {
            standard_error: (squares / values.len() as f64).sqrt(),
            interval: (quantile(&values, 0.025), quantile(&values, 0.975)),
            samples: values.len() as u32,
        }
    };
    Some(Some(
        (0..problem.coordinates.len()).map(of_coordinate).collect(),
    ))
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
