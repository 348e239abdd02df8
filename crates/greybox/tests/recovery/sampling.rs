//! Few samples at instants of their own, with noise that grows with the value or is recorded
//! beside it: a decay of two steps, whose solution is written down here.

use crate::run::run;
use greybox::numerics::rng::normal;
use greybox::recording::{Recording, Signal, TimeAxis};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

const SEEDS: u64 = 40;
const AMOUNT: f64 = 12.0;
const FIRST_RATE: f64 = 0.9;
const SECOND_RATE: f64 = 0.12;
const SHARE: f64 = 0.05;

/// Hours after the dose at which the two are measured; never both at once.
const OF_FIRST: [f64; 9] = [0.0, 0.2, 0.45, 0.8, 1.3, 1.9, 2.6, 3.4, 4.7];
const OF_SECOND: [f64; 11] = [0.3, 0.65, 1.1, 1.7, 2.9, 4.1, 6.3, 9.2, 13.5, 18.2, 25.0];

fn first(time: f64) -> f64 {
    AMOUNT * (-FIRST_RATE * time).exp()
}

fn second(time: f64) -> f64 {
    let difference = (-SECOND_RATE * time).exp() - (-FIRST_RATE * time).exp();
    AMOUNT * FIRST_RATE / (FIRST_RATE - SECOND_RATE) * difference
}

/// Both in one recording, each missing where the other is measured; and the noise of each sample.
fn recording(seed: u64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let of = |instants: &[f64], is_first: bool| -> Vec<(f64, bool)> {
        instants
            .iter()
            .map(|instant| (*instant, is_first))
            .collect()
    };
    let mut rows = of(&OF_FIRST, true);
    rows.extend(of(&OF_SECOND, false));
    rows.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut columns = [const { Vec::new() }; 4];
    for (instant, is_first) in &rows {
        let value = if *is_first {
            first(*instant)
        } else {
            second(*instant)
        };
        let measured = value * (1.0 + SHARE * normal(&mut random));
        let here = [measured, SHARE * value];
        let gap = [f64::NAN; 2];
        let [level_1, noise_1, level_2, noise_2] = &mut columns;
        let (one, other) = if *is_first { (here, gap) } else { (gap, here) };
        level_1.push(one[0]);
        noise_1.push(one[1]);
        level_2.push(other[0]);
        noise_2.push(other[1]);
    }
    let instants = rows.iter().map(|(instant, _)| *instant).collect();
    let names = ["c1", "c1_noise", "c2", "c2_noise"];
    let signals = names.into_iter().zip(columns);
    let signals = signals.map(|(name, values)| Signal::new(name, "1", values));
    Recording::new(TimeAxis::Instants(instants), signals.collect())
}

fn job(seed: u64, outputs: &Value) -> Value {
    json!({
        "model": {
            "name": "two_steps",
            "parameters": {
                "A": {"unit": "1", "default": 10, "lower": 1, "upper": 100},
                "k1": {"unit": "1/s", "default": 0.5, "lower": 0.2, "upper": 20},
                "k2": {"unit": "1/s", "default": 0.1, "lower": 0.001, "upper": 0.2}
            },
            "states": {
                "x1": {"unit": "1", "initial": "A", "derivative": "-k1*x1"},
                "x2": {"unit": "1", "initial": 0, "derivative": "k1*x1 - k2*x2"}
            },
            "outputs": {
                "c1": {"unit": "1", "expression": "x1"},
                "c2": {"unit": "1", "expression": "x2"}
            }
        },
        "parameters": {"A": {"estimate": {}}, "k1": {"estimate": {}}, "k2": {"estimate": {}}},
        "outputs": outputs,
        "validation": {"fraction": 0},
        "seed": seed
    })
}

/// How many of the 95 % intervals hold the truth, and the mean square of the errors in standard
/// errors.
fn coverage(outputs: &Value) -> (f64, f64) {
    let (mut held, mut squares, mut count) = (0.0, 0.0, 0.0);
    for seed in 0..SEEDS {
        let outcome = run(job(seed, outputs), recording(seed));
        let truths = [("A", AMOUNT), ("k1", FIRST_RATE), ("k2", SECOND_RATE)];
        for (name, truth) in truths {
            let found = outcome.parameters.iter().find(|found| found.name == name);
            let found = &found.expect("each is estimated").estimate;
            let interval = found.confidence_interval.as_ref().expect("the data fix it");
            let is_above = interval.lower.is_none_or(|end| end <= truth);
            let holds = is_above && interval.upper.is_none_or(|end| truth <= end);
            held += f64::from(u8::from(holds));
            let error = found.standard_error.expect("the data fix it");
            squares += ((found.estimate - truth) / error).powi(2);
            count += 1.0;
        }
    }
    println!(
        "{outputs}: {held} of {count} hold, mean square {:.3}",
        squares / count
    );
    (held / count, squares / count)
}

#[test]
fn samples_of_noise_that_grows_with_the_value_are_compared_at_their_own_instants() {
    let said = json!({"noise_share": SHARE});
    let (held, square) = coverage(&json!({"c1": said, "c2": said}));
    // 120 intervals of 95 % hold in 114 ± 2.4.
    assert!(held >= 0.88 && (0.6..1.5).contains(&square));
}

#[test]
fn the_noise_of_each_sample_is_read_from_a_recorded_signal() {
    let outputs = json!({
        "c1": {"noise_signal": "c1_noise"}, "c2": {"noise_signal": "c2_noise"}
    });
    let (held, square) = coverage(&outputs);
    assert!(held >= 0.88 && (0.6..1.5).contains(&square));
}

#[test]
fn samples_that_count_alike_are_judged_worse_than_those_that_count_by_their_noise() {
    let spread = |outputs: &Value| {
        let errors = (0..SEEDS / 2).map(|seed| {
            let outcome = run(job(seed, outputs), recording(seed));
            let rate = outcome.parameters.iter().find(|found| found.name == "k2");
            let rate = rate.expect("it is estimated").estimate.estimate;
            (rate / SECOND_RATE - 1.0).powi(2)
        });
        (errors.sum::<f64>() / (SEEDS / 2) as f64).sqrt()
    };
    let said = json!({"noise_share": SHARE});
    let weighed = spread(&json!({"c1": said, "c2": said}));
    let alike = spread(&json!({}));
    println!(
        "k2 off by {:.2} % rms weighed, {:.2} % alike",
        1e2 * weighed,
        1e2 * alike
    );
    assert!(weighed < 0.8 * alike);
}
