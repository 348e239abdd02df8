//! A small plant and jobs on it: a carriage under a square wave, so light that a run of hundreds
//! of generations takes a second.

use serde_json::{Value, json};

/// Time from one sample to the next [s].
const SAMPLE_TIME: f64 = 0.02;

/// A recording of a carriage of 2 kg with 3 N·s/m of viscous friction, as it is posted.
pub fn recording(samples: usize) -> Value {
    const STEPS: usize = 10;
    let step = SAMPLE_TIME / STEPS as f64;
    let (mut position, mut velocity) = (0.0, 0.0);
    let (mut positions, mut forces) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let force = if (k / 17) % 2 == 0 { 20.0 } else { -20.0 };
        forces.push(force);
        positions.push(position);
        for _ in 0..STEPS {
            velocity += step * (force - 3.0 * velocity) / 2.0;
            position += step * velocity;
        }
    }
    json!({
        "name": "a carriage",
        "sample_time_s": SAMPLE_TIME,
        "signals": {
            "force": {"unit": "N", "values": forces},
            "position": {"unit": "m", "values": positions}
        }
    })
}

/// A job that finds the carriage's parameters.
pub fn job(dataset: &str, generations: u32, seed: u64) -> Value {
    json!({
        "model": "positioning_drive",
        "experiments": [{"dataset": dataset}],
        "parameters": {
            "mass": {"estimate": {"lower": 0.5, "upper": 10}},
            "viscous_friction": {"estimate": {"lower": 0.1, "upper": 20}},
            "coulomb_friction": {"estimate": {"lower": 0.001, "upper": 5}},
            "offset": {"value": 0}
        },
        "outputs": {"position": {"noise_std": 1e-3}},
        "method": {"population": 8, "generations": generations, "stagnation_generations": 0, "noise_floor": false},
        "uncertainty": {"tried_steps": 1},
        "seed": seed
    })
}
