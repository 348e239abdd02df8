//! Other values for what a problem takes as known.
//!
//! A number of the model is exchanged, and a clock stretches the time between all samples. What a
//! sensor adds is taken out of what it measured, to first order about a simulation, so that the
//! model is compared with what the plant did.

use super::sensors::{Sensors, stretch};
use crate::estimation::problem::{Assumed, Problem, Target};
use crate::estimation::sensitivity::ResidualPlace;
use greybox_simulation::single::Outputs;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Has a problem with its declared values take others, one for each assumption: numbers of the model
/// and the clock are exchanged, those of sensors only noted.
pub fn take(problem: &mut Problem, values: &[f64]) {
    let mut assumptions = Arc::clone(&problem.assumptions);
    for (assumption, value) in Arc::make_mut(&mut assumptions).iter_mut().zip(values) {
        if assumption.taken == *value {
            continue;
        }
        match assumption.target {
            Assumed::Model(target) | Assumed::Probe(target) | Assumed::Input(target) => {
                assume(problem, target, *value);
            }
            Assumed::Sensor { .. } => {}
            Assumed::Clock => {
                let experiments = Arc::make_mut(&mut problem.experiments).iter_mut();
                experiments.for_each(|experiment| stretch(experiment, value / assumption.taken));
            }
        }
        assumption.taken = *value;
    }
    problem.assumptions = assumptions;
}

/// Takes out of what was measured what sensors have added, by the values that are taken of them.
pub(super) fn correct_sensors(problem: &mut Problem, sensors: &Sensors) {
    let assumptions = Arc::clone(&problem.assumptions);
    for assumption in assumptions.iter() {
        let off = assumption.taken - assumption.value;
        if matches!(assumption.target, Assumed::Sensor { .. }) && off != 0.0 {
            correct(problem, assumption.target, off, sensors);
        }
    }
}

/// Adds to simulated outputs what sensors add, by the values that are taken of them. Answers nothing
/// when `stop` was raised.
#[must_use]
pub fn shown_by_sensors(
    problem: &Problem,
    positions: &[f64],
    mut simulated: Vec<Outputs>,
    stop: &AtomicBool,
) -> Option<Vec<Outputs>> {
    let assumptions = problem.assumptions.iter().filter(|assumption| {
        matches!(assumption.target, Assumed::Sensor { .. }) && assumption.taken != assumption.value
    });
    let moved: Vec<_> = assumptions.collect();
    if moved.is_empty() {
        return Some(simulated);
    }
    let sensors = Sensors::simulate(problem, positions, stop)?;
    let added = |place: ResidualPlace| -> f64 {
        let added = moved.iter().map(|assumption| {
            let off = assumption.taken - assumption.value;
            off * sensors.derivative(problem, assumption.target, place)
        });
        added.sum()
    };
    for (experiment, outputs) in simulated.iter_mut().enumerate() {
        for (output, measured) in problem.outputs.iter().enumerate() {
            for (sample, value) in outputs[measured.index].iter_mut().enumerate() {
                *value += added(ResidualPlace {
                    experiment,
                    sample,
                    output,
                });
            }
        }
    }
    Some(simulated)
}

/// Takes another value for a number of the model.
pub(super) fn assume(problem: &mut Problem, target: Target, value: f64) {
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
pub(super) fn correct(problem: &mut Problem, assumed: Assumed, off: f64, sensors: &Sensors) {
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
