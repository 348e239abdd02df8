//! Confidence intervals against those that can be written down: a lag whose gain acts linearly,
//! so that least squares has a closed form, looked for on scales on which it is not.

use crate::run::run;
use greybox::identification::Outcome;
use greybox::identification::outcome::{ConfidenceInterval, Trust};
use greybox::recording::{Recording, Signal, TimeAxis};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

const SAMPLES: usize = 400;
const SAMPLE_TIME: f64 = 0.1;
const TIME_CONSTANT: f64 = 0.5;
const NOISE: f64 = 0.4;

/// What the input does through a gain of 1.
fn response(input: &[f64]) -> Vec<f64> {
    let decay = (-SAMPLE_TIME / TIME_CONSTANT).exp();
    let mut state = 0.0;
    let step = |value: &f64| {
        let before = state;
        state = decay * state + (1.0 - decay) * value;
        before
    };
    input.iter().map(step).collect()
}

/// A recording with gain `gain`, and the estimate and standard error that least squares gives.
fn recorded(gain: f64, seed: u64) -> (Recording, f64, f64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let input: Vec<f64> = (0..SAMPLES)
        .map(|_| if random.random::<bool>() { 1.0 } else { -1.0 })
        .collect();
    let regressor = response(&input);
    let mut noise = || {
        let sum: f64 = (0..12).map(|_| random.random::<f64>()).sum();
        NOISE * (sum - 6.0)
    };
    let output: Vec<f64> = regressor.iter().map(|x| gain * x + noise()).collect();
    let power: f64 = regressor.iter().map(|x| x * x).sum();
    let product: f64 = regressor.iter().zip(&output).map(|(x, y)| x * y).sum();
    let time = TimeAxis::Uniform {
        sample_time: SAMPLE_TIME,
        samples: SAMPLES,
    };
    let signals = vec![Signal::new("u", "1", input), Signal::new("y", "1", output)];
    let recording = Recording::new(time, signals);
    (recording, product / power, NOISE / power.sqrt())
}

fn job(intervals: &str, derivative: &str, parameters: Value) -> Value {
    let described: serde_json::Map<String, Value> = parameters
        .as_object()
        .expect("parameters")
        .keys()
        .map(|name| {
            (
                name.clone(),
                json!({"unit": "1", "default": 1, "unknown": true}),
            )
        })
        .collect();
    json!({
        "model": {
            "name": "lag",
            "inputs": {"u": {"unit": "1"}},
            "parameters": described,
            "constants": {"T": {"unit": "s", "value": TIME_CONSTANT}},
            "states": {"x": {"unit": "1", "derivative": derivative, "initial": 0}},
            "outputs": {"y": {"unit": "1", "expression": "x"}}
        },
        "experiments": [{}],
        "parameters": parameters,
        "outputs": {"y": {"noise_std": NOISE}},
        "method": {"generations": 20},
        "validation": {"fraction": 0},
        "uncertainty": {"intervals": intervals},
        "seed": 1
    })
}

/// The gain over two decades, on a log scale.
fn gain_range() -> Value {
    json!({"gain": {"estimate": {"lower": 0.01, "upper": 1, "scale": "log"}}})
}

fn interval(outcome: &Outcome, parameter: usize) -> ConfidenceInterval {
    let estimate = &outcome.parameters[parameter].estimate;
    estimate.confidence_interval.clone().expect("an interval")
}

#[test]
fn a_profile_is_exact_where_the_curvature_is_not() {
    // So little gain that zero is no more than three standard errors off.
    let (recording, estimate, error) = recorded(0.2, 3);
    let outcome = run(job("profile", "(gain*u - x)/T", gain_range()), recording);
    let found = interval(&outcome, 0);
    assert_eq!(found.method, "profile");
    assert!((outcome.parameters[0].estimate.estimate - estimate).abs() < 1e-3 * error);
    let (lower, upper) = (found.lower.expect("closed"), found.upper.expect("closed"));
    assert!(
        (lower - (estimate - 1.96 * error)).abs() < 0.02 * error,
        "{lower}"
    );
    assert!(
        (upper - (estimate + 1.96 * error)).abs() < 0.02 * error,
        "{upper}"
    );
    // The model is linear in its gain: the profile is a parabola.
    let profile = &outcome.parameters[0].estimate.profile;
    assert!(profile.len() > 2 && profile.is_sorted_by(|a, b| a.value <= b.value));
    for point in profile {
        let expected = ((point.value - estimate) / (1.96 * error)).powi(2);
        let off = (point.excess - expected).abs();
        assert!(off < 0.05 * expected.max(0.1), "{point:?}, not {expected}");
    }
}

#[test]
fn a_profile_is_open_where_the_data_do_not_close_it() {
    // Of a gain that may be zero the data say only what it is not larger than.
    let (recording, estimate, error) = recorded(0.1, 9);
    assert!(
        (0.02..1.9 * error).contains(&estimate),
        "{estimate} of {error}"
    );
    let outcome = run(job("profile", "(gain*u - x)/T", gain_range()), recording);
    let found = interval(&outcome, 0);
    assert_eq!(found.lower, None);
    let upper = found.upper.expect("closed");
    assert!(
        (upper - (estimate + 1.96 * error)).abs() < 0.05 * error,
        "{upper}"
    );
}

#[test]
fn a_bootstrap_comes_to_the_interval_of_the_closed_form() {
    let (recording, estimate, error) = recorded(0.5, 5);
    let outcome = run(job("bootstrap", "(gain*u - x)/T", gain_range()), recording);
    let found = interval(&outcome, 0);
    assert_eq!(found.method, "bootstrap");
    let (lower, upper) = (found.lower.expect("closed"), found.upper.expect("closed"));
    // The 2.5 % point of 200 draws has a standard error of 0.19 standard deviations.
    assert!(
        (lower - (estimate - 1.96 * error)).abs() < 0.6 * error,
        "{lower}"
    );
    assert!(
        (upper - (estimate + 1.96 * error)).abs() < 0.6 * error,
        "{upper}"
    );
}

#[test]
fn two_that_act_only_as_a_product_are_named_with_it_and_their_profiles_are_open() {
    let (recording, ..) = recorded(0.5, 7);
    let range = json!({"estimate": {"lower": 0.1, "upper": 10, "scale": "log"}});
    let parameters = json!({"lever": range, "gain": range});
    let mut job = job("profile", "(lever*gain*u - x)/T", parameters);
    job["uncertainty"]["flat_directions"] = json!("report");
    let outcome = run(job, recording);
    assert_eq!(outcome.verdict.trust, Trust::Low);
    let words = &outcome.flat_directions;
    assert_eq!(words.len(), 1, "{words:?}");
    assert!(
        words[0].contains("`gain`*`lever`") || words[0].contains("`lever`*`gain`"),
        "{words:?}"
    );
    let reasons = &outcome.verdict.reasons;
    assert!(
        reasons.iter().any(|reason| reason.detail == words[0]),
        "{reasons:?}"
    );
    for parameter in 0..2 {
        let found = interval(&outcome, parameter);
        assert!(found.lower.is_none() || found.upper.is_none(), "{found:?}");
    }
}

#[test]
fn the_change_of_an_output_is_that_of_doubling_the_value() {
    let (recording, estimate, _) = recorded(0.5, 5);
    let input = recording.signal("u").expect("the input").values.clone();
    let outcome = run(job("fisher", "(gain*u - x)/T", gain_range()), recording);
    let power: f64 = response(&input).iter().map(|x| x * x).sum();
    let expected = estimate * (power / SAMPLES as f64).sqrt();
    let change = outcome.parameters[0].estimate.output_change["y"];
    assert!(
        (change / expected - 1.0).abs() < 1e-6,
        "{change} {expected}"
    );
}
