//! Unknowns that change within the record, against fits to the parts of it.

use crate::budget::{NOISE, SAMPLE_TIME, SAMPLES, gain, job, normal, recording, response};
use crate::run::run;
use greybox::identification::outcome::{Rule, Trust};
use greybox::recording::{Recording, Signal};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::json;

/// The least-squares gain of some samples, and the root of their power.
fn fitted(input: &[f64], output: &[f64]) -> (f64, f64) {
    let power: f64 = input.iter().map(|x| x * x).sum();
    let product: f64 = input.iter().zip(output).map(|(x, y)| x * y).sum();
    (product / power, power.sqrt())
}

/// A gain that changes by `by` in the middle of the record, and what a fit to each half of it finds
/// the change to be, with its standard error.
fn changing_gain(by: f64, seed: u64) -> (Recording, f64, f64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (input, regressor) = response(&mut random);
    let gain = |sample: usize| if 2 * sample < SAMPLES { 0.8 } else { 0.8 + by };
    let output: Vec<f64> = regressor
        .iter()
        .enumerate()
        .map(|(sample, x)| gain(sample) * x + NOISE * normal(&mut random))
        .collect();
    let [first, second] = [0..SAMPLES / 2, SAMPLES / 2..SAMPLES]
        .map(|half| fitted(&regressor[half.clone()], &output[half]));
    let error = 1.2 * NOISE * (first.1.powi(-2) + second.1.powi(-2)).sqrt();
    let signals = vec![Signal::new("u", "1", input), Signal::new("y", "1", output)];
    let recording = recording(signals, SAMPLE_TIME, SAMPLES);
    (recording, second.0 - first.0, error)
}

#[test]
fn an_unknown_that_changes_within_the_record_is_told_with_its_size() {
    let told = |by: f64, seed: u64| {
        let (recording, change, error) = changing_gain(by, seed);
        let outcome = run(job(&json!({"gain": gain(json!({}))})), recording);
        let value = outcome.parameters[0].estimate.estimate;
        let trust = outcome.parameters[0].estimate.trust;
        let mut reasons = outcome.verdict.reasons.into_iter();
        let detail = reasons
            .find(|own| own.code == Rule::Drift)
            .map(|own| own.detail);
        (
            detail,
            trust,
            100.0 * change / value,
            (change / error).abs(),
        )
    };
    for (by, word) in [(0.12, "larger"), (-0.12, "smaller")] {
        let (detail, trust, per_cent, score) = told(by, 5);
        let detail = detail.expect("a reason");
        println!("{detail}");
        let size = format!("`gain` {word} by {:.1} ", per_cent.abs());
        assert!(detail.starts_with(&size), "{detail}: {per_cent}");
        assert!(detail.contains(&format!("({score:.0} standard")), "{score}");
        assert_eq!(trust, Some(Trust::Low));
    }
    for seed in 0..40 {
        let (detail, ..) = told(0.0, seed);
        assert_eq!(detail, None, "seed {seed}");
    }
}
