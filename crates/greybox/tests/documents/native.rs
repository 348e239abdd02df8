//! The built-in models as documents: the same trajectories, to the rounding of a different order
//! of the same operations.

use crate::document;
use greybox::model::{Catalogue, Model, document};
use greybox::simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};
use std::sync::atomic::AtomicBool;

/// The defaults of the model in Rust with some of them changed, by name, in the order of `model`.
fn parameters(model: &Model, native: &Model, changed: &[(&str, f64)]) -> Vec<f64> {
    let of_name = |name: &str| {
        let changed = changed.iter().find(|(own, _)| *own == name);
        changed.map_or_else(
            || {
                let index = native.description().parameter_index(name);
                native.description().parameters[index.expect("a shared name")].default
            },
            |(_, value)| *value,
        )
    };
    let own = model.description().parameters.iter();
    own.map(|parameter| of_name(&parameter.name)).collect()
}

fn simulate(
    model: &Model,
    parameters: &[f64],
    sample_time: f64,
    input: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let excitation = DrivingInputs {
        sample_time,
        instants: None,
        samples: input[0].len(),
        input_set: 0,
        inputs: input,
        accuracy: Accuracy::Full,
    };
    let states = vec![None; model.description().states.len()];
    let candidate = SimulatedCandidate {
        parameters,
        initial_state: &states,
    };
    let never = AtomicBool::new(false);
    let outputs = single::outputs(model.plant(), &[(excitation, candidate)], &never);
    outputs
        .expect("nobody stops it")
        .expect("the simulation succeeds")
        .remove(0)
}

/// The largest difference of two trajectories as a share of the largest value.
fn difference(one: &[f64], other: &[f64]) -> f64 {
    let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
    let size = largest(&mut one.iter().map(|value| value.abs()));
    let gap = largest(&mut one.iter().zip(other).map(|(a, b)| (a - b).abs()));
    gap / size
}

/// Each takes steps of its own; those of a document err less. The servo's keep the position within
/// 0.1 µm of other integrators' (`tests/known_answers`), of a range of some millimetres.
const STEPS: f64 = 1e-5;
/// A mode that rings shows in velocity and pressures, which move little in a slow swing.
const STEPS_OF_RATES: f64 = 5e-3;

/// Steps of pseudo-random length around the middle of the stroke.
fn reference(samples: usize) -> Vec<Vec<f64>> {
    let mut state = 12_345_u32;
    let mut level = 0.07;
    let step = |k: usize| {
        if k.is_multiple_of(15) {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            level = 0.05 + 0.04 * f64::from(state >> 8) / f64::from(1 << 24);
        }
        level
    };
    vec![(0..samples).map(step).collect()]
}

/// A slow swing around the middle of the stroke.
fn swing(samples: usize) -> Vec<Vec<f64>> {
    let at = |k: usize| 0.07 + 2e-3 * libm::sin(0.05 * k as f64);
    vec![(0..samples).map(at).collect()]
}

#[test]
fn the_servo_as_a_document_moves_as_the_servo_in_rust() {
    let written = document::read(&document("single_rod_servo"));
    let written = written.unwrap_or_else(|faults| panic!("{faults:#?}"));
    assert!(written.warnings.is_empty(), "{:?}", written.warnings);
    let native = Catalogue::built_in()
        .get("single_rod_servo")
        .unwrap()
        .clone();
    let friction = vec![
        ("coulomb_friction", 100.0),
        ("stribeck_friction", 30.0),
        ("internal_leakage", 1e-12),
        ("external_leakage", 1e-13),
        ("air_fraction", 0.002),
        ("load_force", 100.0),
        ("supply_droop", 1e8),
    ];
    let imperfect = vec![
        ("valve_offset", 0.01),
        ("input_delay", 0.0134),
        ("dead_band", 0.02),
    ];
    for (changed, input) in [
        (vec![], swing(2000)),
        (imperfect.clone(), swing(2000)),
        (vec![], reference(2000)),
        (imperfect, reference(2000)),
        (friction, reference(2000)),
    ] {
        let own = simulate(
            &native,
            &parameters(&native, &native, &changed),
            0.01,
            &input,
        );
        let theirs = simulate(
            &written.model,
            &parameters(&written.model, &native, &changed),
            0.01,
            &input,
        );
        for (output, (one, other)) in own.iter().zip(&theirs).enumerate() {
            let difference = difference(one, other);
            println!("{changed:?} output {output}: {difference:.1e}");
            let bound = if output == 0 { STEPS } else { STEPS_OF_RATES };
            assert!(
                difference <= bound,
                "{changed:?} output {output}: {difference:.1e}"
            );
        }
    }
}

#[test]
fn the_drive_as_a_document_moves_as_the_drive_in_rust() {
    let written = document::read(&document("positioning_drive"))
        .unwrap()
        .model;
    let native = Catalogue::built_in()
        .get("positioning_drive")
        .unwrap()
        .clone();
    let force: Vec<f64> = reference(3000)[0]
        .iter()
        .map(|r| 4000.0 * (r - 0.07))
        .collect();
    let changed = [("input_delay", 0.0025), ("offset", -3.0)];
    let input = vec![force];
    let own = simulate(
        &native,
        &parameters(&native, &native, &changed),
        0.001,
        &input,
    );
    let theirs = simulate(
        &written,
        &parameters(&written, &native, &changed),
        0.001,
        &input,
    );
    for (one, other) in own.iter().zip(&theirs) {
        let difference = difference(one, other);
        println!("{difference:.1e}");
        assert!(difference <= STEPS, "{difference:.1e}");
    }
}
