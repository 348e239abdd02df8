//! How far a parameter is trusted: by the width of its interval, and whatever noise is declared.

use crate::budget::{NOISE, SAMPLE_TIME, SAMPLES, gain, job, normal, recording, response};
use crate::run::run;
use greybox::identification::Outcome;
use greybox::identification::outcome::{Rule, Trust};
use greybox::recording::{Recording, Signal};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

/// A lag of gain 0.8 with so much noise; in each half of every ten seconds the gain is larger by
/// `swing`, an effect that no job has.
fn swinging(noise: f64, swing: f64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let (input, regressor) = response(&mut random);
    let gain = |sample: usize| if sample % 100 < 50 { 0.8 } else { 0.8 + swing };
    let samples = regressor.iter().enumerate();
    let output = samples.map(|(sample, x)| gain(sample) * x + noise * normal(&mut random));
    let output = output.collect();
    let signals = vec![Signal::new("u", "1", input), Signal::new("y", "1", output)];
    recording(signals, SAMPLE_TIME, SAMPLES)
}

/// The job of the lag with its noise declared, or not, and nothing else that acts.
fn with_noise(declared: Option<f64>) -> Value {
    let mut job = job(&json!({"gain": gain(json!({}))}));
    job["process_noise"] = json!("none");
    job["outputs"] = match declared {
        Some(noise) => json!({"y": {"noise_std": noise}}),
        None => json!({}),
    };
    job
}

fn trust(outcome: &Outcome, parameter: &str) -> Trust {
    let parameter = outcome.parameter(parameter).expect("it is free");
    parameter.estimate.trust.expect("a grade")
}

fn grade_of(outcome: &Outcome, code: Rule) -> Option<&str> {
    let mut reasons = outcome.verdict.reasons.iter();
    reasons
        .find(|reason| reason.code == code)
        .map(|reason| &*reason.detail)
}

#[test]
fn an_overstated_noise_neither_excuses_a_misfit_nor_widens_an_interval() {
    let misfit = swinging(NOISE, 0.6);
    let undeclared = run(with_noise(None), misfit.clone());
    assert_eq!(trust(&undeclared, "gain"), Trust::Low);
    // Once to about the size of what is left, once far beyond it.
    let left = undeclared.residuals["y"].noise_std;
    for declared in [left, 5.0 * left] {
        let outcome = run(with_noise(Some(declared)), misfit.clone());
        println!("{:?}", outcome.verdict);
        assert!(grade_of(&outcome, Rule::NoiseContradicted).is_some());
        assert_eq!(trust(&outcome, "gain"), Trust::Low);
    }

    // A fit above 90 %, so that noise that is not declared is no doubt.
    let noise = 0.3 * NOISE;
    let sound = swinging(noise, 0.0);
    let error = |job: Value| {
        let outcome = run(job, sound.clone());
        assert_eq!(trust(&outcome, "gain"), Trust::High);
        let told = grade_of(&outcome, Rule::NoiseContradicted).is_some();
        let error = outcome.parameters[0].estimate.standard_error;
        (told, error.expect("an error"))
    };
    let (told, honest) = error(with_noise(None));
    assert!(!told);
    let (told, overstated) = error(with_noise(Some(5.0 * noise)));
    assert!(told);
    assert!(
        (overstated / honest - 1.0).abs() < 1e-3,
        "{overstated}, {honest}"
    );
}

#[test]
fn white_residuals_above_the_declared_noise_are_a_noise_that_was_understated() {
    let outcome = run(with_noise(Some(0.4 * NOISE)), swinging(NOISE, 0.0));
    assert_eq!(trust(&outcome, "gain"), Trust::Moderate);
    let told = grade_of(&outcome, Rule::NoiseContradicted).expect("a reason");
    assert!(told.contains("white"), "{told}");
    assert_eq!(outcome.residuals["y"].noise_std_source, "estimated");
}

#[test]
fn an_interval_that_noise_makes_wide_bounds_the_grade() {
    for (noise, expected) in [(0.3, Trust::High), (1.0, Trust::Moderate)] {
        let mut job = with_noise(Some(noise));
        job["parameters"]["gain"]["estimate"]["upper"] = json!(10);
        let outcome = run(job, swinging(noise, 0.0));
        let estimate = &outcome.parameters[0].estimate;
        let share = estimate.total_standard_error.expect("an error") / estimate.estimate;
        println!("{share} {:?}", outcome.verdict);
        let by_width = match share {
            share if share > 0.5 => Trust::Low,
            share if share > 0.1 => Trust::Moderate,
            _ => Trust::High,
        };
        assert_eq!(by_width, expected, "{share}");
        assert_eq!(trust(&outcome, "gain"), expected);
        let told = grade_of(&outcome, Rule::WideInterval);
        assert_eq!(told.is_some(), expected < Trust::High);
    }
}

#[test]
fn an_offset_that_is_not_there_is_measured_by_its_range() {
    let mut job = with_noise(Some(NOISE));
    job["model"]["parameters"]["offset"] = json!({"unit": "1", "default": 0});
    job["model"]["outputs"]["y"]["expression"] = json!("x + offset");
    job["parameters"]["offset"] = json!({"estimate": {"lower": -1, "upper": 1}});
    let outcome = run(job, swinging(NOISE, 0.0));
    let offset = &outcome.parameter("offset").expect("it is free").estimate;
    let error = offset.total_standard_error.expect("an error");
    // Less than a tenth of the value by far.
    assert!(offset.estimate.abs() < 10.0 * error, "{offset:?}");
    assert_eq!(trust(&outcome, "offset"), Trust::High);
}
