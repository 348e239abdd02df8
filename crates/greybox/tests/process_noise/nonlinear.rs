//! How often the intervals of plants that are not linear cover the truth under white noise, with the noise model
//! that the data choose.

use super::coverage::{RIGHT_SHARE, assert_chosen, assert_covers, choose, count};
use greybox::numerics::rng::{Purpose, below, normal, stream, unit};
use greybox::{Model, Recording};
use serde_json::{Value, json};
use std::sync::Arc;

/// Steps of Euler and Maruyama between two samples.
const SUBSTEPS: usize = 100;

fn unknown(value: f64) -> Value {
    json!({
        "unit": "1", "default": value, "lower": value / 10.0, "upper": value * 10.0,
        "scale": "log", "unknown": true
    })
}

fn state(derivative: &str, initial: f64) -> Value {
    json!({"unit": "1", "derivative": derivative, "initial": initial})
}

fn model(parameters: &Value, states: &Value, output: &str) -> Arc<Model> {
    let document = json!({
        "name": "plant", "title": "plant",
        "inputs": {"input": {"unit": "1"}},
        "parameters": parameters,
        "states": states,
        "outputs": {"seen": {"unit": "1", "expression": output}}
    });
    Model::from_text(&document.to_string()).unwrap()
}

/// An oscillator of Van der Pol, driven by ±1 and by a white force of 0.3.
fn oscillator(seed: u64) -> Recording {
    let mut rng = stream(seed, 8, Purpose::Noise);
    let (mut x, mut v, mut drive) = (1.0, 0.0, 1.0);
    let (mut drives, mut seen) = (Vec::new(), Vec::new());
    let step = 0.1 / SUBSTEPS as f64;
    for sample in 0..200 {
        if sample % 10 == 0 {
            drive = if below(&mut rng, 2) == 0 { 1.0 } else { -1.0 };
        }
        drives.push(drive);
        seen.push(x + 0.05 * normal(&mut rng));
        for _ in 0..SUBSTEPS {
            let rate = (1.0 - x * x) * v - 4.0 * x + 2.0 * drive;
            x += step * v;
            v += step * rate + 0.3 * step.sqrt() * normal(&mut rng);
        }
    }
    Recording::from_samples(0.1, [("input", "1", drives), ("seen", "1", seen)])
}

#[test]
fn the_intervals_of_an_oscillator_that_is_pushed_hold() {
    let truth = [1.0, 4.0, 2.0];
    let [mu, w2, b] = truth.map(unknown);
    let model = model(
        &json!({"mu": mu, "w2": w2, "b": b}),
        &json!({"x": state("v", 1.0), "v": state("mu*(1 - x^2)*v - w2*x + b*input", 0.0)}),
        "x",
    );
    let (chosen, covered) = count(|seed| choose(&model, oscillator(seed), truth));
    assert_chosen(chosen, 1);
    assert_covers(covered, RIGHT_SHARE);
}

/// Two tanks, whose inflow wanders by 0.05 and whose lower level is seen.
fn tanks(seed: u64) -> Recording {
    let mut rng = stream(seed, 9, Purpose::Noise);
    let (mut upper, mut lower, mut pump) = (6.0_f64, 6.0_f64, 2.0);
    let (mut pumps, mut seen) = (Vec::new(), Vec::new());
    let step = 4.0 / SUBSTEPS as f64;
    for sample in 0..200 {
        if sample % 10 == 0 {
            pump = 1.0 + 2.0 * unit(&mut rng);
        }
        pumps.push(pump);
        seen.push(lower + 0.05 * normal(&mut rng));
        for _ in 0..SUBSTEPS {
            let between = 0.04 * upper.max(0.0).sqrt();
            let out = 0.04 * lower.max(0.0).sqrt();
            upper += step * (0.05 * pump - between) + 0.05 * step.sqrt() * normal(&mut rng);
            lower += step * (between - out);
        }
    }
    Recording::from_samples(4.0, [("input", "1", pumps), ("seen", "1", seen)])
}

#[test]
fn the_intervals_of_two_tanks_whose_inflow_wanders_hold() {
    let truth = [0.05, 0.04, 0.04];
    let [gain, a1, a2] = truth.map(unknown);
    let model = model(
        &json!({"gain": gain, "a1": a1, "a2": a2}),
        &json!({
            "upper": state("gain*input - a1*sqrt(max(upper, 0))", 6.0),
            "lower": state("a1*sqrt(max(upper, 0)) - a2*sqrt(max(lower, 0))", 6.0)
        }),
        "lower",
    );
    let (chosen, covered) = count(|seed| choose(&model, tanks(seed), truth));
    assert_chosen(chosen, 1);
    // An extended filter is not exact here: an independent one covered 88 to 92 of 100 where it knew the noise
    // model, and the data choose another in some.
    assert_covers(covered, 0.85);
}

/// An oscillator of Duffing, whose spring hardens, driven by ±1 and by a white force of 0.3.
fn hardening_spring(seed: u64) -> Recording {
    let mut rng = stream(seed, 10, Purpose::Noise);
    let (mut x, mut v, mut drive) = (0.0, 0.0, 1.0);
    let (mut drives, mut seen) = (Vec::new(), Vec::new());
    let step = 0.1 / SUBSTEPS as f64;
    for sample in 0..300 {
        if sample % 15 == 0 {
            drive = if below(&mut rng, 2) == 0 { 1.0 } else { -1.0 };
        }
        drives.push(drive);
        seen.push(x + 0.02 * normal(&mut rng));
        for _ in 0..SUBSTEPS {
            let rate = drive - 0.4 * v - x - 2.0 * x.powi(3);
            x += step * v;
            v += step * rate + 0.3 * step.sqrt() * normal(&mut rng);
        }
    }
    Recording::from_samples(0.1, [("input", "1", drives), ("seen", "1", seen)])
}

#[test]
fn the_intervals_of_a_hardening_spring_that_is_pushed_hold() {
    let truth = [0.4, 1.0, 2.0];
    let [d, k, k3] = truth.map(unknown);
    let model = model(
        &json!({"d": d, "k": k, "k3": k3}),
        &json!({"x": state("v", 0.0), "v": state("input - d*v - k*x - k3*x^3", 0.0)}),
        "x",
    );
    let (chosen, covered) = count(|seed| choose(&model, hardening_spring(seed), truth));
    assert_chosen(chosen, 1);
    assert_covers(covered, RIGHT_SHARE);
}

/// An axis without a spring, of 10 kg and 20 N·s/m, driven by ±10 N and by a white force of 1 N·√s: nothing brings
/// its position back.
fn axis(seed: u64) -> Recording {
    let mut rng = stream(seed, 11, Purpose::Noise);
    let (mut x, mut v, mut force) = (0.0, 0.0, 10.0);
    let (mut forces, mut positions) = (Vec::new(), Vec::new());
    let step = 0.02 / SUBSTEPS as f64;
    for sample in 0..1000 {
        if sample % 5 == 0 {
            force = if below(&mut rng, 2) == 0 { 10.0 } else { -10.0 };
        }
        forces.push(force);
        positions.push(x + 1e-4 * normal(&mut rng));
        for _ in 0..SUBSTEPS {
            let rate = (force - 20.0 * v) / 10.0;
            x += step * v;
            v += step * rate + step.sqrt() / 10.0 * normal(&mut rng);
        }
    }
    Recording::from_samples(0.02, [("input", "1", forces), ("seen", "1", positions)])
}

#[test]
fn the_intervals_of_an_axis_without_a_spring_hold() {
    let truth = [10.0, 20.0];
    let [mass, damping] = truth.map(unknown);
    let model = model(
        &json!({"mass": mass, "damping": damping}),
        &json!({"x": state("v", 0.0), "v": state("(input - damping*v)/mass", 0.0)}),
        "x",
    );
    let (chosen, covered) = count(|seed| choose(&model, axis(seed), truth));
    assert_chosen(chosen, 1);
    assert_covers(covered, RIGHT_SHARE);
}
