//! One plant recorded twice, its command delayed by another time and its sensor zeroed elsewhere
//! in each: the response of a lag to a held command is written down here, sample by sample.

use crate::run::run;
use greybox::recording::{Recording, Signal, TimeAxis};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

const SAMPLES: usize = 400;
const SAMPLE_TIME: f64 = 0.1;
const GAIN: f64 = 2.0;
const TIME_CONSTANT: f64 = 0.5;
const NOISE: f64 = 0.02;
/// Neither a whole number of samples.
const DEAD_TIMES: [f64; 2] = [0.13, 0.67];
const OFFSETS: [f64; 2] = [0.4, -1.1];

/// The response to an input that holds each of its values for a sample and is delayed.
fn response(input: &[f64], dead_time: f64) -> Vec<f64> {
    let whole = (dead_time / SAMPLE_TIME).floor() as usize;
    let part = dead_time - whole as f64 * SAMPLE_TIME;
    let mut state = 0.0;
    let mut follow = |input: f64, time: f64| {
        let decay = (-time / TIME_CONSTANT).exp();
        state = decay * state + (1.0 - decay) * GAIN * input;
        state
    };
    let seen = |k: usize, age: usize| input[k.saturating_sub(age)];
    let mut response = vec![0.0];
    for k in 0..input.len() - 1 {
        follow(seen(k, whole + 1), part);
        response.push(follow(seen(k, whole), SAMPLE_TIME - part));
    }
    response
}

fn recording() -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for (dead_time, offset) in DEAD_TIMES.into_iter().zip(OFFSETS) {
        // At rest to begin with, so that nothing is on its way when the experiment starts.
        let steps = (0..SAMPLES / 8).map(|_| if random.random::<bool>() { 1.0 } else { -1.0 });
        let mut input: Vec<f64> = steps.flat_map(|step| [step; 8]).collect();
        input[..16].fill(0.0);
        for value in response(&input, dead_time) {
            let noise: f64 = (0..12).map(|_| random.random::<f64>()).sum();
            outputs.push(value + offset + NOISE * (noise - 6.0));
        }
        inputs.extend(input);
    }
    let time = TimeAxis::Uniform {
        sample_time: SAMPLE_TIME,
        samples: 2 * SAMPLES,
    };
    let signals = vec![
        Signal::new("u", "1", inputs),
        Signal::new("y", "1", outputs),
    ];
    Recording::new(time, signals)
}

fn experiment(place: usize) -> Value {
    let from = place * SAMPLES;
    json!({
        "window": {
            "from_s": SAMPLE_TIME * from as f64,
            "to_s": SAMPLE_TIME * (from + SAMPLES - 1) as f64,
        },
        "parameters": {
            "dead_time": {"estimate": {"lower": 0, "upper": 2}},
            "offset": {"estimate": {"lower": -5, "upper": 5}},
        },
    })
}

#[test]
fn each_experiment_has_its_own_dead_time_and_sensor_offset() {
    let outcome = run(
        json!({
            "model": "first_order_dead_time",
            "experiments": [experiment(0), experiment(1)],
            "outputs": {"y": {"noise_std": NOISE}},
            // From these ranges one single search in four ended in a false minimum (and said so).
            "method": {"restarts": 4},
            "validation": {"fraction": 0},
            "seed": 3,
        }),
        recording(),
    );
    let truth = [
        ("gain", None, GAIN),
        ("time_constant", None, TIME_CONSTANT),
        ("dead_time", Some(0), DEAD_TIMES[0]),
        ("dead_time", Some(1), DEAD_TIMES[1]),
        ("offset", Some(0), OFFSETS[0]),
        ("offset", Some(1), OFFSETS[1]),
    ];
    assert_eq!(outcome.parameters.len(), truth.len());
    for (name, experiment, value) in truth {
        let mut found = outcome.parameters.iter();
        let found = found
            .find(|known| known.name == name && known.experiment == experiment)
            .unwrap_or_else(|| panic!("{name} of {experiment:?}"));
        let estimate = found.estimate.estimate;
        let error = found.estimate.standard_error.expect("a standard error");
        let distance = (estimate - value) / error;
        assert!(
            distance.abs() < 3.5 && error < 0.02 * value.abs().max(0.5),
            "{name} of {experiment:?}: {estimate} ± {error}, {distance} off"
        );
    }
}
