//! Records whose plant is disturbed: the largest likelihood and the standard errors there, beside
//! those of an independent program.

#![expect(clippy::unwrap_used, reason = "a test whose premise fails has failed")]

mod coverage;
mod jobs;
mod nonlinear;
mod several;
mod smoothed;
mod sums;

use greybox::estimation::Problem;
use greybox::estimation::process_noise::{NoiseModel, NoiseNumber, ProcessNoise, filtered};
use greybox::estimation::refine::{descend, linearise};
use greybox::model::document;
use greybox::simulation::Accuracy;
use greybox::simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use greybox::{Identification, Recording};
use serde_json::{Map, Value, json};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A record of the folder, with its model.
struct Record {
    name: &'static str,
    input: &'static str,
    output: &'static str,
    /// The unknowns of the plant.
    unknowns: Vec<&'static str>,
    states: Value,
    acts_on: ActsOn,
    kind: DisturbanceKind,
}

const FOLDER: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../simulation/tests/process_noise"
);

impl Record {
    fn reference(&self) -> Value {
        let path = Path::new(FOLDER).join("reference.json");
        let text = std::fs::read_to_string(path).unwrap();
        serde_json::from_str::<Value>(&text).unwrap()[self.name].clone()
    }

    /// A range of a factor of 10 to both sides of the true value.
    fn range(&self, unknown: &str) -> [f64; 2] {
        let value = self.reference()["values"][unknown].as_f64().unwrap();
        [value / 10.0, value * 10.0]
    }

    fn problem(&self) -> Problem {
        let parameters = self.unknowns.iter().map(|name| {
            let [lower, upper] = self.range(name);
            let range = json!({
                "unit": "1", "default": lower, "lower": lower, "upper": upper,
                "scale": "log", "unknown": true
            });
            ((*name).to_owned(), range)
        });
        let mut parameters: Map<String, Value> = parameters.collect();
        parameters.insert(
            "load".to_owned(),
            json!({"unit": "1", "default": 0, "lower": -1, "upper": 1, "scale": "linear"}),
        );
        let document = json!({
            "name": "record",
            "title": "record",
            "inputs": {self.input: {"unit": "1"}},
            "parameters": parameters,
            "states": self.states,
            "outputs": {self.output: {"unit": "1", "expression": self.output}},
        });
        let read = document::read(&document).unwrap_or_else(|faults| panic!("{faults:#?}"));
        let file = Path::new(FOLDER).join(format!("{}.csv", self.name));
        let text = std::fs::read_to_string(file).unwrap();
        let mut lines = text.lines();
        lines.next();
        let mut columns = [const { Vec::new() }; 3];
        for line in lines {
            for (column, cell) in columns.iter_mut().zip(line.split(',')) {
                column.push(cell.parse().unwrap_or(f64::NAN));
            }
        }
        let [time, input, output] = columns;
        let recording = Recording::from_samples(
            time[1] - time[0],
            [(self.input, "1", input), (self.output, "1", output)],
        );
        let identification = Identification::new(&Arc::new(read.model), recording);
        identification.hold_back(0.0).problem().unwrap()
    }

    /// The problem of the filter, whose noises are looked for within a factor to both sides of their true values.
    fn filtered(&self, factor: f64) -> Problem {
        let reference = self.reference();
        let is_remembered = self.kind == DisturbanceKind::Memory;
        let unknown = |name: &str| {
            let value = reference["values"][name].as_f64().unwrap();
            NoiseNumber::Unknown {
                lower: value / factor,
                upper: value * factor,
                prior: None,
            }
        };
        let noise = NoiseModel {
            disturbances: vec![ProcessNoise {
                name: "load".to_owned(),
                disturbance: Disturbance {
                    acts_on: self.acts_on,
                    kind: self.kind,
                },
                strength: unknown("strength"),
                time_constant: is_remembered.then(|| unknown("time_constant")),
            }],
            sensors: vec![unknown("noise_std")],
            steps: 2,
        };
        filtered(&self.problem(), &noise).unwrap()
    }

    /// Compares the maximum from a start that is off with the reference.
    fn check(&self) {
        let reference = self.reference();
        let filtered = self.filtered(10.0);
        let is_remembered = self.kind == DisturbanceKind::Memory;
        let mut names = self.unknowns.clone();
        names.push("strength");
        if is_remembered {
            names.push("time_constant");
        }
        names.push("noise_std");
        // A fifth off in turns to both sides.
        let signs = (0..names.len()).map(|index| if index % 2 == 0 { 1.0 } else { -1.0 });
        let start: Vec<f64> = signs
            .map(|sign| 0.5 + sign * 0.2_f64.ln_1p() / 100_f64.ln())
            .collect();
        let never = AtomicBool::new(false);
        let descent = descend(&filtered, start, Accuracy::Full, &never).unwrap();
        let here = linearise(&filtered, &descent.positions, Accuracy::Full, &never).unwrap();
        let factor = here.triangle.factor();
        let covariance = (factor.transpose() * &factor).try_inverse().unwrap();
        let values = filtered.values(&descent.positions);
        for (index, name) in names.iter().enumerate() {
            // The reference's strength of a drift is std·√(2/τ), the filter's std·√(2τ).
            if *name == "strength" && matches!(self.acts_on, ActsOn::Output(_)) {
                continue;
            }
            let expected = reference["estimate"][*name].as_f64().unwrap();
            let error = covariance[(index, index)].sqrt() * 100_f64.ln();
            let expected_error = reference["relative_standard_error_expected"][*name]
                .as_f64()
                .unwrap();
            let off = (values[index] / expected).ln() / expected_error;
            assert!(off.abs() < 0.05, "{name}: {off} standard errors off");
            assert!(
                (error / expected_error - 1.0).abs() < 0.06,
                "{name}: {error} beside {expected_error}"
            );
        }
    }
}

fn rig() -> Value {
    json!({
        "position": {"unit": "1", "derivative": "velocity", "initial": 0},
        "velocity": {
            "unit": "1",
            "derivative": "(force + load - damping*velocity - stiffness*position)/mass",
            "initial": 0
        }
    })
}

fn white_force() -> Record {
    Record {
        name: "rig_white_force",
        input: "force",
        output: "position",
        unknowns: vec!["mass", "damping", "stiffness"],
        states: rig(),
        acts_on: ActsOn::Parameter(3),
        kind: DisturbanceKind::White,
    }
}

/// A linear step of a logarithm is half a unit at the most: it would take 23 of them alone.
#[test]
fn noises_that_begin_a_hundred_thousand_times_too_large_are_found_in_few_iterations() {
    let (factor, too_large) = (1e6_f64, 1e5_f64);
    let filtered = white_force().filtered(factor);
    let noise = 0.5 + 0.5 * too_large.ln() / factor.ln();
    let never = AtomicBool::new(false);
    let descend_from = |noise: f64| {
        let start = vec![0.55, 0.45, 0.53, noise, noise];
        descend(&filtered, start, Accuracy::Full, &never).unwrap()
    };
    let (far, near) = (descend_from(noise), descend_from(0.52));
    println!(
        "{} iterations, {} from near",
        far.iterations, near.iterations
    );
    assert!(far.iterations <= 16, "{}", far.iterations);
    assert!((far.cost.unwrap() / near.cost.unwrap() - 1.0).abs() < 1e-8);
}

#[test]
fn a_force_with_memory_has_the_maximum_of_an_independent_program() {
    Record {
        name: "rig_force_with_memory",
        input: "force",
        output: "position",
        unknowns: vec!["mass", "damping", "stiffness"],
        states: rig(),
        acts_on: ActsOn::Parameter(3),
        kind: DisturbanceKind::Memory,
    }
    .check();
}

#[test]
fn a_white_force_has_the_maximum_of_an_independent_program() {
    white_force().check();
}

#[test]
fn a_wandering_inflow_has_the_maximum_of_an_independent_program() {
    Record {
        name: "tanks_inflow",
        input: "pump",
        output: "lower_level",
        unknowns: vec!["gain", "a1", "a2"],
        states: json!({
            "upper": {"unit": "1", "initial": 6,
                "derivative": "gain*pump + load - a1*sqrt(max(upper, 0))"},
            "lower_level": {"unit": "1", "initial": 6,
                "derivative": "a1*sqrt(max(upper, 0)) - a2*sqrt(max(lower_level, 0))"}
        }),
        acts_on: ActsOn::Parameter(3),
        kind: DisturbanceKind::White,
    }
    .check();
}

#[test]
fn an_oscillator_that_is_pushed_has_the_maximum_of_an_independent_program() {
    Record {
        name: "van_der_pol",
        input: "drive",
        output: "position",
        unknowns: vec!["mu", "w2", "b"],
        states: json!({
            "position": {"unit": "1", "initial": 1, "derivative": "v"},
            "v": {"unit": "1", "initial": 0,
                "derivative": "mu*(1 - position^2)*v - w2*position + b*drive + load"}
        }),
        acts_on: ActsOn::Parameter(3),
        kind: DisturbanceKind::White,
    }
    .check();
}

#[test]
fn a_drifting_sensor_has_the_maximum_of_an_independent_program() {
    Record {
        name: "rig_drifting_sensor",
        input: "force",
        output: "position",
        unknowns: vec!["mass", "damping", "stiffness"],
        states: rig(),
        acts_on: ActsOn::Output(0),
        kind: DisturbanceKind::Memory,
    }
    .check();
}
