//! Conditions that parameters keep, and what is known of several together: against closed forms and
//! a search of the plane where the model is linear, and where it is not by what they leave.

use crate::budget::normal;
use crate::run::run;
use greybox::identification::Outcome;
use greybox::identification::outcome::{Rule, Trust};
use greybox::recording::{Recording, Signal, TimeAxis};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

const SAMPLES: usize = 200;
const SAMPLE_TIME: f64 = 0.1;
const TIME_CONSTANT: f64 = 0.3;
const NOISE: f64 = 0.05;

/// Two random inputs, each through a lag, and the noisy sum of both with these gains.
struct Regression {
    recording: Recording,
    /// The responses of the two lags.
    columns: [Vec<f64>; 2],
    output: Vec<f64>,
}

impl Regression {
    fn new(gains: [f64; 2], seed: u64) -> Regression {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let decay = (-SAMPLE_TIME / TIME_CONSTANT).exp();
        let (mut inputs, mut columns) = ([vec![], vec![]], [vec![], vec![]]);
        let mut output = Vec::new();
        let mut states = [0.0; 2];
        for _ in 0..SAMPLES {
            let clean: f64 = states.iter().zip(gains).map(|(x, gain)| x * gain).sum();
            output.push(clean + NOISE * normal(&mut random));
            for index in 0..2 {
                let input = f64::from(2 * i32::from(random.random::<bool>()) - 1);
                columns[index].push(states[index]);
                inputs[index].push(input);
                states[index] = decay * states[index] + (1.0 - decay) * input;
            }
        }
        let [first, second] = inputs;
        let signals = vec![
            Signal::new("u", "1", first),
            Signal::new("v", "1", second),
            Signal::new("y", "1", output.clone()),
        ];
        let axis = TimeAxis::Uniform {
            sample_time: SAMPLE_TIME,
            samples: SAMPLES,
        };
        Regression {
            recording: Recording::new(axis, signals),
            columns,
            output,
        }
    }

    /// `XᵀX` and `Xᵀy` of χ².
    fn normal_equations(&self) -> ([[f64; 2]; 2], [f64; 2]) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let weight = (1.2 * NOISE).powi(-2);
        let entry = |i: usize, j: usize| weight * dot(&self.columns[i], &self.columns[j]);
        let right = |i: usize| weight * dot(&self.columns[i], &self.output);
        (
            [[entry(0, 0), entry(0, 1)], [entry(1, 0), entry(1, 1)]],
            [right(0), right(1)],
        )
    }

    fn run(&self, more: &Value) -> Outcome {
        let gain = json!({"unit": "1", "default": 1, "unknown": true});
        let free = json!({"estimate": {"lower": 0.1, "upper": 2, "scale": "linear"}});
        let mut job = json!({
            "model": {
                "name": "two_lags",
                "inputs": {"u": {"unit": "1"}, "v": {"unit": "1"}},
                "parameters": {"a": gain, "b": gain},
                "constants": {"T": {"unit": "s", "value": TIME_CONSTANT}},
                "states": {
                    "x": {"unit": "1", "derivative": "(a*u - x)/T", "initial": 0},
                    "z": {"unit": "1", "derivative": "(b*v - z)/T", "initial": 0}
                },
                "outputs": {"y": {"unit": "1", "expression": "x + z"}}
            },
            "parameters": {"a": free, "b": free},
            // Above the noise that there is, so that it stands and not the residuals' own.
            "outputs": {"y": {"noise_std": 1.2 * NOISE}},
            "method": {"generations": 8},
            "validation": {"fraction": 0},
            "seed": 1
        });
        for (section, value) in more.as_object().expect("an object") {
            job[section] = value.clone();
        }
        run(job, self.recording.clone())
    }
}

fn estimates(outcome: &Outcome) -> [f64; 2] {
    [0, 1].map(|index| outcome.parameters[index].estimate.estimate)
}

fn reason(outcome: &Outcome, code: Rule) -> Option<String> {
    let mut reasons = outcome.verdict.reasons.iter();
    let found = reasons.find(|reason| reason.code == code);
    found.map(|reason| reason.detail.clone())
}

fn near(found: f64, expected: f64, within: f64) {
    assert!(
        (found - expected).abs() < within,
        "{found} is not {expected}"
    );
}

#[test]
fn a_constraint_that_binds_gives_the_constrained_least_squares_and_ends_the_interval() {
    // Noise has the data say that a > b where both are equal.
    let seed = (0..50).find(|seed| {
        let ([[aa, ab], [_, bb]], [ay, by]) = Regression::new([0.8, 0.8], *seed).normal_equations();
        let determinant = aa * bb - ab * ab;
        let (a, b) = (
            (bb * ay - ab * by) / determinant,
            (aa * by - ab * ay) / determinant,
        );
        let deviation = ((aa + bb + 2.0 * ab) / determinant).sqrt();
        (a - b) / deviation > 1.0
    });
    let regression = Regression::new([0.8, 0.8], seed.expect("noise of this kind"));
    let outcome = regression.run(&json!({"constraints": ["a < b"]}));
    let ([[aa, ab], [_, bb]], [ay, by]) = regression.normal_equations();
    let common = (ay + by) / (aa + bb + 2.0 * ab);
    for value in estimates(&outcome) {
        near(value, common, 1e-7);
    }
    assert!(reason(&outcome, Rule::ConstraintBinds).is_some());
    // The interval of each gain among the pairs with a ≤ b, by looking at them all.
    let mut inside = Vec::new();
    let steps = 2000;
    let reach = 0.06;
    for i in 0..=steps {
        for j in 0..=steps {
            let at = |k: i32| common + reach * (2.0 * f64::from(k) / f64::from(steps) - 1.0);
            let (a, b) = (at(i), at(j));
            // Quadratic, so that the sums need not be gone through for each pair.
            let (da, db) = (a - common, b - common);
            let slopes = [
                aa * common + ab * common - ay,
                ab * common + bb * common - by,
            ];
            let excess = aa * da * da
                + 2.0 * ab * da * db
                + bb * db * db
                + 2.0 * (slopes[0] * da + slopes[1] * db);
            let is_inside = a <= b && excess <= 1.959_964_f64.powi(2);
            inside.extend(is_inside.then_some([a, b]));
        }
    }
    let ends = [0, 1].map(|index| {
        let values = inside.iter().map(|pair| pair[index]);
        [
            values.clone().fold(f64::INFINITY, f64::min),
            values.fold(f64::NEG_INFINITY, f64::max),
        ]
    });
    for (index, [lower, upper]) in ends.into_iter().enumerate() {
        let known = &outcome.parameters[index].estimate;
        let interval = known.confidence_interval.as_ref().expect("an interval");
        println!("{lower} {upper} {interval:?}");
        near(interval.lower.expect("an end"), lower, 2e-4);
        near(interval.upper.expect("an end"), upper, 2e-4);
    }
}

#[test]
fn a_constraint_that_the_data_contradict_is_told_and_one_that_holds_changes_nothing() {
    let regression = Regression::new([1.0, 0.6], 3);
    let free = regression.run(&json!({}));
    let held = regression.run(&json!({"constraints": ["a >= b", "a + b <= 2"]}));
    for index in 0..2 {
        let [one, other] = [&free, &held].map(|outcome| &outcome.parameters[index].estimate);
        near(one.estimate, other.estimate, 1e-7);
        let [one, other] = [one, other].map(|known| known.standard_error.expect("an error"));
        near(one / other, 1.0, 1e-6);
    }
    let against = regression.run(&json!({"constraints": ["a <= b"]}));
    let told = reason(&against, Rule::ConstraintContradicted);
    assert!(told.is_some_and(|told| told.contains("`a <= b`")));
    assert_eq!(against.verdict.trust, Trust::Low);
}

#[test]
fn a_curved_constraint_is_met_by_every_method() {
    // The data say (1, 0.6); on the hyperbola a·b = 0.4 another pair is the best.
    let regression = Regression::new([1.0, 0.6], 5);
    let ([[aa, ab], [_, bb]], [ay, by]) = regression.normal_equations();
    let cost = |a: f64| {
        let b = 0.4 / a;
        aa * a * a + 2.0 * ab * a * b + bb * b * b - 2.0 * (ay * a + by * b)
    };
    let best = (0..200_000).map(|k| 0.4 + 1e-5 * f64::from(k));
    let best = best.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap();
    for name in [
        "icra_genetic",
        "differential_evolution",
        "cma_es",
        "multistart_lm",
    ] {
        let method = json!({"name": name, "generations": 8, "refine_candidates": 3});
        let outcome = regression.run(&json!({
            "constraints": ["a*b <= 0.4"], "method": method, "process_noise": "none",
        }));
        let [a, b] = estimates(&outcome);
        assert!(a * b <= 0.4 + 1e-9, "{name}: {a} {b}");
        near(a, best, 2e-5);
    }
}

#[test]
fn a_constraint_tells_twins_apart() {
    let (absorption, elimination, volume) = (1.2_f64, 0.25_f64, 4.0_f64);
    let range = |lower: f64, upper: f64| json!({"default": 1, "lower": lower, "upper": upper, "scale": "log", "unknown": true});
    for seed in 0..6 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let level = |k: usize| {
            let t = 0.25 * k as f64;
            let rates = absorption / (volume * (absorption - elimination));
            100.0 * rates * ((-elimination * t).exp() - (-absorption * t).exp())
        };
        let measured: Vec<f64> = (0..80)
            .map(|k| level(k) + 0.1 * normal(&mut random))
            .collect();
        let axis = TimeAxis::Uniform {
            sample_time: 0.25,
            samples: 80,
        };
        let recording = Recording::new(axis, vec![Signal::new("level", "1", measured)]);
        let outcome = run(
            json!({
                "model": {
                    "name": "one_compartment",
                    "parameters":
                        {"ka": range(0.05, 5.0), "ke": range(0.05, 5.0), "V": range(0.1, 50.0)},
                    "states": {
                        "gut": {"derivative": "-ka*gut", "initial": 100},
                        "blood": {"derivative": "ka*gut/V - ke*blood", "initial": 0}
                    },
                    "outputs": {"level": {"expression": "blood"}}
                },
                "experiments": [{}],
                "outputs": {"level": {"noise_std": 0.1}},
                "constraints": ["ke < ka"],
                "validation": {"fraction": 0},
                "seed": seed
            }),
            recording,
        );
        assert_eq!(reason(&outcome, Rule::TwinMinima), None, "seed {seed}");
        for (name, truth) in [("ka", absorption), ("ke", elimination), ("V", volume)] {
            let mut found = outcome.parameters.iter();
            let found = found.find(|own| own.name == name).expect("an estimate");
            let error = found.estimate.standard_error.expect("an error");
            let off = (found.estimate.estimate - truth) / error;
            assert!(off.abs() < 4.0, "seed {seed}: {name} is off by {off}");
        }
    }
}

#[test]
fn what_is_known_of_two_together_is_met_as_bayes_says() {
    let regression = Regression::new([0.9, 0.7], 7);
    let ([[aa, ab], [_, bb]], [ay, by]) = regression.normal_equations();
    let (mean, std, correlation) = ([0.88, 0.75], [0.01_f64, 0.02_f64], -0.8_f64);
    let covariance = [
        [std[0] * std[0], correlation * std[0] * std[1]],
        [correlation * std[0] * std[1], std[1] * std[1]],
    ];
    let determinant = covariance[0][0] * covariance[1][1] - covariance[0][1].powi(2);
    let [paa, pbb, pab] = [
        covariance[1][1] / determinant,
        covariance[0][0] / determinant,
        -covariance[0][1] / determinant,
    ];
    // The information and the right-hand side of both together.
    let (saa, sab, sbb) = (aa + paa, ab + pab, bb + pbb);
    let right = [
        ay + paa * mean[0] + pab * mean[1],
        by + pab * mean[0] + pbb * mean[1],
    ];
    let determinant = saa * sbb - sab * sab;
    let expected = [
        (sbb * right[0] - sab * right[1]) / determinant,
        (saa * right[1] - sab * right[0]) / determinant,
    ];
    let errors = [sbb / determinant, saa / determinant].map(f64::sqrt);
    let said = [
        json!({"parameters": ["a", "b"], "mean": mean, "covariance": covariance}),
        json!({
            "parameters": ["b", "a"], "mean": [mean[1], mean[0]], "std": [std[1], std[0]],
            "correlation": [[1, correlation], [correlation, 1]]
        }),
    ];
    for prior in said {
        let outcome = regression.run(&json!({"priors": [prior]}));
        for (index, value) in estimates(&outcome).into_iter().enumerate() {
            near(value / expected[index], 1.0, 1e-7);
            let known = &outcome.parameters[index].estimate;
            let error = known.standard_error.expect("an error");
            near(error / errors[index], 1.0, 1e-5);
            let shift = known.prior_shift.expect("a prior");
            near(shift, (value - mean[index]) / std[index], 1e-9);
        }
    }
}
