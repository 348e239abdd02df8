//! What is taken as known is never exact: priors, tolerances and the budget, against closed forms
//! where the model is linear and against the truth where it is the servo.

use crate::run::run;
use greybox::demo::{self, Demo};
use greybox::identification::Outcome;
use greybox::identification::outcome::{Estimate, Rule, Trust};
use greybox::recording::{Recording, Signal, TimeAxis};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

pub const SAMPLES: usize = 300;
pub const SAMPLE_TIME: f64 = 0.1;
pub const NOISE: f64 = 0.05;
const TIME_CONSTANT: f64 = 0.5;

/// Normal numbers, near enough: the sum of twelve.
pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// What a random input does through a lag.
pub fn response(random: &mut ChaCha8Rng) -> (Vec<f64>, Vec<f64>) {
    let decay = (-SAMPLE_TIME / TIME_CONSTANT).exp();
    let mut state = 0.0;
    let step = |_| {
        let (before, sign) = (state, random.random::<bool>());
        let input = if sign { 1.0 } else { -1.0 };
        state = decay * state + (1.0 - decay) * input;
        (input, before)
    };
    (0..SAMPLES).map(step).unzip()
}

pub fn recording(signals: Vec<Signal>, sample_time: f64, samples: usize) -> Recording {
    Recording::new(
        TimeAxis::Uniform {
            sample_time,
            samples,
        },
        signals,
    )
}

/// A lag whose gain, on a linear scale, is a closed form of least squares: the recording, the
/// estimate and its standard error.
fn lag(seed: u64) -> (Recording, f64, f64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (input, regressor) = response(&mut random);
    let output: Vec<f64> = regressor
        .iter()
        .map(|x| 0.8 * x + NOISE * normal(&mut random))
        .collect();
    let power: f64 = regressor.iter().map(|x| x * x).sum();
    let product: f64 = regressor.iter().zip(&output).map(|(x, y)| x * y).sum();
    let signals = vec![Signal::new("u", "1", input), Signal::new("y", "1", output)];
    let recording = recording(signals, SAMPLE_TIME, SAMPLES);
    (recording, product / power, NOISE / power.sqrt())
}

/// The job of the lag, refined from the middle of its range.
pub fn job(parameters: &Value) -> Value {
    json!({
        "model": {
            "name": "lag",
            "inputs": {"u": {"unit": "1"}},
            "parameters": {
                "gain": {"unit": "1", "default": 1, "unknown": true},
                "lever": {"unit": "1", "default": 1}
            },
            "constants": {"T": {"unit": "s", "value": TIME_CONSTANT}},
            "states": {"x": {"unit": "1", "derivative": "(lever*gain*u - x)/T", "initial": 0}},
            "outputs": {"y": {"unit": "1", "expression": "x"}}
        },
        "experiments": [{}],
        "parameters": parameters,
        // Above the noise that there is, so that it stands and not the residuals' own.
        "outputs": {"y": {"noise_std": 1.2 * NOISE}},
        "method": {"generations": 0},
        "validation": {"fraction": 0},
        "seed": 1
    })
}

pub fn gain(more: Value) -> Value {
    let mut free = json!({"estimate": {"lower": 0.1, "upper": 2, "scale": "linear"}});
    for (name, value) in more.as_object().expect("an object") {
        free[name] = value.clone();
    }
    free
}

fn near(found: f64, expected: f64) {
    assert!(
        (found / expected - 1.0).abs() < 1e-6,
        "{found} is not {expected}"
    );
}

#[test]
fn a_prior_is_met_half_way_and_fixes_or_frees_in_its_limits() {
    let (recording, estimate, error) = lag(1);
    let error = 1.2 * error;
    for std in [1e-9, 0.3 * error, error, 1e6] {
        let prior = json!({"prior": {"mean": 0.82, "std": std}});
        let outcome = run(job(&json!({"gain": gain(prior)})), recording.clone());
        let known = &outcome.parameters[0].estimate;
        let (data, before) = (error.powi(-2), f64::powi(std, -2));
        let expected = (data * estimate + before * 0.82) / (data + before);
        near(known.estimate, expected);
        near(
            known.standard_error.expect("an error"),
            (data + before).powf(-0.5),
        );
        let shift = known.prior_shift.expect("a prior");
        assert!((shift - (expected - 0.82) / std).abs() < 1e-3, "{shift}");
    }
}

#[test]
fn a_prior_that_the_data_contradict_is_told() {
    let (recording, ..) = lag(1);
    let prior = json!({"prior": {"range_95": [1.19, 1.21]}});
    let outcome = run(job(&json!({"gain": gain(prior)})), recording);
    let reasons = &outcome.verdict.reasons;
    let told = reasons
        .iter()
        .find(|reason| reason.code == Rule::PriorContradicted);
    assert!(
        told.is_some_and(|told| told.detail.contains("gain")),
        "{reasons:?}"
    );
    assert_ne!(outcome.parameters[0].estimate.trust, Some(Trust::High));
}

#[test]
fn a_tolerance_widens_the_total_as_the_propagation_of_uncertainty_says() {
    let (recording, ..) = lag(2);
    for tolerance in [0.0, 0.01, 0.2] {
        let lever = json!({"value": 1, "tolerance": format!("{} %", 100.0 * tolerance)});
        let mut job = job(&json!({"gain": gain(json!({})), "lever": lever}));
        job["tolerances"] = json!({"*": 0});
        let outcome = run(job, recording.clone());
        let known = &outcome.parameters[0].estimate;
        let noise = known.standard_error.expect("an error");
        let total = known.total_standard_error.expect("a total");
        // Only gain times lever is seen, so the lever's error is the gain's.
        let assumed = tolerance * known.estimate;
        near(total, noise.hypot(assumed));
        let interval = known.total_interval.expect("an interval");
        near(
            interval.upper.expect("closed"),
            known.estimate + 1.959_964 * total,
        );
        if tolerance == 0.0 {
            assert!(outcome.budget.is_empty());
            continue;
        }
        let line = &outcome.budget[0];
        assert_eq!(
            (&line.assumption[..], line.score, line.unnoticed_up_to),
            ("lever", None, None)
        );
        let contribution = line.contributions["gain"];
        near(contribution.standard_error, assumed);
        near(contribution.share, (assumed / total).powi(2));
        near(contribution.total_if_better, noise.hypot(assumed / 5.0));
    }
}

/// Two lags that share their time constant, with gains and noises of different size.
fn two_outputs(seed: u64) -> Recording {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let (input, regressor) = response(&mut random);
    let mut measured = |gain: f64, noise: f64| -> Vec<f64> {
        let values = regressor.iter();
        values
            .map(|x| gain * x + noise * normal(&mut random))
            .collect()
    };
    let (large, small) = (measured(3.0, 0.9), measured(0.5, 0.005));
    let signals = vec![
        Signal::new("u", "1", input),
        Signal::new("large", "1", large),
        Signal::new("small", "1", small),
    ];
    recording(signals, SAMPLE_TIME, SAMPLES)
}

#[test]
fn intervals_of_several_outputs_cover_although_no_noise_is_declared() {
    let truth = [3.0, 0.5, TIME_CONSTANT];
    let (mut covered, mut all, mut widths) = (0, 0, 0.0);
    for seed in 0..20 {
        let range = |value: f64| json!({"estimate": {"lower": value / 3.0, "upper": value * 2.0}});
        let outcome = run(
            json!({
                "model": {
                    "name": "lags",
                    "inputs": {"u": {"unit": "1"}},
                    "parameters": {
                        "first": {"unit": "1", "default": 3, "unknown": true},
                        "second": {"unit": "1", "default": 0.5, "unknown": true},
                        "T": {"unit": "s", "default": 0.5, "unknown": true}
                    },
                    "states": {"x": {"unit": "1", "derivative": "(u - x)/T", "initial": 0}},
                    "outputs": {
                        "large": {"unit": "1", "expression": "first*x"},
                        "small": {"unit": "1", "expression": "second*x"}
                    }
                },
                "experiments": [{}],
                "parameters":
                    {"first": range(truth[0]), "second": range(truth[1]), "T": range(truth[2])},
                "method": {"generations": 0},
                "validation": {"fraction": 0},
                "seed": 1
            }),
            two_outputs(seed),
        );
        for (parameter, truth) in outcome.parameters.iter().zip(truth) {
            let interval = parameter
                .estimate
                .confidence_interval
                .as_ref()
                .expect("an interval");
            let (lower, upper) = (
                interval.lower.expect("closed"),
                interval.upper.expect("closed"),
            );
            covered += u32::from((lower..=upper).contains(&truth));
            all += 1;
        }
        widths += outcome.parameters[2]
            .estimate
            .standard_error
            .expect("an error");
    }
    println!("{covered} of {all}, the time constant to {}", widths / 20.0);
    // 57 of 60 are expected; fewer than 51 are one case in two hundred.
    assert!(covered >= 51, "{covered} of {all}");
    // The quiet output alone gives the time constant to 0.0022, by its share of the noise; an
    // equal say of both would be some five times worse.
    assert!(widths / 20.0 < 0.004, "{}", widths / 20.0);
}

const SERVO_SAMPLES: usize = 2000;
const SERVO_NOISE: f64 = 1e-5;
const UNKNOWNS: [(&str, f64); 4] = [
    ("mass", 58.0),
    ("damping", 370.0),
    ("stiffness", 21_412.0),
    ("bulk_modulus", 1.6009e9),
];

/// What the fits to drawn noise and drawn assumptions come to is the linear total: a model that is
/// linear has no other.
#[test]
fn drawing_comes_to_the_total_where_the_model_is_linear() {
    let (recording, ..) = lag(2);
    let lever = json!({"value": 1, "tolerance": "5 %"});
    let mut job = job(&json!({"gain": gain(json!({})), "lever": lever}));
    job["uncertainty"] = json!({"monte_carlo_samples": 2000});
    let known = run(job, recording).parameters[0].estimate.clone();
    let drawn = known.monte_carlo.expect("it was asked for");
    let total = known.total_standard_error.expect("a total");
    assert_eq!(drawn.samples, 2000);
    // Known themselves to 1.6 % and, the ends, to 6 % of a standard deviation.
    let ratio = drawn.standard_error / total;
    assert!((ratio - 1.0).abs() < 0.06, "{ratio}");
    let interval = known.total_interval.expect("an interval");
    let ends = [(drawn.lower, interval.lower), (drawn.upper, interval.upper)];
    for (drawn, linear) in ends {
        let off = (drawn - linear.expect("closed")) / total;
        assert!(off.abs() < 0.25, "{off} standard errors");
    }
}

/// The nominal servo's job on a rig that differs from it, refined from near the truth.
fn servo(differs: &[(&str, f64)], more: &Value, seed: u64) -> Outcome {
    let reference = demo::excitation::textbook(seed, SERVO_SAMPLES);
    let mut truth = demo::rig::parameters(Demo::A);
    let model = demo::rig::model();
    for (name, value) in differs {
        let index = model.description().parameter_index(name);
        truth[index.expect("a parameter")] = *value;
    }
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut position = demo::rig::simulate(&truth, &reference).position;
    for value in &mut position {
        *value += SERVO_NOISE * normal(&mut random);
    }
    let mut parameters = more.clone();
    for (name, value) in UNKNOWNS {
        let range = json!({"lower": value / 4.0, "upper": value * 4.5, "scale": "log"});
        parameters[name] = json!({ "estimate": range });
    }
    let signals = vec![
        Signal::new("reference", "m", reference),
        Signal::new("position", "m", position),
    ];
    let job = json!({
        "model": "single_rod_servo",
        "experiments": [{}],
        "parameters": parameters,
        "outputs": {"position": {"noise_std": SERVO_NOISE}},
        "method": {"generations": 0},
        // What would help is not asked here, and dear to try.
        "uncertainty": {"tried_steps": 0},
        "validation": {"fraction": 0},
        "seed": 1
    });
    run(job, recording(signals, 0.01, SERVO_SAMPLES))
}

fn show(outcome: &Outcome) {
    for (parameter, (_, truth)) in outcome.parameters.iter().zip(UNKNOWNS) {
        let known = &parameter.estimate;
        println!(
            "  {:12} {:+8.2} %, noise {:.2} %, total {:.2} %, {:?}",
            parameter.name,
            100.0 * (known.estimate / truth - 1.0),
            100.0 * known.standard_error.unwrap_or(f64::NAN) / truth,
            100.0 * known.total_standard_error.unwrap_or(f64::NAN) / truth,
            known.trust
        );
    }
    for reason in &outcome.verdict.reasons {
        println!("  {} {:?}: {}", reason.code, reason.concerns, reason.detail);
    }
}

/// How many total standard errors an estimate is off.
fn off(known: &Estimate, truth: f64) -> f64 {
    (known.estimate - truth).abs() / known.total_standard_error.expect("a total")
}

#[test]
fn a_rig_that_is_as_it_is_taken_to_be_is_trusted_and_its_totals_hold() {
    let outcome = servo(&[], &json!({}), 1);
    println!("{}", outcome.verdict.summary);
    show(&outcome);
    for (parameter, (name, truth)) in outcome.parameters.iter().zip(UNKNOWNS) {
        let off = off(&parameter.estimate, truth);
        assert!(off < 3.0, "{name} is {off} total standard errors off");
    }
    let contradicted = [Rule::AssumptionContradicted, Rule::Misfit];
    let reasons = &outcome.verdict.reasons;
    assert!(
        !reasons
            .iter()
            .any(|reason| contradicted.contains(&reason.code)),
        "{reasons:?}"
    );
    assert_eq!(outcome.parameters[0].estimate.trust, Some(Trust::High));
}

/// Every other case is tried, and all where `GREYBOX_TESTS_RECORDS` is said.
#[test]
fn nothing_is_highly_trusted_that_a_wrong_assumption_has_moved_beyond_its_total_interval() {
    let cases: [(&str, &[(&str, f64)]); 11] = [
        (
            "supply pressure 0.2 % too high",
            &[("supply_pressure", 7e6 / 1.002)],
        ),
        (
            "supply pressure 0.4 % too high",
            &[("supply_pressure", 7e6 / 1.004)],
        ),
        (
            "flow gain 0.15 % too high",
            &[("flow_gain", 8.91e-8 / 1.0015)],
        ),
        ("flow gain 0.2 % too low", &[("flow_gain", 8.91e-8 * 1.002)]),
        (
            "Coulomb friction of 15 N left out",
            &[("coulomb_friction", 15.0)],
        ),
        (
            "Coulomb friction of 30 N left out",
            &[("coulomb_friction", 30.0)],
        ),
        ("dead band of 0.07 % left out", &[("dead_band", 7e-4)]),
        (
            "return pressure 0.01 MPa off",
            &[("return_pressure", 1.1e5)],
        ),
        (
            "dead volumes 1.5 times",
            &[("dead_volume_1", 2e-5), ("dead_volume_2", 2e-5)],
        ),
        (
            "valve 97 Hz, not 100",
            &[("spool_natural_frequency", 97.0 * std::f64::consts::TAU)],
        ),
        ("input 0.08 ms late", &[("input_delay", 8e-5)]),
    ];
    let step = match std::env::var_os("GREYBOX_TESTS_RECORDS") {
        Some(_) => 1,
        None => 2,
    };
    let mut faults = Vec::new();
    for (place, (what, differs)) in cases.into_iter().enumerate().step_by(step) {
        let outcome = servo(differs, &json!({}), 10 + place as u64);
        println!(
            "{what}: {:?}, {}",
            outcome.verdict.trust, outcome.verdict.summary
        );
        show(&outcome);
        for (parameter, (name, truth)) in outcome.parameters.iter().zip(UNKNOWNS) {
            let known = &parameter.estimate;
            let (off, share) = (off(known, truth), (known.estimate / truth - 1.0).abs());
            if known.trust == Some(Trust::High) && off > 3.0 && share > 0.02 {
                faults.push(format!(
                    "{what}: {name} is {off:.1} total standard errors off"
                ));
            }
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn friction_that_was_left_out_is_what_the_residuals_ask_for() {
    let outcome = servo(&[("coulomb_friction", 30.0)], &json!({}), 3);
    show(&outcome);
    let line = outcome
        .budget
        .iter()
        .find(|line| line.assumption == "coulomb_friction");
    let line = line.expect("a line for friction");
    println!("{line:?}");
    let suggested = line.suggested.expect("a suggestion");
    assert!(line.score.expect("a score") > 4.0, "{line:?}");
    // The derivative at zero and all else as given: a fifth for what is not linear, and chance.
    let off = (suggested.value - 30.0).abs();
    assert!(off < 6.0 + 3.0 * suggested.standard_error, "{suggested:?}");
    assert!(line.unnoticed_up_to.expect("a size") < 30.0);
}

/// Absorption and elimination can change places, with another volume (J. G. Wagner, *Pharmacokinetics
/// for the Pharmaceutical Scientist*, 1993: flip-flop).
#[test]
fn twin_minima_are_never_trusted_and_the_twin_is_named() {
    let (absorption, elimination, volume) = (1.2_f64, 0.25_f64, 4.0_f64);
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let level = |k: usize| {
        let t = 0.25 * k as f64;
        let rates = absorption / (volume * (absorption - elimination));
        100.0 * rates * ((-elimination * t).exp() - (-absorption * t).exp())
    };
    let measured: Vec<f64> = (0..80)
        .map(|k| level(k) + 0.1 * normal(&mut random))
        .collect();
    let signals = vec![
        Signal::new("clock", "1", vec![0.0; 80]),
        Signal::new("level", "1", measured),
    ];
    let range = |lower: f64, upper: f64| json!({"default": 1, "lower": lower, "upper": upper, "scale": "log", "unknown": true});
    let outcome = run(
        json!({
            "model": {
                "name": "one_compartment",
                "inputs": {"clock": {}},
                "parameters":
                    {"ka": range(0.05, 5.0), "ke": range(0.05, 5.0), "V": range(0.1, 50.0)},
                "states": {
                    "gut": {"derivative": "-ka*gut", "initial": 100},
                    "blood": {"derivative": "ka*gut/V - ke*blood + 0*clock", "initial": 0}
                },
                "outputs": {"level": {"expression": "blood"}}
            },
            "experiments": [{}],
            "outputs": {"level": {"noise_std": 0.1}},
            "method": {"name": "multistart_lm", "refine_candidates": 12},
            "validation": {"fraction": 0},
            "seed": 1
        }),
        recording(signals, 0.25, 80),
    );
    for start in &outcome.starts {
        println!("{:?} {:?} {:?}", start.cost, start.parameters, start.end);
    }
    let reasons = &outcome.verdict.reasons;
    let twin = reasons
        .iter()
        .find(|reason| reason.code == Rule::TwinMinima);
    let concerned = twin.and_then(|twin| twin.concerns.clone());
    let concerned = concerned.unwrap_or_else(|| panic!("{reasons:?}"));
    for name in ["ka", "ke", "V"] {
        assert!(concerned.iter().any(|own| own == name), "{concerned:?}");
    }
    assert_eq!(outcome.verdict.trust, Trust::Low);
}
