//! A rig whose controller computes its command from the true states once a sample, beside the dense normal
//! density and the dense conditional expectation of the whole record, which `closed_loop.py` computes.

use crate::smoother::{assert_near, numbers};
use greybox_simulation::filter::{
    FilterLayout, LayoutFault, SmoothedRecord, StartVariance, TracedRecord,
};
use greybox_simulation::model::{Model, document};
use greybox_simulation::program::{ActsOn, ControllerFault, Disturbance, DisturbanceKind};
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
    let sampled = json!({
        "sum": {"unit": "1", "expression": "sum + ki*(reference - position)",
                "initial": reference["sum_before"]},
        "command": {"unit": "1", "expression": "kp*(reference - position) - kd*velocity + sum"}
    });
    model(
        reference,
        "reference",
        json!({"sampled": sampled, "options": {"delay": delay}}),
    )
}

/// The rig that a command drives.
fn open_rig(reference: &Value) -> Model {
    model(reference, "command", json!({}))
}

/// The rig with an input and further sections of its document.
fn model(reference: &Value, input: &str, more: Value) -> Model {
    let plain = json!({"unit": "1", "default": 1, "lower": 1e-9, "upper": 1e9});
    let parameters: serde_json::Map<String, Value> = PARAMETERS
        .iter()
        .map(|name| ((*name).to_owned(), plain.clone()))
        .collect();
    let mut document = json!({
        "name": "rig",
        "title": "rig",
        "inputs": {input: {"unit": "1"}},
        "parameters": parameters,
        "states": {
            "position": {"unit": "1", "derivative": "velocity", "initial": reference["start"][0]},
            "velocity": {"unit": "1", "initial": reference["start"][1],
                         "derivative": "(command - damping*velocity - stiffness*position)/mass"}
        },
        "outputs": {"seen": {"unit": "1", "expression": "position"},
                    "acting": {"unit": "1", "expression": "command"}},
    });
    let sections = document.as_object_mut().unwrap();
    sections.extend(more.as_object().unwrap().clone());
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
        let model = rig(reference, &case["delay"].to_string());
        let command_strength = case["command_strength"].as_f64().unwrap();
        Filtered::prepared(&model, reference, command_strength, is_traced).run(&model, reference)
    }

    /// The filter of a model before it goes through the record.
    fn prepared(
        model: &Model,
        reference: &Value,
        command_strength: f64,
        is_traced: bool,
    ) -> Filtered {
        let number = |name: &str| reference[name].as_f64().unwrap();
        let start_variances = numbers(&reference["start_variance"]).into_iter();
        let mut disturbances = vec![Disturbance {
            acts_on: ActsOn::Rate(1),
            kind: DisturbanceKind::White,
        }];
        let mut strengths = vec![number("strength")];
        if command_strength > 0.0 {
            disturbances.push(white_command(model));
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
        let measured = reference["measured"].as_array().unwrap().iter();
        let inputs = [numbers(&reference["reference"])].into_iter();
        Filtered {
            layout,
            strengths,
            inputs: inputs.chain(measured.map(numbers)).collect(),
            columns: Vec::new(),
        }
    }

    /// Goes through the record.
    fn run(mut self, model: &Model, reference: &Value) -> Filtered {
        let parameters = PARAMETERS.map(|name| reference["parameters"][name].as_f64().unwrap());
        let noise = self.strengths.iter().copied();
        let noise = noise.chain(numbers(&reference["noise_std"]));
        let parameters: Vec<f64> = parameters.into_iter().chain(noise).collect();
        let plant = model.filtered(&self.layout).unwrap();
        let candidate = SimulatedCandidate {
            parameters: &parameters,
            initial_state: &[None, None],
        };
        let runs = [(self.driving(), candidate)];
        let outputs = single::outputs(plant.plant(), &runs, &AtomicBool::new(false));
        self.columns = outputs.unwrap().unwrap().remove(0);
        self
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
        let smoothed = filtered.smoothed();
        let samples = case["smoothed"].as_array().unwrap().iter().enumerate();
        let states = samples.flat_map(|(sample, expected)| {
            let states = smoothed.states.iter().enumerate();
            states.map(move |(state, path)| (sample, path, &expected[state], state))
        });
        for (sample, path, expected, state) in states {
            let expected = numbers(expected);
            let what = format!("delay {}, state {state}, sample {sample}", case["delay"]);
            assert_near(path.values[sample], expected[0], &what);
            assert_near(path.deviations[sample], expected[1], &what);
        }
    }
}

#[test]
fn delays_that_the_filter_cannot_carry_are_refused() {
    let reference = reference();
    let controller = |delay: &str, sample_time| rig(&reference, delay).controller(sample_time, &[]);
    let unknown = controller("damping", Some(0.1));
    assert_eq!(
        unknown.unwrap_err(),
        LayoutFault::Controller(ControllerFault::UnknownDelay)
    );
    let long = controller("0.85", Some(0.1));
    assert_eq!(
        long.unwrap_err(),
        LayoutFault::Controller(ControllerFault::LongDelay)
    );
    let uneven = controller("0.1", None);
    assert_eq!(
        uneven.unwrap_err(),
        LayoutFault::Controller(ControllerFault::UnevenSamples)
    );
    let undelayed = rig(&reference, "0");
    let at_once = undelayed.controller(Some(0.1), &[white_command(&undelayed)]);
    assert_eq!(
        at_once.unwrap_err(),
        LayoutFault::Controller(ControllerFault::WhiteAtOnce)
    );
    // Without a delay the instants do not matter.
    assert!(undelayed.controller(None, &[]).unwrap().is_some());
}

#[test]
fn a_recorded_command_drives_the_rig_as_an_input_does() {
    let mut reference = reference();
    let columns = reference["measured"].as_array_mut().unwrap();
    // No sample of the command is missing: the rig that the command drives has no controller to fill it.
    for value in columns[1].as_array_mut().unwrap() {
        if value.is_null() {
            *value = json!(0.7);
        }
    }
    let open = open_rig(&reference);
    let mut expected = Filtered::prepared(&open, &reference, 0.0, true);
    expected.inputs[0] = expected.inputs[2].clone();
    let expected = expected.run(&open, &reference);
    let expected_states = expected.smoothed().states;
    for delay in ["0", "0.1", "0.2"] {
        let controlled = rig(&reference, delay);
        let mut driven = Filtered::prepared(&controlled, &reference, 0.0, true);
        driven.layout.recorded = controlled.recorded_quantities(&[]);
        assert_eq!(driven.layout.recorded.len(), 1);
        let driven = driven.run(&controlled, &reference);
        // The position with its variance.
        for column in [0, 2] {
            assert_all_near(&driven.columns[column], &expected.columns[column], delay);
        }
        for (path, expected) in driven.smoothed().states.iter().zip(&expected_states) {
            assert_all_near(&path.values, &expected.values, delay);
            assert_all_near(&path.deviations, &expected.deviations, delay);
        }
    }
}

fn assert_all_near(values: &[f64], expected: &[f64], delay: &str) {
    assert_eq!(values.len(), expected.len());
    for (sample, (value, expected)) in values.iter().zip(expected).enumerate() {
        assert_near(
            *value,
            *expected,
            &format!("delay {delay}, sample {sample}"),
        );
    }
}

#[test]
fn what_follows_from_the_inputs_alone_is_no_controller() {
    let sampled = json!({"command": {"unit": "1", "expression": "2*reference"}});
    let driven = model(&reference(), "reference", json!({"sampled": sampled}));
    assert!(driven.recorded_quantities(&[]).is_empty());
    assert_eq!(driven.controller(Some(0.1), &[]), Ok(None));
    // A disturbance of it makes its error a state all the same.
    let disturbed = driven.controller(
        Some(0.1),
        &[Disturbance {
            kind: DisturbanceKind::Memory,
            ..white_command(&driven)
        }],
    );
    assert!(disturbed.unwrap().is_some());
}

#[test]
fn what_an_unknown_of_the_controller_decides_is_not_taken_as_recorded() {
    let controlled = rig(&reference(), "0.1");
    let place = |name: &str| controlled.description().parameter_index(name).unwrap();
    assert_eq!(controlled.recorded_quantities(&[place("mass")]).len(), 1);
    assert!(controlled.recorded_quantities(&[place("kp")]).is_empty());
}
