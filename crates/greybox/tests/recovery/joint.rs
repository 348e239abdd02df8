//! Several experiments in one job, against the closed form: a lag that starts elsewhere each time,
//! or whose sensor reads with another offset. Its output is linear in the gain, in both starts and
//! in both offsets, so least squares can be written down.

use crate::run::run;
use greybox::identification::Outcome;
use greybox::recording::{Recording, Signal, TimeAxis};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

/// Samples of the first experiment and of the second.
const SAMPLES: [usize; 2] = [300, 150];
const SAMPLE_TIME: f64 = 0.1;
const TIME_CONSTANT: f64 = 0.5;
const NOISE: f64 = 0.4;
/// What the jobs declare: more than there is in any part, so that all errors are made from it.
pub const DECLARED: f64 = 0.5;
const GAIN: f64 = 2.0;
/// What each experiment has for itself: its start, or its offset.
const OWN: [f64; 2] = [3.0, -1.5];

/// What is each experiment's own.
#[derive(Clone, Copy, PartialEq)]
pub enum Own {
    Start,
    Offset,
}

/// The columns of the gain and of what is each experiment's own, and what was measured.
pub struct Data {
    pub columns: DMatrix<f64>,
    pub measured: DVector<f64>,
    pub recording: Recording,
}

pub fn record(own: Own) -> Data {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let decay = (-SAMPLE_TIME / TIME_CONSTANT).exp();
    let samples = SAMPLES[0] + SAMPLES[1];
    let mut input = Vec::new();
    let mut columns = DMatrix::zeros(samples, 3);
    for (experiment, length) in SAMPLES.into_iter().enumerate() {
        let (mut driven, mut free) = (0.0, 1.0);
        for _ in 0..length {
            let row = input.len();
            columns[(row, 0)] = driven;
            columns[(row, 1 + experiment)] = free;
            input.push(if random.random::<bool>() { 1.0 } else { -1.0 });
            driven = decay * driven + (1.0 - decay) * input[row];
            if own == Own::Start {
                free *= decay;
            }
        }
    }
    let truth = DVector::from_vec(vec![GAIN, OWN[0], OWN[1]]);
    let noise = DVector::from_fn(samples, |_, _| {
        let sum: f64 = (0..12).map(|_| random.random::<f64>()).sum();
        NOISE * (sum - 6.0)
    });
    let measured = &columns * truth + noise;
    let time = TimeAxis::Uniform {
        sample_time: SAMPLE_TIME,
        samples,
    };
    let output = Signal::new("y", "1", measured.as_slice().to_vec());
    let recording = Recording::new(time, vec![Signal::new("u", "1", input), output]);
    Data {
        columns,
        measured,
        recording,
    }
}

/// The experiments of a job, by their places.
pub fn job(own: Own, experiments: &[usize]) -> Value {
    let unknown = json!({"estimate": {"lower": -10, "upper": 10}});
    let cut = |experiment: &usize| {
        let from = if *experiment == 0 { 0 } else { SAMPLES[0] };
        let to = from + SAMPLES[*experiment] - 1;
        let mut cut = json!({
            "window": {"from_s": SAMPLE_TIME * from as f64, "to_s": SAMPLE_TIME * to as f64},
        });
        match own {
            Own::Start => cut["initial_state"] = json!({"x": unknown}),
            Own::Offset => cut["parameters"] = json!({"offset": unknown}),
        }
        cut
    };
    json!({
        "model": {
            "name": "lag",
            "inputs": {"u": {"unit": "1"}},
            "parameters": {
                "gain": {"unit": "1", "default": 1, "lower": 0, "upper": 10, "unknown": true},
                "offset": {"unit": "1", "default": 0, "lower": -100, "upper": 100},
            },
            "constants": {"T": {"unit": "s", "value": TIME_CONSTANT}},
            "states": {"x": {"unit": "1", "derivative": "(gain*u - x)/T", "initial": 0}},
            "outputs": {"y": {"unit": "1", "expression": "x + offset"}}
        },
        "experiments": experiments.iter().map(cut).collect::<Vec<_>>(),
        "outputs": {"y": {"noise_std": DECLARED}},
        "method": {"generations": 20},
        "validation": {"fraction": 0},
        "seed": 1
    })
}

fn gain(outcome: &Outcome) -> (f64, f64) {
    let gain = &outcome.parameters[0].estimate;
    (gain.estimate, gain.standard_error.expect("an error"))
}

fn assert_is_least_squares(own: Own) {
    let data = record(own);
    let information = data.columns.transpose() * &data.columns;
    let covariance = information.try_inverse().expect("three columns apart");
    let expected = &covariance * data.columns.transpose() * &data.measured;
    let errors: Vec<f64> = (0..3)
        .map(|n| DECLARED * covariance[(n, n)].sqrt())
        .collect();

    let joint = run(job(own, &[0, 1]), data.recording.clone());
    let starts = joint.initial_states.iter().map(|state| &state.estimate);
    let all = joint
        .parameters
        .iter()
        .map(|known| &known.estimate)
        .chain(starts);
    for (place, known) in all.enumerate() {
        let distance = (known.estimate - expected[place]).abs() / errors[place];
        assert!(distance < 1e-3, "{place}: {distance} standard errors off");
        let ratio = known.standard_error.expect("an error") / errors[place];
        assert!((ratio - 1.0).abs() < 1e-3, "{place}: {ratio}");
    }

    // The rest is each experiment's own, so the information about the gain adds up.
    let (_, together) = gain(&joint);
    let alone = [0, 1].map(|one| gain(&run(job(own, &[one]), data.recording.clone())).1);
    let sum: f64 = alone.iter().map(|error| error.powi(-2)).sum();
    assert!(
        (together.powi(-2) / sum - 1.0).abs() < 1e-3,
        "{together} from {alone:?}"
    );
    assert!(alone.iter().all(|error| *error > together));
}

#[test]
fn the_joint_estimate_of_two_experiments_is_that_of_least_squares_and_better_than_each_alone() {
    assert_is_least_squares(Own::Start);
}

#[test]
fn parameters_of_single_experiments_are_estimated_beside_those_that_they_share() {
    assert_is_least_squares(Own::Offset);
}

#[test]
fn an_experiment_takes_its_own_value_of_a_parameter() {
    let data = record(Own::Offset);
    let mut job = job(Own::Offset, &[0, 1]);
    job["experiments"][0]["parameters"]["offset"] = json!({"value": OWN[0]});
    let outcome = run(job, data.recording.clone());
    let named: Vec<_> = outcome
        .parameters
        .iter()
        .map(|known| (known.name.as_str(), known.experiment))
        .collect();
    assert_eq!(named, [("gain", None), ("offset", Some(1))]);

    let known = data.columns.column(1) * OWN[0];
    let unknown = data.columns.clone().remove_column(1);
    let information = (unknown.transpose() * &unknown).try_inverse();
    let expected =
        information.expect("two columns apart") * unknown.transpose() * (&data.measured - known);
    for (known, expected) in outcome.parameters.iter().zip(expected.iter()) {
        let error = known.estimate.standard_error.expect("an error");
        let distance = (known.estimate.estimate - expected).abs() / error;
        assert!(distance < 1e-3, "{}: {distance}", known.name);
    }
}

#[test]
fn an_experiment_that_only_validates_leaves_the_estimate_as_it_is_and_judges_it() {
    let data = record(Own::Start);
    let alone = run(job(Own::Start, &[0]), data.recording.clone());
    for intervals in ["fisher", "bootstrap"] {
        let mut job = job(Own::Start, &[0, 1]);
        job["experiments"][1]["role"] = json!("validation");
        job["experiments"][1]["initial_state"]["x"] = json!(OWN[1]);
        job["uncertainty"] = json!({ "intervals": intervals });
        let checked = run(job, data.recording.clone());
        assert_eq!(gain(&checked).0, gain(&alone).0);
        assert_eq!(checked.fit.estimation["y"], alone.fit.estimation["y"]);
        let held_back = &checked.fit.validation["y"];
        assert_eq!(held_back.samples, SAMPLES[1] as u64);
        // The model is right, so what it leaves there is the noise.
        let noise = held_back.rmse.expect("residuals") / NOISE;
        assert!((0.85..1.15).contains(&noise), "{noise}");
    }
}
