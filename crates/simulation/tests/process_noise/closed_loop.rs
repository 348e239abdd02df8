//! A rig whose controller computes its command from the true states once a sample, beside the dense normal
//! density and the dense conditional expectation of the whole record, which `closed_loop.py` computes.

use crate::smoother::{assert_near, numbers};
use greybox_simulation::filter::{FilterLayout, LayoutFault, StartVariance, TracedRecord};
use greybox_simulation::model::{Model, document};
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::atomic::AtomicBool;

const PARAMETERS: [&str; 6] = ["mass", "damping", "stiffness", "kp", "kd", "ki"];

fn reference() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/process_noise/closed_loop.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The rig with its controller, which has integral action and acts after a delay.
fn rig(reference: &Value, delay: &str) -> Model {
    let plain = json!({"unit": "1", "default": 1, "lower": 1e-9, "upper": 1e9});
    let parameters: serde_json::Map<String, Value> = PARAMETERS
        .iter()
        .map(|name| ((*name).to_owned(), plain.clone()))
        .collect();
    let document = json!({
        "name": "controlled_rig",
        "title": "controlled rig",
        "inputs": {"reference": {"unit": "1"}},
        "parameters": parameters,
        "sampled": {
            "sum": {"unit": "1", "expression": "sum + ki*(reference - position)",
                    "initial": reference["sum_before"]},
            "command": {"unit": "1",
                        "expression": "kp*(reference - position) - kd*velocity + sum"}
        },
        "states": {
            "position": {"unit": "1", "derivative": "velocity", "initial": reference["start"][0]},
            "velocity": {"unit": "1", "initial": reference["start"][1],
                         "derivative": "(command - damping*velocity - stiffness*position)/mass"}
        },
        "outputs": {"seen": {"unit": "1", "expression": "position"},
                    "acting": {"unit": "1", "expression": "command"}},
        "options": {"delay": delay},
    });
    let read = document::read(&document);
    read.unwrap_or_else(|faults| panic!("{faults:#?}")).model
}

/// White noise on what the controller computes.
fn white_command(model: &Model) -> Disturbance {
    Disturbance {
        acts_on: ActsOn::Sampled(model.description().sampled_index("command").unwrap()),
        kind: DisturbanceKind::White,
    }
}

/// The record as the filter expects it: for each column its samples.
struct Filtered {
    layout: FilterLayout,
    strengths: Vec<f64>,
    inputs: Vec<Vec<f64>>,
    columns: Vec<Vec<f64>>,
}

impl Filtered {
    fn of(reference: &Value, case: &Value, is_traced: bool) -> Filtered {
        let number = |name: &str| reference[name].as_f64().unwrap();
        let model = rig(reference, &case["delay"].to_string());
        let start_variances = numbers(&reference["start_variance"]).into_iter();
        let command_strength = case["command_strength"].as_f64().unwrap();
        let mut disturbances = vec![Disturbance {
            acts_on: ActsOn::Rate(1),
            kind: DisturbanceKind::White,
        }];
        let mut strengths = vec![number("strength")];
        if command_strength > 0.0 {
            disturbances.push(white_command(&model));
            strengths.push(command_strength);
        }
        let layout = FilterLayout {
            sizes: vec![1.0; disturbances.len()],
            starts: start_variances.map(StartVariance::Known).collect(),
            controller: model
                .controller(Some(number("interval")), &disturbances)
                .unwrap(),
            recorded: Vec::new(),
            n_inputs: 1,
            longest_step: 0.5001 * number("interval"),
            disturbances,
            is_traced,
        };
        let parameters = PARAMETERS.map(|name| reference["parameters"][name].as_f64().unwrap());
        let noise = strengths
            .iter()
            .copied()
            .chain(numbers(&reference["noise_std"]));
        let parameters: Vec<f64> = parameters.into_iter().chain(noise).collect();
        let measured = reference["measured"]
            .as_array()
            .unwrap()
            .iter()
            .map(numbers);
        let mut filtered = Filtered {
            layout,
            strengths,
            inputs: [numbers(&reference["reference"])]
                .into_iter()
                .chain(measured)
                .collect(),
            columns: Vec::new(),
        };
        let plant = model.filtered(&filtered.layout).unwrap();
        let candidate = SimulatedCandidate {
            parameters: &parameters,
            initial_state: &[None, None],
        };
        let runs = [(filtered.driving(), candidate)];
        let outputs = single::outputs(plant.plant(), &runs, &AtomicBool::new(false));
        filtered.columns = outputs.unwrap().unwrap().remove(0);
        filtered
    }

    fn driving(&self) -> DrivingInputs<'_> {
        DrivingInputs {
            sample_time: 0.1,
            instants: None,
            samples: self.inputs[0].len(),
            input_set: 0,
            inputs: &self.inputs,
            accuracy: Accuracy::Reference,
        }
    }

    fn log_likelihood(&self) -> f64 {
        let outputs = self.inputs[1..]
            .iter()
            .zip(&self.columns[..2])
            .zip(&self.columns[2..4]);
        let samples = outputs.flat_map(|((measured, expected), variances)| {
            measured.iter().zip(expected).zip(variances)
        });
        samples
            .filter(|((measured, _), _)| !measured.is_nan())
            .map(|((measured, expected), variance)| {
                let scale = (2.0 * std::f64::consts::PI * variance).ln();
                -0.5 * (scale + (measured - expected).powi(2) / variance)
            })
            .sum()
    }
}

#[test]
fn a_controller_that_sees_the_true_states_has_the_likelihood_of_the_dense_density() {
    let reference = reference();
    for case in reference["cases"].as_array().unwrap() {
        let filtered = Filtered::of(&reference, case, false);
        let likelihood = filtered.log_likelihood();
        let expected = case["log_likelihood"].as_f64().unwrap();
        assert!(
            (likelihood - expected).abs() < 1e-7,
            "delay {}: {likelihood} beside {expected}",
            case["delay"]
        );
    }
}

#[test]
fn smoothed_states_of_a_controlled_rig_are_the_dense_conditional_expectation() {
    let reference = reference();
    for case in reference["cases"].as_array().unwrap() {
        let filtered = Filtered::of(&reference, case, true);
        let record = TracedRecord {
            layout: &filtered.layout,
            inputs: filtered.driving(),
            n_outputs: 2,
            strengths: &filtered.strengths,
            columns: &filtered.columns,
        };
        let smoothed = record.smoothed();
        for (sample, expected) in case["smoothed"].as_array().unwrap().iter().enumerate() {
            for (state, path) in smoothed.states.iter().enumerate() {
                let [value, deviation] = numbers(&expected[state])[..] else {
                    panic!("two numbers");
                };
                let what = format!("delay {}, state {state}, sample {sample}", case["delay"]);
                assert_near(path.values[sample], value, &what);
                assert_near(path.deviations[sample], deviation, &what);
            }
        }
    }
}

#[test]
fn delays_that_the_filter_cannot_carry_are_refused() {
    let reference = reference();
    let controller = |delay: &str, sample_time| rig(&reference, delay).controller(sample_time, &[]);
    let unknown = controller("damping", Some(0.1));
    assert_eq!(unknown.unwrap_err(), LayoutFault::UnknownDelay);
    let long = controller("0.85", Some(0.1));
    assert_eq!(long.unwrap_err(), LayoutFault::LongDelay);
    let uneven = controller("0.1", None);
    assert_eq!(uneven.unwrap_err(), LayoutFault::UnevenSamples);
    let undelayed = rig(&reference, "0");
    let at_once = undelayed.controller(Some(0.1), &[white_command(&undelayed)]);
    assert_eq!(at_once.unwrap_err(), LayoutFault::WhiteAtOnce);
    // Without a delay the instants do not matter.
    assert!(undelayed.controller(None, &[]).unwrap().is_some());
}
