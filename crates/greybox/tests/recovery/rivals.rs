//! The methods that the hybrid search is compared with, on a plant that is cheap: a lag, whose
//! answer to a constant input is known in closed form.

use crate::run::run;
use greybox::recording::{Recording, Signal, TimeAxis};
use serde_json::{Value, json};

const GAIN: f64 = 2.0;
const TIME_CONSTANT: f64 = 0.5;
const SAMPLE_TIME: f64 = 0.05;
const SAMPLES: usize = 200;

/// The input changes its sign every eight samples; nothing disturbs the output.
fn recording() -> Recording {
    let decay = (-SAMPLE_TIME / TIME_CONSTANT).exp();
    let input = (0..SAMPLES).map(|sample| if (sample / 8) % 2 == 0 { 1.0 } else { -1.0 });
    let input: Vec<f64> = input.collect();
    let mut output = vec![0.0];
    for sample in 1..SAMPLES {
        let driven = (1.0 - decay) * GAIN * input[sample - 1];
        output.push(decay * output[sample - 1] + driven);
    }
    let time = TimeAxis::Uniform {
        sample_time: SAMPLE_TIME,
        samples: SAMPLES,
    };
    let signals = vec![Signal::new("u", "1", input), Signal::new("y", "1", output)];
    Recording::new(time, signals)
}

fn job(method: &str, seed: u64) -> Value {
    json!({
        "model": {
            "name": "lag",
            "inputs": {"u": {"unit": "1"}},
            "parameters": {
                "gain": {"unit": "1", "default": 1, "lower": 0, "upper": 10, "unknown": true},
                "lag": {"unit": "s", "symbol": "T", "default": 1, "lower": 0.01, "upper": 10,
                        "scale": "log", "unknown": true},
            },
            "states": {"x": {"unit": "1", "initial": 0, "derivative": "(gain*u - x)/T"}},
            "outputs": {"y": {"unit": "1", "expression": "x"}},
        },
        "experiments": [{}],
        "validation": {"fraction": 0},
        // The search alone has to find what is sought.
        "method": {"name": method, "population": 12, "generations": 80,
                   "stagnation_generations": 0, "refine": false},
        "seed": seed,
    })
}

#[test]
fn the_searches_to_compare_with_find_the_unknowns_without_refinement() {
    for (method, tolerance) in [("differential_evolution", 1e-3), ("cma_es", 1e-6)] {
        for seed in 1..=3 {
            let outcome = run(job(method, seed), recording());
            let truths = [GAIN, TIME_CONSTANT];
            for (parameter, truth) in outcome.parameters.iter().zip(truths) {
                let error = (parameter.estimate.estimate / truth - 1.0).abs();
                println!("{method}, seed {seed}: {} {error:.1e}", parameter.name);
                assert!(error < tolerance, "{method}, seed {seed}: {error}");
            }
        }
    }
}
