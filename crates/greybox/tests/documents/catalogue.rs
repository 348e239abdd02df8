//! The documents of the catalogue: each finds the parameters that made a noisy recording, started
//! from its own wide box and not at the truth.

use crate::run::run;
use greybox::model::{Catalogue, Model};
use greybox::numerics::rng;
use greybox::recording::{Recording, Signal, TimeAxis};
use greybox::simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};
use serde_json::json;
use std::sync::atomic::AtomicBool;

/// A recording that a model makes of itself.
struct Trial<'a> {
    model: &'a str,
    sample_time: f64,
    inputs: Vec<Vec<f64>>,
    /// What differs from the defaults.
    truth: &'a [(&'a str, f64)],
    /// The outputs that are recorded, and the standard deviation of their noise.
    outputs: &'a [(&'a str, f64)],
    /// The largest error of an estimate, as a share of the truth (of 1 where that is 0).
    tolerance: f64,
}

/// Levels between `low` and `high`, each held for `hold` samples.
fn levels(samples: usize, hold: usize, [low, high]: [f64; 2]) -> Vec<f64> {
    let mut state = 2_463_534_242_u32;
    let mut level = 0.0;
    let step = |k: usize| {
        if k.is_multiple_of(hold) {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            level = low + (high - low) * f64::from(state) / f64::from(u32::MAX);
        }
        level
    };
    (0..samples).map(step).collect()
}

fn record(trial: &Trial<'_>, model: &Model) -> Recording {
    let description = model.description();
    let mut parameters = description.defaults();
    for (name, value) in trial.truth {
        parameters[description.parameter_index(name).expect("a parameter")] = *value;
    }
    let samples = trial.inputs[0].len();
    let excitation = DrivingInputs {
        sample_time: trial.sample_time,
        instants: None,
        samples,
        input_set: 0,
        inputs: &trial.inputs,
        accuracy: Accuracy::Full,
    };
    let states = vec![None; description.states.len()];
    let candidate = SimulatedCandidate {
        parameters: &parameters,
        initial_state: &states,
    };
    let never = AtomicBool::new(false);
    let simulated = single::outputs(model.plant(), &[(excitation, candidate)], &never);
    let simulated = simulated
        .expect("nobody stops it")
        .expect("the truth can be simulated")
        .remove(0);
    let inputs = description.inputs.iter().zip(&trial.inputs);
    let mut signals: Vec<Signal> = inputs
        .map(|(input, values)| Signal::new(&*input.name, &*input.unit, values.clone()))
        .collect();
    for (place, (name, deviation)) in (0..).zip(trial.outputs) {
        let index = description.output_index(name).expect("an output");
        let mut noise = rng::stream(7, place, rng::Purpose::Noise);
        let noisy = simulated[index]
            .iter()
            .map(|value| value + deviation * rng::normal(&mut noise));
        signals.push(Signal::new(
            *name,
            &*description.outputs[index].unit,
            noisy.collect(),
        ));
    }
    let time = TimeAxis::Uniform {
        sample_time: trial.sample_time,
        samples,
    };
    Recording::new(time, signals)
}

fn assert_recovers(trial: &Trial<'_>) {
    let catalogue = Catalogue::built_in();
    let model = catalogue
        .get(trial.model)
        .expect("a model of the catalogue");
    let recording = record(trial, model);
    let job = json!({
        "model": trial.model,
        "experiments": [{}],
        "method": {"population": 30, "generations": 60},
        "validation": {"fraction": 0},
        "seed": 3
    });
    let outcome = run(job, recording);
    let description = model.description();
    let mut faults = Vec::new();
    for parameter in &outcome.parameters {
        let index = description
            .parameter_index(&parameter.name)
            .expect("a parameter");
        let changed = trial.truth.iter().find(|(name, _)| *name == parameter.name);
        let truth = changed.map_or(description.parameters[index].default, |(_, value)| *value);
        let size = if truth == 0.0 { 1.0 } else { truth.abs() };
        let error = (parameter.estimate.estimate - truth) / size;
        println!(
            "{}: {:.5e} for {truth:.5e}, {:+.3} %",
            parameter.name,
            parameter.estimate.estimate,
            100.0 * error
        );
        if error.abs() > trial.tolerance {
            faults.push(format!("{} is {error:+.4} from the truth", parameter.name));
        }
    }
    assert!(faults.is_empty(), "{faults:?}");
}

#[test]
fn dc_motor() {
    assert_recovers(&Trial {
        model: "dc_motor",
        sample_time: 0.005,
        inputs: vec![levels(600, 25, [-12.0, 12.0])],
        truth: &[
            ("resistance", 0.8),
            ("motor_constant", 0.07),
            ("inertia", 5e-4),
            ("coulomb_friction", 0.03),
            ("viscous_friction", 4e-4),
        ],
        outputs: &[("measured_speed", 0.1), ("measured_current", 0.01)],
        tolerance: 0.03,
    });
}

#[test]
fn cascaded_tanks() {
    assert_recovers(&Trial {
        model: "cascaded_tanks",
        sample_time: 2.0,
        inputs: vec![levels(600, 20, [0.5, 3.5])],
        truth: &[
            ("upper_outlet", 0.013),
            ("lower_outlet", 0.012),
            ("pump_gain", 2.2e-3),
            ("transfer", 0.011),
            ("overflow_share", 0.3),
        ],
        // Both levels are recorded here; recovery from the lower one alone is not shown.
        outputs: &[("level", 1e-4), ("first_level", 1e-4)],
        tolerance: 0.1,
    });
}

#[test]
fn mass_spring_damper() {
    assert_recovers(&Trial {
        model: "mass_spring_damper",
        sample_time: 0.01,
        inputs: vec![levels(800, 17, [-20.0, 20.0])],
        truth: &[
            ("mass", 3.1),
            ("damping", 5.0),
            ("stiffness", 650.0),
            ("coulomb_friction", 2.2),
        ],
        outputs: &[("displacement", 2e-5)],
        tolerance: 0.02,
    });
}

#[test]
fn first_order_dead_time() {
    assert_recovers(&Trial {
        model: "first_order_dead_time",
        sample_time: 0.5,
        inputs: vec![levels(400, 23, [-1.0, 1.0])],
        truth: &[
            ("gain", -3.2),
            ("time_constant", 7.7),
            ("dead_time", 2.3),
            ("offset", 1.4),
        ],
        outputs: &[("y", 0.01)],
        tolerance: 0.03,
    });
}

#[test]
fn double_rod_cylinder() {
    assert_recovers(&Trial {
        model: "double_rod_cylinder",
        sample_time: 0.002,
        inputs: vec![levels(800, 20, [-0.8, 0.8])],
        truth: &[
            ("mass", 140.0),
            ("damping", 900.0),
            ("bulk_modulus", 9e8),
            ("flow_gain", 1.1e-7),
        ],
        outputs: &[("piston_position", 1e-5), ("measured_load_pressure", 1e4)],
        tolerance: 0.02,
    });
}

#[test]
fn heat_exchanger() {
    let shifted = |seed: usize, bounds| levels(400 + seed, 13 + seed, bounds)[seed..].to_vec();
    assert_recovers(&Trial {
        model: "heat_exchanger",
        sample_time: 5.0,
        inputs: vec![
            shifted(1, [0.05, 0.4]),
            shifted(5, [285.0, 300.0]),
            shifted(9, [320.0, 370.0]),
        ],
        truth: &[("mass", 33.0), ("transfer", 1300.0), ("loss", 60.0)],
        outputs: &[("outlet_temperature", 0.02)],
        tolerance: 0.05,
    });
}

#[test]
fn bouc_wen() {
    assert_recovers(&Trial {
        model: "bouc_wen",
        sample_time: 1.0 / 750.0,
        inputs: vec![levels(1500, 7, [-150.0, 150.0])],
        truth: &[
            ("damping", 14.0),
            ("stiffness", 4.1e4),
            ("alpha", 6.5e4),
            ("beta", 1.4e3),
            ("gamma", 0.7),
        ],
        outputs: &[("displacement", 5e-6)],
        tolerance: 0.08,
    });
}
