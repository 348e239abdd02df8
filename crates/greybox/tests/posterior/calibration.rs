//! Simulation-based calibration: parameters drawn from the prior, a record simulated with them, draws
//! from its posterior. The rank of the parameter among the draws is then uniform (S. Talts, M.
//! Betancourt, D. Simpson, A. Vehtari, A. Gelman, "Validating Bayesian Inference Algorithms with
//! Simulation-Based Calibration", 2018).

use super::{descended, draw};
use greybox::estimation::Problem;
use greybox::estimation::prior::Prior;
use greybox::estimation::trajectory;
use greybox::model::{Model, Scale};
use greybox::numerics::rng::{Purpose, below, normal, stream};
use greybox::{Identification, Recording};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A mass on a spring and a damper.
const RIG: &str = r#"{
    "name": "rig", "title": "mass on a spring",
    "inputs": {"force": {"unit": "N"}},
    "parameters": {
        "mass": {"unit": "kg", "default": 10, "lower": 1, "upper": 100, "scale": "log", "unknown": true},
        "damping": {"unit": "N*s/m", "default": 20, "lower": 0, "upper": 60, "unknown": true},
        "stiffness": {"unit": "N/m", "default": 200, "lower": 20, "upper": 2000, "scale": "log", "unknown": true}
    },
    "states": {
        "x": {"unit": "m", "derivative": "v", "initial": 0},
        "v": {"unit": "m/s", "derivative": "(force - damping*v - stiffness*x)/mass", "initial": 0}
    },
    "outputs": {"position": {"unit": "m", "expression": "x"}}
}"#;

/// The standard deviation of the noise `[m]`, of a movement of some 50 mm.
const NOISE: f64 = 0.02;
const SAMPLES: usize = 40;
const RECORDS: u64 = 200;
/// Draws among which the parameter has a rank, from 0 to this.
const DRAWS: usize = 99;
const BINS: usize = 20;
/// What χ² of 19 degrees of freedom exceeds one time in a thousand (M. Abramowitz, I. A. Stegun,
/// *Handbook of Mathematical Functions*, 1964, table 26.8).
const CHI_SQUARE: f64 = 43.82;

/// How many records a test takes, where fewer or more than usual are asked for.
fn records() -> u64 {
    let asked = std::env::var("GREYBOX_TESTS_RECORDS").ok();
    let asked = asked.and_then(|text| text.parse().ok());
    asked.unwrap_or(RECORDS)
}

/// The rig with priors: of the value where the search range is laid out in logarithms, and the other way
/// round.
fn problem() -> Problem {
    let mut rng = stream(0, 1, Purpose::Excitation);
    let force = (0..SAMPLES).map(|_| if below(&mut rng, 2) == 0 { 10.0 } else { -10.0 });
    let recording = Recording::from_samples(
        0.2,
        [
            ("force", "N", force.collect()),
            ("position", "m", vec![0.0; SAMPLES]),
        ],
    );
    let model = Model::from_text(RIG).unwrap();
    let identification = Identification::new(&model, recording).hold_back(0.0);
    let mut problem = identification.noise("position", NOISE).problem().unwrap();
    let priors = [
        (10.0, 2.0, Scale::Linear),
        (20_f64.ln(), 0.25, Scale::Log),
        (200_f64.ln(), 0.2, Scale::Log),
    ];
    let unknowns = problem.coordinates.iter_mut();
    for (unknown, (middle, deviation, scale)) in unknowns.zip(priors) {
        unknown.prior = Some(Prior {
            middle,
            deviation,
            scale,
        });
    }
    problem
}

/// The ranks of the true values of one record.
fn ranks(problem: &Problem, record: u64) -> Vec<usize> {
    let mut rng = stream(record, 2, Purpose::Noise);
    let unknowns = problem.coordinates.iter();
    let values = unknowns.map(|unknown| {
        let prior = unknown.prior.unwrap();
        let drawn = prior.middle + prior.deviation * normal(&mut rng);
        match prior.scale {
            Scale::Linear => drawn,
            Scale::Log => drawn.exp(),
        }
    });
    let values: Vec<f64> = values.collect();
    let unknowns = problem.coordinates.iter().zip(&values);
    let truth = unknowns
        .map(|(unknown, value)| unknown.scale.position(*value, unknown.lower, unknown.upper));
    let truth: Vec<f64> = truth.collect();
    let never = AtomicBool::new(false);
    let simulated = trajectory::simulate(problem, &truth, &never)
        .unwrap()
        .unwrap();
    let mut problem = problem.clone();
    let measured = &mut Arc::make_mut(&mut problem.experiments)[0].measured[0];
    for (sample, value) in measured.iter_mut().enumerate() {
        *value = simulated[0][0][sample] + NOISE * normal(&mut rng);
    }
    let posterior = draw(&problem, &descended(&problem, truth), 500, record);
    let draws = posterior.thinned.len();
    let chosen = (0..DRAWS).map(|draw| &posterior.thinned[draw * draws / DRAWS]);
    let rank = |index: usize| {
        let below = chosen.clone().filter(|draw| draw[index] < values[index]);
        below.count()
    };
    (0..values.len()).map(rank).collect()
}

#[test]
fn ranks_of_true_values_among_draws_are_uniform() {
    let problem = problem();
    let records = records();
    let mut bins = vec![[0_u32; BINS]; problem.coordinates.len()];
    for record in 0..records {
        let ranks = ranks(&problem, record);
        for (bins, rank) in bins.iter_mut().zip(ranks) {
            bins[rank * BINS / (DRAWS + 1)] += 1;
        }
    }
    let expected = records as f64 / BINS as f64;
    for (unknown, bins) in problem.coordinates.iter().zip(&bins) {
        let terms = bins
            .iter()
            .map(|count| (f64::from(*count) - expected).powi(2) / expected);
        let chi_square: f64 = terms.sum();
        println!("{}: chi-square {chi_square:.1}, {bins:?}", unknown.name);
        assert!(chi_square < CHI_SQUARE, "{}: {chi_square}", unknown.name);
    }
}
