//! Several experiments in one job, against the closed form: a lag that starts elsewhere each time.
//! Its output is linear in the gain and in both starts, so least squares can be written down.

use crate::run::run;
use greybox::dataset::{Recording, Signal, TimeAxis};
use greybox::job::Outcome;
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
const DECLARED: f64 = 0.5;
const GAIN: f64 = 2.0;
const STARTS: [f64; 2] = [3.0, -1.5];

/// The columns of the gain and of both starts, and what was measured.
struct Data {
    columns: DMatrix<f64>,
    measured: DVector<f64>,
    recording: Recording,
}

fn record() -> Data {
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
            free *= decay;
        }
    }
    let truth = DVector::from_vec(vec![GAIN, STARTS[0], STARTS[1]]);
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
fn job(experiments: &[usize]) -> Value {
    let cut = |experiment: &usize| {
        let from = if *experiment == 0 { 0 } else { SAMPLES[0] };
        let to = from + SAMPLES[*experiment] - 1;
        json!({
            "window": {"from_s": SAMPLE_TIME * from as f64, "to_s": SAMPLE_TIME * to as f64},
            "initial_state": {"x": {"estimate": {"lower": -10, "upper": 10}}},
        })
    };
    json!({
        "model": {
            "name": "lag",
            "inputs": {"u": {"unit": "1"}},
            "parameters": {"gain": {"unit": "1", "default": 1, "lower": 0, "upper": 10, "unknown": true}},
            "constants": {"T": {"unit": "s", "value": TIME_CONSTANT}},
            "states": {"x": {"unit": "1", "derivative": "(gain*u - x)/T", "initial": 0}},
            "outputs": {"y": {"unit": "1", "expression": "x"}}
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

#[test]
fn the_joint_estimate_of_two_experiments_is_that_of_least_squares_and_better_than_each_alone() {
    let data = record();
    let information = data.columns.transpose() * &data.columns;
    let covariance = information.try_inverse().expect("three columns apart");
    let expected = &covariance * data.columns.transpose() * &data.measured;
    let errors: Vec<f64> = (0..3)
        .map(|n| DECLARED * covariance[(n, n)].sqrt())
        .collect();

    let joint = run(job(&[0, 1]), data.recording.clone());
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

    // The starts are each experiment's own, so the information about the gain adds up.
    let (_, together) = gain(&joint);
    let alone = [0, 1].map(|one| gain(&run(job(&[one]), data.recording.clone())).1);
    let sum: f64 = alone.iter().map(|error| error.powi(-2)).sum();
    assert!(
        (together.powi(-2) / sum - 1.0).abs() < 1e-3,
        "{together} from {alone:?}"
    );
    assert!(alone.iter().all(|error| *error > together));
}

#[test]
fn an_experiment_that_only_validates_leaves_the_estimate_as_it_is_and_judges_it() {
    let data = record();
    let alone = run(job(&[0]), data.recording.clone());
    for intervals in ["fisher", "bootstrap"] {
        let mut job = job(&[0, 1]);
        job["experiments"][1]["role"] = json!("validation");
        job["experiments"][1]["initial_state"]["x"] = json!(STARTS[1]);
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
