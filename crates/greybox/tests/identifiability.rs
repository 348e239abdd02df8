//! What the data could fix is forecast, and what they could not is named.

use greybox::Identification;
use greybox::demo::{self, Demo};
use greybox::identification::assemble::{self, Finding, Identifiability};
use greybox::identification::spec::Context;
use greybox::identification::{DatasetId, JobSpec};
use greybox::model::document;
use greybox::recording::{Recording, Signal, TimeAxis};
use serde_json::{Value, json};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;

/// The forecast for a job on recording A with these parameters.
fn forecast(parameters: Value) -> (Identifiability, Vec<Finding>) {
    forecast_from(parameters, json!({}))
}

/// The same, from this initial state.
fn forecast_from(parameters: Value, initial_state: Value) -> (Identifiability, Vec<Finding>) {
    let mut job = demo::job(Demo::A);
    job["experiments"][0]["initial_state"] = initial_state;
    job["parameters"] = parameters;
    let identification = Identification::of_job(job, demo::recording(Demo::A, 1)).hold_back(0.0);
    let (assembly, spec) = identification
        .assembly()
        .unwrap_or_else(|error| panic!("{error}"));
    let never = AtomicBool::new(false);
    let mut preflight = assemble::preflight(&assembly, &spec.method, &never);
    preflight.findings.clear();
    let ahead = assemble::forecast(&assembly, &mut preflight, &never);
    let findings = preflight.findings;
    let at_start = assemble::flat_directions(&assembly.problem, &never).expect("not interrupted");
    // The look of a job that begins is coarser, and sees as many.
    assert_eq!(at_start.len(), ahead.flat_directions.len(), "{at_start:?}");
    (ahead, findings)
}

/// A search range of a factor about a value, on a log scale.
fn about(value: f64, factor: f64) -> Value {
    json!({ "estimate": { "lower": value / factor, "upper": value * factor, "scale": "log" } })
}

fn four_unknowns() -> Value {
    json!({
        "mass": about(58.0, 2.0),
        "damping": about(370.0, 2.0),
        "stiffness": about(21_412.0, 2.0),
        "bulk_modulus": about(1.6009e9, 2.0),
    })
}

#[test]
fn the_predicted_errors_are_the_cramer_rao_bounds_of_an_independent_program() {
    let (ahead, findings) = forecast(four_unknowns());
    assert_eq!(findings, []);
    assert_eq!(ahead.points, 5);
    // Per cent, by another program's sensitivities at the nominal rig, two digits each.
    let expected = [
        ("mass", 58.0, 0.12),
        ("damping", 370.0, 0.23),
        ("stiffness", 21_412.0, 0.02),
        ("bulk_modulus", 1.6009e9, 0.13),
    ];
    for (name, value, per_cent) in expected {
        let prediction = ahead.predictions.iter().find(|p| p.name == name);
        let error = prediction
            .and_then(|p| p.standard_error)
            .expect("a prediction");
        let ratio = 1e2 * error / value / per_cent;
        assert!(
            (0.75..1.3).contains(&ratio),
            "{name}: {ratio} times {per_cent} %"
        );
    }
}

#[test]
fn the_budget_ahead_of_a_job_shares_out_the_error_however_far_the_middle_of_the_ranges_lies_from_the_truth()
 {
    let mut parameters = four_unknowns();
    parameters["mass"] = about(1.6 * 58.0, 2.0);
    parameters["damping"] = about(0.6 * 370.0, 2.0);
    let (ahead, _) = forecast(parameters);
    assert!(ahead.budget.len() > 1, "{:?}", ahead.budget);
    for name in ["mass", "damping", "stiffness", "bulk_modulus"] {
        let lines = ahead.budget.iter();
        let shares = lines.filter_map(|line| Some(line.contributions.get(name)?.share));
        // Noise has the rest.
        let sum: f64 = shares.sum();
        assert!(sum > 0.0 && sum < 1.0, "{name}: {sum}");
    }
}

#[test]
fn position_alone_does_not_tell_the_pressures_and_the_mass_apart() {
    let mut parameters = four_unknowns();
    parameters["flow_gain"] = about(8.91e-8, 2.0);
    parameters["supply_pressure"] = about(7e6, 2.0);
    parameters["return_pressure"] = about(1e5, 2.0);
    parameters["transition_pressure"] = about(2e4, 2.0);
    let (ahead, findings) = forecast(parameters);
    let whole = ahead
        .flat_directions
        .iter()
        .find(|words| words.contains("supply_pressure"))
        .unwrap_or_else(|| panic!("{:?}", ahead.flat_directions));
    for name in ["mass", "damping", "stiffness", "bulk_modulus", "flow_gain"] {
        assert!(whole.contains(name), "{name}: {whole}");
    }
    assert!(
        findings
            .iter()
            .any(|finding| finding.code == "not_identifiable")
    );
}

#[test]
fn a_parameter_without_any_effect_is_named() {
    // No friction, so the velocity over which its sign is smoothed does nothing.
    let mut parameters = four_unknowns();
    parameters["friction_velocity"] = about(1e-3, 5.0);
    let (ahead, findings) = forecast(parameters);
    assert_eq!(
        ahead.flat_directions.len(),
        1,
        "{:?}",
        ahead.flat_directions
    );
    assert!(ahead.flat_directions[0].contains("friction_velocity"));
    assert_eq!(findings[0].pointer, "/parameters/friction_velocity");
    let prediction = ahead
        .predictions
        .iter()
        .find(|p| p.name == "friction_velocity");
    assert_eq!(prediction.and_then(|p| p.standard_error), None);
    let mass = ahead.predictions.iter().find(|p| p.name == "mass");
    assert!(mass.and_then(|p| p.standard_error).is_some());
}

#[test]
fn two_that_act_only_together_are_named_with_what_they_share() {
    // From a given position on, a constant force and the spring's rest do the same.
    let mut parameters = four_unknowns();
    parameters["stiffness"] = json!({ "value": 21_412.0 });
    parameters["spring_neutral_position"] = json!({ "estimate": { "lower": 0.06, "upper": 0.08 } });
    parameters["load_force"] = json!({ "estimate": { "lower": -200.0, "upper": 200.0 } });
    parameters["valve_offset"] = json!({ "value": 0.0 });
    let (ahead, _) = forecast_from(parameters, json!({ "position": 0.07 }));
    let shared = ahead
        .flat_directions
        .iter()
        .find(|words| words.contains("spring_neutral_position") && words.contains("load_force"));
    assert!(shared.is_some(), "{:?}", ahead.flat_directions);
}

/// A resonant actuator whose leakage may be negative: in most of its box it explodes over a record
/// of 2000 s, to beyond what can be squared, without a state that is not a finite number.
#[test]
fn a_box_that_is_mostly_unstable_is_looked_at_to_the_end_and_its_failures_are_told() {
    let free = |lower: f64, upper: f64| json!({"default": 0.1, "lower": lower, "upper": upper, "unknown": true});
    let document = json!({
        "name": "resonant_actuator",
        "inputs": {"u": {}},
        "parameters": {
            "flow_gain": free(-20.0, 20.0), "leakage": free(-5.0, 5.0), "area": free(0.01, 10.0),
            "friction": free(0.0, 5.0), "start": free(-5.0, 5.0)
        },
        "states": {
            "p": {"derivative": "flow_gain*u - leakage*p - area*v", "initial": "start", "scale": 1},
            "v": {"derivative": "area*p - friction*v", "initial": 0, "scale": 1}
        },
        "outputs": {"oil": {"expression": "p"}}
    });
    let model = document::referenced(&document).unwrap_or_else(|faults| panic!("{faults:#?}"));
    let samples = 2000_u16;
    let sine = |rate: f64| (0..samples).map(|k| (rate * f64::from(k)).sin()).collect();
    let time = TimeAxis::Uniform {
        sample_time: 1.0,
        samples: usize::from(samples),
    };
    let signals = vec![
        Signal::new("u", "1", sine(0.3)),
        Signal::new("oil", "1", sine(0.7)),
    ];
    let recording = Recording::new(time, signals);
    let dataset = DatasetId::new();
    let job = json!({
        "model": model.reference(), "experiments": [{"dataset": dataset}],
        "outputs": {"oil": {"noise_std": 0.05}}, "validation": {"fraction": 0}, "seed": 1
    });
    let context = Context {
        models: vec![model.model.description()],
        datasets: &HashMap::from([(dataset, recording.summary())]),
        versions: None,
        max_duration_s: f64::INFINITY,
    };
    let spec = JobSpec::read(&job, &context).unwrap_or_else(|faults| panic!("{faults:?}"));
    let assembly = assemble::problem(&spec, &model.model, &[recording]);
    let assembly = assembly.unwrap_or_else(|faults| panic!("{faults:?}"));
    let never = AtomicBool::new(false);
    let mut preflight = assemble::preflight(&assembly, &spec.method, &never);
    preflight.findings.clear();
    let ahead = assemble::forecast(&assembly, &mut preflight, &never);
    let findings = preflight.findings;
    assert!(ahead.points < 5);
    assert!(
        findings
            .iter()
            .any(|finding| finding.code == "points_failed"),
        "{findings:?}"
    );
    let raised = AtomicBool::new(true);
    assert!(assemble::flat_directions(&assembly.problem, &raised).is_none());
}

/// A model in which some unknowns can be scaled together without an output that shows it.
struct Symmetric {
    name: &'static str,
    /// The unknowns that the symmetry moves.
    together: &'static [&'static str],
    /// Those that it does not.
    apart: &'static [&'static str],
    /// Names, derivatives and initial values.
    states: &'static [[&'static str; 3]],
    output: &'static str,
}

const SYMMETRIC: [Symmetric; 10] = [
    Symmetric {
        name: "heated_body",
        together: &["mass", "heat_capacity"],
        apart: &["loss"],
        states: &[["T", "(10*u - loss*T)/(mass*heat_capacity)", "0"]],
        output: "T",
    },
    Symmetric {
        name: "lever_and_gain",
        together: &["gain", "lever"],
        apart: &["lag"],
        states: &[["x", "(gain*lever*u - x)/lag", "0"]],
        output: "x",
    },
    Symmetric {
        name: "oscillator_without_a_known_force",
        together: &["force", "mass", "damping", "stiffness"],
        apart: &[],
        states: &[
            ["x", "v", "0"],
            ["v", "(force*u - damping*v - stiffness*x)/mass", "0"],
        ],
        output: "x",
    },
    Symmetric {
        name: "decay_of_unknown_size_and_sensitivity",
        together: &["size", "sensitivity"],
        apart: &["rate"],
        states: &[["x", "-rate*x", "size"]],
        output: "sensitivity*x",
    },
    Symmetric {
        name: "enzyme_in_unknown_units",
        together: &["vmax", "km", "size", "sensitivity"],
        apart: &[],
        states: &[["s", "-vmax*s/(km + s)", "size"]],
        output: "sensitivity*s",
    },
    Symmetric {
        name: "predators_that_nobody_counts",
        together: &["appetite", "predators"],
        apart: &["birth", "yield_rate"],
        states: &[
            ["prey", "birth*prey - appetite*prey*hunters", "1"],
            ["hunters", "yield_rate*prey*hunters - hunters", "predators"],
        ],
        output: "prey",
    },
    Symmetric {
        name: "tank_by_its_level",
        together: &["pump", "outlet", "area"],
        apart: &[],
        states: &[["h", "(pump*(u + 2) - outlet*h)/area", "1"]],
        output: "h",
    },
    Symmetric {
        name: "resistor_and_capacitor",
        together: &["resistance", "capacity"],
        apart: &["divider"],
        states: &[["v", "(divider*u - v)/(resistance*capacity)", "0"]],
        output: "v",
    },
    Symmetric {
        name: "motor_by_its_speed",
        together: &["torque_constant", "friction", "inertia"],
        apart: &[],
        states: &[["w", "(torque_constant*u - friction*w)/inertia", "0"]],
        output: "w",
    },
    Symmetric {
        name: "a_square_in_it",
        together: &["radius", "speed"],
        apart: &["size"],
        states: &[["x", "-radius^2*speed*x + 0.1*u", "size"]],
        output: "x",
    },
];

impl Symmetric {
    /// The flat directions that are forecast where every unknown has a range of 0.4 to 2.5, on the two
    /// scales by turns.
    fn flat(&self, scales: [&str; 2]) -> Vec<String> {
        let names = self.together.iter().chain(self.apart);
        let free = |(place, name): (usize, &&str)| {
            let free = json!({
                "default": 1, "lower": 0.4, "upper": 2.5, "scale": scales[place % 2], "unknown": true,
            });
            ((*name).to_owned(), free)
        };
        let state = |[name, derivative, initial]: &[&str; 3]| {
            let state = json!({"derivative": derivative, "initial": initial});
            ((*name).to_owned(), state)
        };
        let states: serde_json::Map<String, Value> = self.states.iter().map(state).collect();
        let parameters: serde_json::Map<String, Value> = names.enumerate().map(free).collect();
        let job = json!({
            "model": {
                "name": self.name, "inputs": {"u": {}}, "parameters": parameters, "states": states,
                "outputs": {"y": {"expression": self.output}},
            },
            "experiments": [{}], "outputs": {"y": {"noise_std": 0.01}},
            "validation": {"fraction": 0}, "seed": 1,
        });
        let sine = |rate: f64| (0..300).map(|k| (rate * f64::from(k)).sin()).collect();
        let time = TimeAxis::Uniform {
            sample_time: 0.05,
            samples: 300,
        };
        let signals = vec![
            Signal::new("u", "1", sine(0.05)),
            Signal::new("y", "1", sine(0.07)),
        ];
        let identification = Identification::of_job(job, Recording::new(time, signals));
        let (assembly, spec) = identification
            .assembly()
            .unwrap_or_else(|error| panic!("{}: {error}", self.name));
        let never = AtomicBool::new(false);
        let mut preflight = assemble::preflight(&assembly, &spec.method, &never);
        assemble::forecast(&assembly, &mut preflight, &never).flat_directions
    }
}

#[test]
fn every_exact_scale_symmetry_is_named_whatever_the_scales_of_its_unknowns() {
    const SCALES: [(&str, [&str; 2]); 3] = [
        ("log", ["log", "log"]),
        ("linear", ["linear", "linear"]),
        ("mixed", ["linear", "log"]),
    ];
    let mut unseen = Vec::new();
    for symmetric in &SYMMETRIC {
        for (name, scales) in SCALES {
            let flat = symmetric.flat(scales);
            let names = |words: &String| symmetric.together.iter().all(|own| words.contains(own));
            if !flat.iter().any(names) {
                unseen.push(format!("{} ({name}): {flat:?}", symmetric.name));
            }
        }
    }
    assert!(unseen.is_empty(), "{}", unseen.join("\n"));
}
