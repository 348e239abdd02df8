//! Likelihoods of records with process noise, beside those of independent programs.
//!
//! The records and their likelihoods are our own: `reference.json` says for each the true values
//! and the log-likelihood at them, by a Kalman filter and by the dense normal density of the whole
//! record (equal to 1e-9), or by an extended filter with converged steps.

#![expect(clippy::unwrap_used, reason = "a test whose premise fails has failed")]

mod closed_loop;
mod records;
mod smoother;

use greybox_simulation::Accuracy;
use greybox_simulation::filter::{FilterLayout, StartVariance};
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use records::{Point, Record, RecordModel, reference};

fn rig() -> RecordModel {
    RecordModel {
        parameters: vec!["mass", "damping", "stiffness"],
        states: vec![
            ("position", "velocity", "0"),
            (
                "velocity",
                "(force - damping*velocity - stiffness*position)/mass",
                "0",
            ),
        ],
        output: "position",
        is_linear_between_samples: false,
    }
}

/// The oscillator of Van der Pol, driven.
fn oscillator() -> RecordModel {
    RecordModel {
        parameters: vec!["mu", "w2", "b"],
        states: vec![
            ("x", "v", "1"),
            ("v", "mu*(1 - x^2)*v - w2*x + b*drive", "0"),
        ],
        output: "x",
        is_linear_between_samples: false,
    }
}

/// A room behind a wall, whose inputs are linear between the samples or held.
fn room(is_linear_between_samples: bool) -> RecordModel {
    RecordModel {
        parameters: vec!["Ro", "Ri", "Cw", "Ci"],
        states: vec![
            ("wall", "((outside - wall)/Ro + (air - wall)/Ri)/Cw", "22"),
            ("air", "((wall - air)/Ri + heater)/Ci", "22"),
        ],
        output: "air",
        is_linear_between_samples,
    }
}

/// A disturbance, and how well the states are known at the start.
fn layout(acts_on: ActsOn, kind: DisturbanceKind, size: f64, starts: &[f64]) -> FilterLayout {
    FilterLayout {
        disturbances: vec![Disturbance { acts_on, kind }],
        sizes: vec![size],
        starts: starts.iter().copied().map(StartVariance::Known).collect(),
        controller: None,
        recorded: Vec::new(),
        n_inputs: 0,
        longest_step: f64::INFINITY,
        is_traced: false,
    }
}

/// The log-likelihood of a record at its true values, and that of the reference.
fn compare(
    name: &str,
    model: &RecordModel,
    layout: &FilterLayout,
    noise: impl Fn(&serde_json::Value) -> Vec<f64>,
    expected: &str,
) -> (f64, f64) {
    let reference = &reference()[name];
    let values = &reference["values"];
    let record = Record::read(name);
    let layout = FilterLayout {
        longest_step: 0.5001 * record.interval(),
        ..layout.clone()
    };
    let point = Point {
        values,
        noise: &noise(values),
        accuracy: Accuracy::Reference,
    };
    let likelihood = record.log_likelihood(model, &layout, point);
    let expected = reference[expected].as_f64().unwrap();
    println!("{name}: {likelihood} beside {expected}");
    (likelihood, expected)
}

fn number(values: &serde_json::Value, name: &str) -> f64 {
    values[name].as_f64().unwrap()
}

#[test]
fn a_white_force_has_the_likelihood_of_the_dense_density() {
    // The rate of the velocity receives force/mass.
    let layout = layout(ActsOn::Rate(1), DisturbanceKind::White, 1.0, &[0.0, 0.0]);
    let noise = |values: &serde_json::Value| {
        let strength = number(values, "strength") / number(values, "mass");
        vec![strength, number(values, "noise_std")]
    };
    let (found, expected) = compare("rig_white_force", &rig(), &layout, noise, "dense");
    assert!((found - expected).abs() < 1e-6, "{found} beside {expected}");
}

#[test]
fn a_force_with_memory_has_the_likelihood_of_the_dense_density() {
    let layout = layout(ActsOn::Rate(1), DisturbanceKind::Memory, 0.1, &[0.0, 0.0]);
    let noise = |values: &serde_json::Value| {
        let strength = number(values, "strength") / number(values, "mass");
        let time_constant = number(values, "time_constant");
        vec![strength, time_constant, number(values, "noise_std")]
    };
    let (found, expected) = compare("rig_force_with_memory", &rig(), &layout, noise, "dense");
    assert!((found - expected).abs() < 1e-6, "{found} beside {expected}");
}

#[test]
fn a_drifting_sensor_has_the_likelihood_of_the_dense_density() {
    let layout = layout(
        ActsOn::Output(0),
        DisturbanceKind::Memory,
        1e-3,
        &[0.0, 0.0],
    );
    let noise = |values: &serde_json::Value| {
        let time_constant = number(values, "time_constant");
        // The reference's strength is std·√(2/τ), the filter's std·√(2τ).
        let strength = number(values, "strength") * time_constant;
        vec![strength, time_constant, number(values, "noise_std")]
    };
    let (found, expected) = compare("rig_drifting_sensor", &rig(), &layout, noise, "dense");
    assert!((found - expected).abs() < 1e-6, "{found} beside {expected}");
}

#[test]
fn irregular_instants_and_an_uncertain_start_have_the_likelihood_of_the_dense_density() {
    let model = RecordModel {
        parameters: vec!["theta", "mu"],
        states: vec![("x", "theta*(mu - x)", "mu")],
        output: "x",
        is_linear_between_samples: false,
    };
    let layout = layout(ActsOn::Rate(0), DisturbanceKind::White, 1.0, &[0.09]);
    let noise = |values: &serde_json::Value| vec![number(values, "s"), number(values, "r")];
    let (found, expected) = compare("ou_irregular", &model, &layout, noise, "dense");
    assert!((found - expected).abs() < 1e-6, "{found} beside {expected}");
}

#[test]
fn inputs_that_move_between_irregular_samples_have_the_likelihood_of_the_dense_density() {
    let model = room(true);
    let layout = layout(ActsOn::Rate(0), DisturbanceKind::White, 1.0, &[0.0, 0.0]);
    let noise = |values: &serde_json::Value| vec![number(values, "s"), number(values, "r")];
    let (found, expected) = compare("room_first_order_hold", &model, &layout, noise, "dense");
    assert!((found - expected).abs() < 1e-6, "{found} beside {expected}");
}

#[test]
fn an_inflow_that_wanders_has_the_likelihood_of_an_extended_filter() {
    let model = RecordModel {
        parameters: vec!["gain", "a1", "a2"],
        states: vec![
            ("upper", "gain*pump - a1*sqrt(max(upper, 0))", "6"),
            (
                "lower",
                "a1*sqrt(max(upper, 0)) - a2*sqrt(max(lower, 0))",
                "6",
            ),
        ],
        output: "lower",
        is_linear_between_samples: false,
    };
    let layout = layout(ActsOn::Rate(0), DisturbanceKind::White, 1.0, &[0.0, 0.0]);
    let noise =
        |values: &serde_json::Value| vec![number(values, "strength"), number(values, "noise_std")];
    let (found, expected) = compare("tanks_inflow", &model, &layout, noise, "extended_filter");
    assert!((found - expected).abs() < 2e-2, "{found} beside {expected}");
}

#[test]
fn an_oscillator_that_is_pushed_has_the_likelihood_of_an_extended_filter() {
    let model = oscillator();
    let layout = layout(ActsOn::Rate(1), DisturbanceKind::White, 1.0, &[0.0, 0.0]);
    let noise =
        |values: &serde_json::Value| vec![number(values, "strength"), number(values, "noise_std")];
    let (found, expected) = compare("van_der_pol", &model, &layout, noise, "extended_filter");
    assert!((found - expected).abs() < 2e-2, "{found} beside {expected}");
}

#[test]
fn two_wells_have_the_likelihood_of_an_extended_filter() {
    let model = RecordModel {
        parameters: vec!["a"],
        states: vec![("x", "4*(a*x - x^3)", "1")],
        output: "x",
        is_linear_between_samples: false,
    };
    let layout = layout(ActsOn::Rate(0), DisturbanceKind::White, 1.0, &[0.0]);
    let noise =
        |values: &serde_json::Value| vec![number(values, "strength"), number(values, "noise_std")];
    let (found, expected) = compare("double_well", &model, &layout, noise, "extended_filter");
    assert!((found - expected).abs() < 2e-2, "{found} beside {expected}");
}

#[test]
fn a_missing_sample_is_a_longer_way_to_the_next() {
    let mut record = Record::read("rig_force_with_memory");
    let layout = layout(ActsOn::Rate(1), DisturbanceKind::Memory, 0.1, &[0.0, 0.0]);
    let values = &reference()["rig_force_with_memory"]["values"];
    let point = Point {
        values,
        noise: &[0.15, 0.4, 1e-4],
        accuracy: Accuracy::Reference,
    };
    // The force stands still over the samples that go.
    let (force, measured) = record.columns.split_at_mut(1);
    let stays = |sample: &usize| force[0][*sample] == force[0][*sample - 1];
    let gone: Vec<usize> = (1..measured[0].len())
        .filter(|sample| sample % 3 == 1 && stays(sample))
        .collect();
    assert!(gone.len() > 20);
    gone.iter()
        .for_each(|sample| measured[0][*sample] = f64::NAN);
    let with_gaps = record.log_likelihood(&rig(), &layout, point);
    record.remove(&gone);
    let without = record.log_likelihood(&rig(), &layout, point);
    assert!(
        (with_gaps - without).abs() < 1e-6,
        "{with_gaps} beside {without}"
    );
}

#[test]
fn a_disturbance_that_is_none_leaves_the_free_run() {
    let record = Record::read("van_der_pol");
    let layout = layout(ActsOn::Rate(1), DisturbanceKind::White, 1.0, &[0.0, 0.0]);
    let values = &reference()["van_der_pol"]["values"];
    let point = Point {
        values,
        noise: &[0.0, 0.05],
        accuracy: Accuracy::Reference,
    };
    let filtered = record.predicted(&oscillator(), Some(&layout), point);
    let free = record.predicted(&oscillator(), None, point);
    for (filtered, free) in filtered[0].iter().zip(&free[0]) {
        assert!((filtered - free).abs() < 1e-9, "{filtered} beside {free}");
    }
    assert!(filtered[1].iter().all(|variance| *variance == 0.05 * 0.05));
}

#[test]
fn a_parameter_that_wanders_is_a_state_that_is_disturbed() {
    // A force with memory on the mass, once as a parameter that wanders about 0 and once as a
    // disturbance of the velocity's rate.
    let mut with_load = rig();
    with_load.parameters.push("load");
    with_load.states[1].1 = "(force + load - damping*velocity - stiffness*position)/mass";
    let reference = &reference()["rig_force_with_memory"];
    let mut values = reference["values"].clone();
    values["load"] = 0.0.into();
    let noise = [
        number(&values, "strength"),
        number(&values, "time_constant"),
        number(&values, "noise_std"),
    ];
    let layout = layout(
        ActsOn::Parameter(3),
        DisturbanceKind::Memory,
        1.0,
        &[0.0, 0.0],
    );
    let point = Point {
        values: &values,
        noise: &noise,
        accuracy: Accuracy::Reference,
    };
    let likelihood =
        Record::read("rig_force_with_memory").log_likelihood(&with_load, &layout, point);
    let expected = reference["dense"].as_f64().unwrap();
    assert!(
        (likelihood - expected).abs() < 1e-6,
        "{likelihood} beside {expected}"
    );
    let white = FilterLayout {
        disturbances: vec![Disturbance {
            acts_on: ActsOn::Parameter(3),
            kind: DisturbanceKind::White,
        }],
        ..layout
    };
    let reference = &self::reference()["rig_white_force"];
    let mut values = reference["values"].clone();
    values["load"] = 0.0.into();
    let noise = [number(&values, "strength"), number(&values, "noise_std")];
    let point = Point {
        values: &values,
        noise: &noise,
        accuracy: Accuracy::Reference,
    };
    let likelihood = Record::read("rig_white_force").log_likelihood(&with_load, &white, point);
    let expected = reference["dense"].as_f64().unwrap();
    assert!(
        (likelihood - expected).abs() < 1e-6,
        "{likelihood} beside {expected}"
    );
}

#[test]
fn inputs_that_move_are_a_fine_staircase() {
    let moving = room(true);
    let layout = layout(ActsOn::Rate(0), DisturbanceKind::White, 1.0, &[0.0, 0.0]);
    let values = &reference()["room_first_order_hold"]["values"];
    let point = Point {
        values,
        noise: &[number(values, "s"), number(values, "r")],
        accuracy: Accuracy::Reference,
    };
    let record = Record::read("room_first_order_hold");
    let expected = record.log_likelihood(&moving, &layout, point);
    let stairs = record.with_stairs(256);
    let likelihood = stairs.log_likelihood(&room(false), &layout, point);
    // The error of the staircase falls with the square of its steps.
    assert!(
        (likelihood - expected).abs() < 1e-2,
        "{likelihood} beside {expected}"
    );
}

#[test]
fn a_million_samples_leave_no_variance_below_that_of_the_sensor() {
    let record = Record::of_zeros("force", 0.02, 1_000_000);
    let layout = layout(ActsOn::Rate(1), DisturbanceKind::Memory, 0.1, &[0.0, 0.0]);
    let values = &reference()["rig_force_with_memory"]["values"];
    let point = Point {
        values,
        noise: &[0.15, 0.4, 1e-4],
        accuracy: Accuracy::Screening,
    };
    let outputs = record.predicted(&rig(), Some(&layout), point);
    let least = 1e-4 * 1e-4;
    assert_eq!(outputs[1].len(), 1_000_000);
    assert!(outputs[1].iter().all(|variance| *variance >= least));
    // The variance has settled: a rig whose disturbance stands forgets its start.
    let [middle, end] = [outputs[1][500_000], outputs[1][999_999]];
    assert!((middle / end - 1.0).abs() < 1e-9, "{middle} beside {end}");
}

#[test]
fn a_candidate_has_the_bits_that_it_has_alone() {
    let record = Record::read("van_der_pol");
    let layout = layout(ActsOn::Rate(1), DisturbanceKind::White, 1.0, &[0.0, 0.0]);
    let values = &reference()["van_der_pol"]["values"];
    let point = Point {
        values,
        noise: &[0.3, 0.05],
        accuracy: Accuracy::Full,
    };
    let alone = record.predicted(&oscillator(), Some(&layout), point);
    let among = record.predicted_among(&oscillator(), &layout, point, &[0.5, 0.9, 1.3, 2.0, 4.0]);
    assert_eq!(alone, among);
}
