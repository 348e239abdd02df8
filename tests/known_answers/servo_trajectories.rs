//! The servo against trajectories from two independent adaptive integrators, which agree with
//! each other to 1e-10 m and 0.5 Pa (`reference/manifest.json`).

use greybox::model::{Catalogue, Model};
use greybox::simulation::batch::{self, Run, Sink};
use greybox::simulation::lanes::Lanes;
use greybox::simulation::{Accuracy, Candidate, Excitation};
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/known_answers/reference");

/// The manifest's symbols and the model's names.
const NAMES: [(&str, &str); 22] = [
    ("M", "mass"),
    ("B", "damping"),
    ("Ks", "stiffness"),
    ("Km", "bulk_modulus"),
    ("Kq", "flow_gain"),
    ("u0", "valve_offset"),
    ("ps", "supply_pressure"),
    ("pt", "return_pressure"),
    ("d0", "transition_pressure"),
    ("Fc", "coulomb_friction"),
    ("vs", "friction_velocity"),
    ("xs0", "spring_neutral_position"),
    ("ci", "internal_leakage"),
    ("A1", "piston_area"),
    ("A2", "annulus_area"),
    ("L", "stroke"),
    ("V01", "dead_volume_1"),
    ("V02", "dead_volume_2"),
    ("wv", "spool_natural_frequency"),
    ("zv", "spool_damping_ratio"),
    ("Kp", "position_gain"),
    ("db", "dead_band"),
];

struct Reference {
    parameters: Vec<f64>,
    columns: Vec<Vec<f64>>,
    input_set: usize,
}

fn servo() -> Arc<Model> {
    Catalogue::built_in()
        .get("single_rod_servo")
        .unwrap()
        .clone()
}

fn reference(name: &str) -> Reference {
    let manifest = std::fs::read_to_string(format!("{FOLDER}/manifest.json")).unwrap();
    let manifest: Value = serde_json::from_str(&manifest).unwrap();
    let entry = &manifest[name];
    let model = servo();
    let mut parameters = model.description().defaults();
    for (symbol, parameter) in NAMES {
        let index = model.description().parameter_index(parameter).unwrap();
        parameters[index] = entry["parameters"][symbol].as_f64().unwrap();
    }
    let mut reader = csv::Reader::from_path(format!("{FOLDER}/{name}.csv")).unwrap();
    let mut columns = vec![Vec::new(); 7];
    for record in reader.deserialize::<[f64; 7]>() {
        for (column, value) in columns.iter_mut().zip(record.unwrap()) {
            column.push(value);
        }
    }
    let input_set = usize::from(entry["input"] == "valve_command");
    Reference {
        parameters,
        columns,
        input_set,
    }
}

struct Recorder(Vec<Lanes>);

impl Sink for Recorder {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        self.0.extend_from_slice(outputs);
    }
}

/// Outputs of one candidate, a column for each output.
fn simulate(parameters: &[f64], input_set: usize, input: &[f64]) -> Vec<Vec<f64>> {
    let model = servo();
    let inputs = [input.to_vec()];
    let excitation = Excitation {
        sample_time: 0.01,
        samples: input.len(),
        input_set,
        inputs: &inputs,
        accuracy: Accuracy::Full,
    };
    let run = Run {
        excitation,
        candidates: vec![Candidate {
            parameters,
            initial_state: &[None; 6],
            resolved_rate: None,
        }],
    };
    let stop = AtomicBool::new(false);
    let pieces = batch::simulate(model.plant(), &[run], &stop, |_| Recorder(Vec::new())).unwrap();
    assert_eq!(pieces[0].failures[0], None);
    (0..4)
        .map(|output| {
            pieces[0]
                .sink
                .0
                .iter()
                .skip(output)
                .step_by(4)
                .map(|v| v.0[0])
                .collect()
        })
        .collect()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

fn range(values: &[f64]) -> f64 {
    let high = values.iter().copied().fold(f64::MIN, f64::max);
    high - values.iter().copied().fold(f64::MAX, f64::min)
}

fn assert_agrees(name: &str) {
    let reference = reference(name);
    let input = &reference.columns[1 + reference.input_set];
    let simulated = simulate(&reference.parameters, reference.input_set, input);
    let position = largest_difference(&simulated[0], &reference.columns[3]);
    assert!(position <= 1e-7, "{name}: position differs by {position} m");
    for (output, column) in [(2, 5), (3, 6)] {
        let share = largest_difference(&simulated[output], &reference.columns[column])
            / range(&reference.columns[column]);
        assert!(
            share <= 1e-3,
            "{name}: pressure differs by {share} of its range"
        );
    }
}

#[test]
fn the_nominal_closed_loop_agrees() {
    assert_agrees("nominal_closed_loop");
}

#[test]
fn the_closed_loop_with_friction_dead_band_offset_and_leakage_agrees() {
    assert_agrees("effects_closed_loop");
}

#[test]
fn other_parameters_under_a_recorded_valve_command_agree() {
    assert_agrees("other_parameters_valve_command");
}
