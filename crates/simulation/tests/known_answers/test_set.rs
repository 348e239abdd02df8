//! Initial value problems with known ends, as documents that say nothing of their rates.
//!
//! Where the problems and the ends come from: `scripts/test_set.py`.

use greybox_numerics::lanes::Lanes;
use greybox_simulation::batch::{self, BatchRun, Piece, Sink};
use greybox_simulation::model::document;
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate};
use serde_json::Value;
use std::sync::atomic::AtomicBool;

/// What is smaller than this counts as nothing: the smallest end of a test set's problem that is
/// more than the rest of a reaction is 1e-13.
const NOTHING: f64 = 1e-15;

fn problems() -> Vec<(String, Value)> {
    let file = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/known_answers/test_set.json"
    );
    let text = std::fs::read_to_string(file).unwrap();
    let problems: serde_json::Map<String, Value> = serde_json::from_str(&text).unwrap();
    problems.into_iter().collect()
}

struct Last(Vec<f64>);

impl Sink for Last {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        let row = &outputs[outputs.len() - self.0.len()..];
        self.0 = row.iter().map(|value| value.0[0]).collect();
    }
}

/// The ends, and the derivatives that they took.
fn end(problem: &Value, accuracy: Accuracy) -> (Vec<f64>, u64) {
    let model = document::read(&problem["document"]).unwrap().model;
    let parameters = model.description().defaults();
    let initial_state = vec![None; model.description().states.len()];
    let run = BatchRun {
        excitation: DrivingInputs {
            sample_time: problem["end"].as_f64().unwrap(),
            instants: None,
            samples: 2,
            input_set: 0,
            inputs: &[],
            accuracy,
        },
        candidates: vec![SimulatedCandidate {
            parameters: &parameters,
            initial_state: &initial_state,
        }],
        in_step: 0,
    };
    let n_outputs = model.description().outputs.len();
    let stop = AtomicBool::new(false);
    let last = |_run: usize| Last(vec![f64::NAN; n_outputs]);
    let pieces: Vec<Piece<Last>> = batch::simulate(model.plant(), &[run], &stop, last).unwrap();
    let piece = &pieces[0];
    assert_eq!(piece.failures[0], None, "it reaches its end");
    (piece.sink.0.clone(), piece.derivative_evaluations)
}

/// The fewest digits of an end.
fn digits(ends: &[f64], expected: &Value) -> f64 {
    let expected = expected.as_array().unwrap().iter();
    let each = ends.iter().zip(expected).map(|(end, expected)| {
        let expected = expected.as_f64().unwrap();
        let size = expected.abs().max(NOTHING);
        -((end - expected).abs() / size).max(1e-16).log10()
    });
    each.fold(f64::INFINITY, f64::min)
}

#[test]
fn the_ends_of_the_test_set_are_met_without_a_hint_at_any_rate() {
    let mut short = Vec::new();
    for (name, problem) in problems() {
        for (accuracy, least) in [(Accuracy::Full, 6.0), (Accuracy::Screening, 4.0)] {
            let (ends, derivatives) = end(&problem, accuracy);
            let digits = digits(&ends, &problem["ends"]);
            println!("{name} {accuracy:?}: {digits:.1} digits, {derivatives} derivatives");
            if digits < least {
                short.push((name.clone(), accuracy, digits));
            }
        }
    }
    assert!(short.is_empty(), "{short:?}");
}
