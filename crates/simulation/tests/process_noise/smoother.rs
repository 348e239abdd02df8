//! What the smoother says of a record, beside the dense conditional expectation of all samples, which
//! `smoothed.py` computes with 60 digits.

use greybox_simulation::filter::{FilterLayout, SmoothedRecord, StartVariance, TracedRecord};
use greybox_simulation::model::{Model, document};
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::atomic::AtomicBool;

fn reference() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/process_noise/smoothed.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The numbers of a list; NaN where there is none.
pub fn numbers(list: &Value) -> Vec<f64> {
    let numbers = list.as_array().unwrap().iter();
    numbers
        .map(|value| value.as_f64().unwrap_or(f64::NAN))
        .collect()
}

/// An oscillator whose position and velocity are measured.
fn oscillator(start: &[f64]) -> Model {
    let plain = |default: f64| json!({"unit": "1", "default": default, "lower": -9, "upper": 9, "scale": "linear"});
    let document = json!({
        "name": "oscillator",
        "title": "oscillator",
        "inputs": {"force": {"unit": "1"}},
        "parameters": {
            "damping": plain(1.0), "stiffness": plain(1.0), "gain": plain(1.0), "load": plain(0.0)
        },
        "states": {
            "x": {"unit": "1", "derivative": "v", "initial": start[0]},
            "v": {"unit": "1", "initial": start[1],
                  "derivative": "gain*force + load - damping*v - stiffness*x"}
        },
        "outputs": {"position": {"unit": "1", "expression": "x"},
                    "velocity": {"unit": "1", "expression": "v"}},
    });
    document::read(&document).unwrap().model
}

/// A filter that has gone through a record.
struct Filtered {
    layout: FilterLayout,
    strengths: Vec<f64>,
    instants: Vec<f64>,
    inputs: Vec<Vec<f64>>,
    columns: Vec<Vec<f64>>,
}

impl Filtered {
    /// The record of the reference.
    fn of(reference: &Value) -> Filtered {
        let instants = numbers(&reference["instants"]);
        let layout = FilterLayout {
            disturbances: vec![
                Disturbance {
                    acts_on: ActsOn::Rate(1),
                    kind: DisturbanceKind::White,
                },
                Disturbance {
                    acts_on: ActsOn::Parameter(3),
                    kind: DisturbanceKind::Memory,
                },
            ],
            sizes: vec![1.0, 0.3],
            starts: numbers(&reference["start_variance"])
                .into_iter()
                .map(StartVariance::Known)
                .collect(),
            controller: None,
            recorded: Vec::new(),
            n_inputs: 1,
            longest_step: 0.06,
            is_traced: true,
        };
        let model = oscillator(&numbers(&reference["start"]));
        let time_constant = reference["time_constant"].as_f64().unwrap();
        let memory = reference["std"].as_f64().unwrap() * (2.0 * time_constant).sqrt();
        let strengths = vec![reference["strength"].as_f64().unwrap(), memory];
        let names = ["damping", "stiffness", "gain", "load"];
        let parameters = names.map(|name| reference["parameters"][name].as_f64().unwrap());
        let noise = [strengths[0], strengths[1], time_constant];
        let parameters: Vec<f64> = parameters
            .into_iter()
            .chain(noise)
            .chain(numbers(&reference["noise_std"]))
            .collect();
        let mut inputs = vec![numbers(&reference["force"])];
        inputs.extend(
            reference["measured"]
                .as_array()
                .unwrap()
                .iter()
                .map(numbers),
        );
        let candidate = SimulatedCandidate {
            parameters: &parameters,
            initial_state: &[None, None],
        };
        let mut filtered = Filtered {
            layout,
            strengths,
            instants,
            inputs,
            columns: Vec::new(),
        };
        let plant = model.filtered(&filtered.layout).unwrap();
        let stop = AtomicBool::new(false);
        let runs = [(filtered.driving(), candidate)];
        let outputs = single::outputs(plant.plant(), &runs, &stop);
        filtered.columns = outputs.unwrap().unwrap().remove(0);
        filtered
    }

    fn driving(&self) -> DrivingInputs<'_> {
        DrivingInputs {
            sample_time: 0.1,
            instants: Some(&self.instants),
            samples: self.instants.len(),
            input_set: 0,
            inputs: &self.inputs,
            accuracy: Accuracy::Reference,
        }
    }

    fn smoothed(&self) -> SmoothedRecord {
        let record = TracedRecord {
            layout: &self.layout,
            inputs: self.driving(),
            n_outputs: 2,
            strengths: &self.strengths,
            columns: &self.columns,
        };
        record.smoothed()
    }
}

/// The integrator's own errors are what is left.
pub fn assert_near(value: f64, expected: f64, what: &str) {
    assert!(
        (value - expected).abs() < 1e-9,
        "{what}: {value} beside {expected}"
    );
}

#[test]
fn smoothed_states_are_the_dense_conditional_expectation() {
    let reference = reference();
    let smoothed = Filtered::of(&reference).smoothed();
    // The load is a state of the reference.
    let paths = [
        &smoothed.states[0],
        &smoothed.states[1],
        &smoothed.disturbances[1],
    ];
    let expected = reference["smoothed"]["states"].as_array().unwrap();
    for (sample, expected) in expected.iter().enumerate() {
        for (state, path) in paths.iter().enumerate() {
            let [value, deviation] = numbers(&expected[state])[..] else {
                panic!("two numbers");
            };
            let what = format!("state {state} at sample {sample}");
            assert_near(path.values[sample], value, &what);
            assert_near(path.deviations[sample], deviation, &what);
        }
    }
}

#[test]
fn smoothed_noise_is_the_dense_conditional_expectation() {
    let reference = reference();
    let smoothed = Filtered::of(&reference).smoothed();
    let expected = reference["smoothed"]["white"].as_array().unwrap();
    let white = &smoothed.disturbances[0];
    for (sample, expected) in expected.iter().enumerate() {
        let [value, deviation, residual] = numbers(expected)[..] else {
            panic!("three numbers");
        };
        let what = format!("white noise behind sample {sample}");
        assert_near(white.values[sample], value, &what);
        assert_near(white.deviations[sample], deviation, &what);
        assert_near(smoothed.residuals[0][sample], residual, &what);
    }
    assert!(white.values.last().unwrap().is_nan());
    let expected = numbers(&reference["smoothed"]["memory"]);
    for (sample, expected) in expected.iter().enumerate() {
        let what = format!("load behind sample {sample}");
        let residual = smoothed.residuals[1][sample];
        if expected.is_nan() {
            assert!(residual.is_nan(), "{what}: {residual}");
        } else {
            assert_near(residual, *expected, &what);
        }
    }
}

/// At the last sample there is nothing to come: what the smoother says is what the filter said, corrected by
/// the sample itself.
#[test]
fn the_last_sample_is_the_filters() {
    let filtered = Filtered::of(&reference());
    let smoothed = filtered.smoothed();
    let last = filtered.instants.len() - 1;
    // The expected outputs are the states. The position is missing at the last sample.
    let [position, velocity] = [0, 1].map(|output| filtered.columns[output][last]);
    let [measured_position, measured] = [1, 2].map(|input| filtered.inputs[input][last]);
    assert!(measured_position.is_nan() && !measured.is_nan());
    let covariance = |row: usize, column: usize| filtered.columns[8 + 4 * row + column][last];
    let noise: f64 = 0.1 * 0.1;
    let variance = covariance(1, 1) + noise;
    for (state, expected) in [position, velocity].into_iter().enumerate() {
        let gain = covariance(state, 1) / variance;
        let path = &smoothed.states[state];
        assert_near(
            path.values[last],
            expected + gain * (measured - velocity),
            "value",
        );
        let left = covariance(state, state) - gain * covariance(1, state);
        assert_near(path.deviations[last], left.sqrt(), "deviation");
    }
}

/// A filter that is traced answers the expectations of a filter that is not.
#[test]
fn tracing_changes_no_expectation() {
    let reference = reference();
    let traced = Filtered::of(&reference);
    let plain = FilterLayout {
        is_traced: false,
        ..traced.layout.clone()
    };
    let model = oscillator(&numbers(&reference["start"]))
        .filtered(&plain)
        .unwrap();
    let parameters = [
        0.8,
        6.0,
        2.0,
        0.0,
        0.5,
        0.3 * 1.4_f64.sqrt(),
        0.7,
        0.02,
        0.1,
    ];
    let candidate = SimulatedCandidate {
        parameters: &parameters,
        initial_state: &[None, None],
    };
    let stop = AtomicBool::new(false);
    let outputs = single::outputs(model.plant(), &[(traced.driving(), candidate)], &stop);
    let outputs = outputs.unwrap().unwrap().remove(0);
    assert_eq!(outputs.len(), 4);
    for (plain, traced) in outputs.iter().zip(&traced.columns) {
        for (plain, traced) in plain.iter().zip(traced) {
            assert!((plain - traced).abs() < 1e-12, "{plain} beside {traced}");
        }
    }
}
