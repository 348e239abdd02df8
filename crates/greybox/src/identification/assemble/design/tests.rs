//! Designs whose best experiment is known in closed form, and what they predict held against what
//! estimates do.

use super::*;
use crate::identification::spec::design::DesignRequest;
use crate::{Identification, Recording};
use greybox_numerics::rng::{self, Purpose};
use serde_json::{Value, json};

const LAG: &str = r#"{
    "name": "lag",
    "inputs": {"u": {"unit": "V"}},
    "parameters": {"T": {"unit": "s", "default": 1, "lower": 0.1, "upper": 10, "scale": "log"},
                   "K": {"unit": "1", "default": 1, "lower": 0.1, "upper": 10}},
    "states": {"y": {"unit": "V", "initial": 0, "derivative": "(K*u - y)/T"}},
    "outputs": {"y_out": {"unit": "V", "expression": "y"}}
}"#;

/// The design that a document asks for.
fn designed(model: &str, document: &Value) -> Design {
    let model = Model::from_text(model).unwrap();
    let mut document = document.clone();
    document["model"] = json!(model.description().name);
    let spec = DesignRequest::new(document)
        .read(&[model.description()], None)
        .unwrap();
    let stop = AtomicBool::new(false);
    design(spec, &model, None, &stop).unwrap().unwrap()
}

/// The excitation of the best proposal.
fn best(design: &Design) -> Value {
    assert!(design.finished);
    json!(design.proposals[0].excitation)
}

/// Two hundred time constants are no whole number of periods: the information has a ripple of
/// 1/(2·ω·duration) = 0.25 % over the frequency, which moves its flat maximum by this share at most.
const RIPPLE: f64 = 0.05;

/// One sine over 200 time constants of a lag, so that its start hardly counts.
fn sine(parameters: &Value) -> Value {
    json!({
        "parameters": parameters, "outputs": {"y_out": {"noise_std": 0.01}},
        "inputs": {"u": {"lower": -1, "upper": 1}}, "families": ["sine"], "points": 1,
        "sample_time_s": 0.05, "duration_s": 200
    })
}

#[test]
fn a_sine_for_the_time_constant_of_a_lag_has_its_corner_frequency() {
    let design = designed(
        LAG,
        &sine(&json!({"T": {"estimate": {}}, "K": {"value": 1}})),
    );
    let sine = best(&design);
    // |∂G/∂T|² = ω²/(1 + ω²T²)² is largest at ω = 1/T; T is 1 s in the middle of its range.
    let rate = std::f64::consts::TAU * sine["frequency_hz"].as_f64().unwrap();
    assert!((rate - 1.0).abs() < RIPPLE, "{rate}");
    assert_eq!(sine["amplitude"], 1.0);
}

#[test]
fn a_sine_for_gain_and_time_constant_is_slower() {
    let both = json!({"T": {"estimate": {}}, "K": {"estimate": {"lower": 0.5, "upper": 1.5}}});
    let design = designed(LAG, &sine(&both));
    // The determinant goes with ω²/(1 + ω²T²)⁴, which is largest at ω = 1/(√3·T).
    let rate = std::f64::consts::TAU * best(&design)["frequency_hz"].as_f64().unwrap();
    assert!((rate * 3.0_f64.sqrt() - 1.0).abs() < RIPPLE, "{rate}");
}

#[test]
fn a_decay_is_measured_best_once_it_has_fallen_to_a_third() {
    let decay = r#"{
        "name": "decay",
        "parameters": {"k": {"unit": "1/s", "default": 0.8, "lower": 0.3, "upper": 1.3}},
        "states": {"x": {"unit": "1", "initial": 1, "derivative": "-k*x"}},
        "outputs": {"x_out": {"unit": "1", "expression": "x"}}
    }"#;
    let candidates: Vec<f64> = (0..=100).map(|k| f64::from(k) / 20.0).collect();
    let document = json!({
        "parameters": {"k": {"estimate": {}}}, "outputs": {"x_out": {"noise_std": 0.01}},
        "instants": {"candidates_s": candidates, "count": 3}, "points": 1
    });
    // (t·e^(−k·t))² is largest at t = 1/k = 1.25 s, and so for each of the three.
    let design = designed(decay, &document);
    assert_eq!(best(&design)["instants_s"], json!([1.25, 1.25, 1.25]));
    // σ·e·k/√3
    let error = design.proposals[0].after[0].standard_error.unwrap();
    let expected = 0.01 * std::f64::consts::E * 0.8 / 3.0_f64.sqrt();
    assert!((error / expected - 1.0).abs() < 1e-5, "{error} {expected}");
    assert_eq!(design.before[0].standard_error, None);
}

#[test]
fn michaelis_and_menten_take_half_of_the_rates_at_the_end_and_half_below_the_constant() {
    // A rate that is read at once: nothing depends on its state.
    let rate = r#"{
        "name": "enzyme",
        "inputs": {"S": {"unit": "mol/m^3"}},
        "parameters": {"V": {"unit": "mol/(m^3*s)", "default": 1, "lower": 0.5, "upper": 1.5},
                       "Km": {"unit": "mol/m^3", "default": 1, "lower": 0.5, "upper": 1.5}},
        "states": {"clock": {"unit": "s", "initial": 0, "derivative": "1"}},
        "outputs": {"v": {"unit": "mol/(m^3*s)", "expression": "V*S/(Km + S)"}}
    }"#;
    let document = json!({
        "parameters": {"V": {"estimate": {}}, "Km": {"estimate": {}}},
        "outputs": {"v": {"noise_std": 0.01}}, "inputs": {"S": {"lower": 0, "upper": 5}},
        "families": ["steps"], "points": 1, "sample_time_s": 1, "duration_s": 8
    });
    let design = designed(rate, &document);
    let inputs = design.inputs.as_ref().unwrap();
    let mut levels: Vec<f64> = inputs.signals["S"]
        .values
        .iter()
        .flatten()
        .copied()
        .collect();
    levels.sort_by(f64::total_cmp);
    // Km·S_max/(2·Km + S_max) = 5/7 (R. G. Duggleby, 1979).
    let expected = [5.0 / 7.0, 5.0];
    for (place, level) in levels.iter().enumerate() {
        assert!((level - expected[place / 4]).abs() < 0.02, "{levels:?}");
    }
}

#[test]
fn two_further_experiments_on_rooneys_and_bieglers_curve_are_both_the_last_that_may_be() {
    // W. C. Rooney, L. T. Biegler, AIChE J. 47 (2001), with the numbers of the example of
    // Pyomo.DoE: 15 and 0.5, six hours that were measured, noise of 0.1.
    let curve = r#"{
        "name": "demand",
        "parameters": {"asymptote": {"unit": "1", "default": 15, "lower": 14.5, "upper": 15.5},
                       "rate": {"unit": "1/s", "default": 0.5, "lower": 0, "upper": 1}},
        "states": {"y": {"unit": "1", "initial": 0, "derivative": "rate*(asymptote - y)"}},
        "outputs": {"y_out": {"unit": "1", "expression": "y"}}
    }"#;
    let hours: Vec<u32> = (1..=10).collect();
    let document = json!({
        "parameters": {"asymptote": {"estimate": {}}, "rate": {"estimate": {}}},
        "outputs": {"y_out": {"noise_std": 0.1}}, "points": 1,
        "instants": {"candidates_s": hours, "measured_s": [1, 2, 3, 4, 5, 7], "count": 2}
    });
    let design = designed(curve, &document);
    assert_eq!(best(&design)["instants_s"], json!([10.0, 10.0]));
    let determinant = design.proposals[0].log10_determinant;
    assert!((determinant - 7.0340).abs() < 5e-5, "{determinant}");
}

#[test]
fn a_tolerance_limits_what_any_experiment_can_bring() {
    let tight = json!({"T": {"estimate": {}}, "K": {"value": 1, "tolerance": 0.05}});
    let mut document = sine(&tight);
    document["families"] = json!(["steps"]);
    document["duration_s"] = json!(10);
    let with_tolerance = designed(LAG, &document);
    let known = &with_tolerance.proposals[0].after[0];
    let (noise, total) = (known.standard_error, known.total_standard_error);
    assert!(total.unwrap() > noise.unwrap(), "{known:?}");
    document["parameters"]["K"] = json!({"value": 1, "tolerance": 0});
    let exact = designed(LAG, &document);
    let known = &exact.proposals[0].after[0];
    let share = known.total_standard_error.unwrap() / known.standard_error.unwrap();
    assert!((share - 1.0).abs() < 1e-12);
}

#[test]
fn the_same_seed_gives_the_same_design_and_more_points_average() {
    let mut document = sine(
        &json!({"T": {"estimate": {}, "prior": {"mean": 1, "std": 0.3, "scale": "log"}},
                                    "K": {"estimate": {"lower": 0.5, "upper": 1.5}}}),
    );
    document["duration_s"] = json!(20);
    document["points"] = json!(3);
    let text = |seed: u64| {
        let mut document = document.clone();
        document["seed"] = json!(seed);
        serde_json::to_string(&designed(LAG, &document).proposals).unwrap()
    };
    assert_eq!(text(4), text(4));
    assert_ne!(text(4), text(5));
}

#[test]
fn a_search_that_is_stopped_at_once_has_no_answer() {
    let model = Model::from_text(LAG).unwrap();
    let mut document = sine(&json!({"T": {"estimate": {}}}));
    document["model"] = json!(model.description().name);
    let spec = DesignRequest::new(document)
        .read(&[model.description()], None)
        .unwrap();
    let stop = AtomicBool::new(true);
    assert!(design(spec, &model, None, &stop).unwrap().is_none());
}

/// How often the plant is recorded and estimated from.
const SEEDS: u64 = 200;

#[test]
fn estimates_scatter_as_the_design_predicts() {
    const NOISE: f64 = 0.05;
    let document = json!({
        "parameters": {"T": {"estimate": {}, "prior": {"mean": 0.8, "std": 10}},
                       "K": {"estimate": {}, "prior": {"mean": 2, "std": 100}}},
        "outputs": {"y_out": {"noise_std": NOISE}}, "inputs": {"u": {"lower": -1, "upper": 1}},
        "families": ["prbs"], "points": 1, "sample_time_s": 0.1, "duration_s": 20
    });
    let design = designed(LAG, &document);
    let played = &design.inputs.as_ref().unwrap().signals["u"].values;
    let input: Vec<f64> = played.iter().flatten().copied().collect();
    let model = Model::from_text(LAG).unwrap();
    let (time_constant, gain) = (0.8_f64, 2.0);
    let decay = (-0.1 / time_constant).exp();
    let mut squares = [0.0; 2];
    for seed in 0..SEEDS {
        let mut random = rng::stream(seed, 0, Purpose::Noise);
        let mut state = 0.0;
        let output = input.iter().map(|input| {
            let measured = state + NOISE * rng::normal(&mut random);
            state = decay * state + (1.0 - decay) * gain * input;
            measured
        });
        let output: Vec<f64> = output.collect();
        let recording =
            Recording::from_samples(0.1, [("u", "V", input.clone()), ("y_out", "V", output)]);
        let job = json!({
            "model": model.description().name,
            "parameters": {"T": {"estimate": {}}, "K": {"estimate": {}}},
            "outputs": {"y_out": {"noise_std": NOISE}}, "validation": {"fraction": 0}, "seed": 1,
            "method": {"name": "multistart_lm", "population": 8, "generations": 2, "further_searches": 0}
        });
        let found = Identification::of_job(job, recording)
            .model(&model)
            .run()
            .unwrap();
        for (place, (name, truth)) in [("T", time_constant), ("K", gain)].into_iter().enumerate() {
            let error = found.parameter(name).unwrap().estimate.estimate - truth;
            squares[place] += error * error;
        }
    }
    for (place, name) in ["T", "K"].into_iter().enumerate() {
        let after = design.proposals[0]
            .after
            .iter()
            .find(|own| own.name == name);
        let predicted = after.unwrap().total_standard_error.unwrap();
        let realised = (squares[place] / SEEDS as f64).sqrt();
        assert!(
            (predicted / realised - 1.0).abs() < 0.1,
            "{name}: {predicted} {realised}"
        );
    }
}
