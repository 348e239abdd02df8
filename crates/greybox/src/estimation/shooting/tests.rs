//! Records over which the free run of a candidate that is a little wrong gets out of step.

use super::*;
use crate::estimation::refine;
use crate::{Identification, Recording};
use greybox_numerics::rng::{self, Purpose, stream};
use greybox_simulation::Accuracy;
use greybox_simulation::model::Model;

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

const NOISE: f64 = 0.05;

/// A membrane whose recovery nobody measures (R. FitzHugh, 1961; J. Nagumo et al., 1962), with the
/// numbers of J. O. Ramsay et al., "Parameter estimation for differential equations", 2007: a = b = 0.2,
/// c = 3.
const MEMBRANE: &str = r#"{
    "name": "membrane",
    "parameters": {"a": {"unit": "1", "default": 0.5, "lower": -1, "upper": 2},
                   "b": {"unit": "1", "default": 0.5, "lower": -1, "upper": 2},
                   "c": {"unit": "1/s", "default": 4, "lower": 0.5, "upper": 8},
                   "one": {"unit": "1/s^2", "default": 1, "lower": 0.5, "upper": 2}},
    "states": {"v": {"unit": "1", "initial": -1, "derivative": "c*(v - v^3/3 + r)"},
               "r": {"unit": "1", "initial": 1, "derivative": "-one*(v - a + b*r)/c"}},
    "outputs": {"potential": {"unit": "1", "expression": "v"}}
}"#;

/// An oscillator without damping: only its position is measured, not its speed.
const OSCILLATOR: &str = r#"{
    "name": "oscillator",
    "parameters": {"rate": {"unit": "rad/s", "default": 2, "lower": 0.5, "upper": 5}},
    "states": {"x": {"unit": "m", "initial": 1, "derivative": "v"},
               "v": {"unit": "m/s", "initial": 0, "derivative": "-rate^2*x"}},
    "outputs": {"position": {"unit": "m", "expression": "x"}}
}"#;

/// Samples with noise.
fn record(
    sample_time: f64,
    [name, unit]: [&str; 2],
    truth: impl Iterator<Item = f64>,
) -> Recording {
    let mut rng = stream(3, 0, Purpose::Noise);
    let values: Vec<f64> = truth
        .map(|own| own + NOISE * rng::normal(&mut rng))
        .collect();
    Recording::from_samples(sample_time, [(name, unit, values)])
}

/// The membrane's potential by Runge and Kutta's method at a two-hundredth of the sample time.
fn potentials() -> Recording {
    let slope = |[v, r]: [f64; 2]| [3.0 * (v - v * v * v / 3.0 + r), -(v - 0.2 + 0.2 * r) / 3.0];
    let step = 0.05 / 200.0;
    let mut state = [-1.0, 1.0];
    let mut truth = Vec::new();
    for k in 0..(401 * 200) {
        if k % 200 == 0 {
            truth.push(state[0]);
        }
        let moved = |by: [f64; 2], share: f64| [state[0] + share * by[0], state[1] + share * by[1]];
        let k1 = slope(state);
        let k2 = slope(moved(k1, step / 2.0));
        let k3 = slope(moved(k2, step / 2.0));
        let k4 = slope(moved(k3, step));
        for n in 0..2 {
            state[n] += step / 6.0 * (k1[n] + 2.0 * k2[n] + 2.0 * k3[n] + k4[n]);
        }
    }
    record(0.05, ["potential", "1"], truth.into_iter())
}

/// A problem with these parameters free.
fn problem(model: &str, free: &[&str], (recording, output): (Recording, &str)) -> Problem {
    let model = Model::from_text(model).unwrap();
    let all = Identification::new(&model, recording)
        .noise(output, NOISE)
        .hold_back(0.0);
    let parameters = &model.description().parameters;
    let free = parameters.iter().filter(|own| free.contains(&&*own.name));
    let free = free.fold(all, |all, own| all.free(&own.name, own.lower..=own.upper));
    free.problem().unwrap()
}

/// The cost that a descent of the free run comes to.
fn descended(problem: &Problem, start: Vec<f64>) -> (Vec<f64>, f64) {
    let ended = refine::descend(problem, start, Accuracy::Screening, &NEVER).unwrap();
    let cost = ended.cost.unwrap_or(f64::INFINITY);
    (problem.values(&ended.positions), cost)
}

fn shot(problem: &Problem, start: Vec<f64>) -> Shooting {
    let mut shooting = Shooting::from(None, start);
    while !shooting.has_ended {
        assert!(shooting.iterate(problem, &NEVER));
    }
    shooting
}

#[test]
fn a_rate_is_found_over_thirty_periods_from_far_away() {
    let truth = (0..600)
        .map(|k| f64::from(k) * 0.15)
        .map(|time| (2.0 * time).cos());
    let problem = problem(
        OSCILLATOR,
        &["rate"],
        (record(0.15, ["position", "m"], truth), "position"),
    );
    for start in [0.8, 1.5, 2.7, 4.5] {
        let start = vec![(start - 0.5) / 4.5];
        let (_, alone) = descended(&problem, start.clone());
        assert!(
            alone > 50.0,
            "the free run finds it from {start:?} by itself: {alone}"
        );
        let (rate, cost) = descended(&problem, shot(&problem, start).positions);
        assert!(
            cost < 1.2 && (rate[0] - 2.0).abs() < 1e-3,
            "{rate:?} {cost}"
        );
    }
}

#[test]
fn a_membrane_is_found_although_its_recovery_is_not_measured() {
    let problem = problem(MEMBRANE, &["a", "b", "c"], (potentials(), "potential"));
    let places = [0.2, 0.5, 0.8];
    let starts = places
        .iter()
        .flat_map(|a| places.map(|c| vec![*a, 1.0 - a, c]));
    let (mut alone, mut over_segments) = (0, 0);
    for start in starts {
        alone += usize::from(descended(&problem, start.clone()).1 < 1.2);
        let (values, cost) = descended(&problem, shot(&problem, start).positions);
        if cost < 1.2 {
            over_segments += 1;
            for (value, truth) in values.iter().zip([0.2, 0.2, 3.0]) {
                assert!((value - truth).abs() < 0.05, "{values:?}");
            }
        }
    }
    assert!(
        over_segments >= 8 && over_segments > alone,
        "{over_segments} {alone}"
    );
}

#[test]
fn a_shooting_that_is_saved_after_each_iteration_comes_to_the_same() {
    let problem = problem(MEMBRANE, &["a", "b", "c"], (potentials(), "potential"));
    let start = vec![0.2, 0.8, 0.8];
    let whole = shot(&problem, start.clone());
    let mut shooting = Shooting::from(None, start);
    while !shooting.has_ended {
        assert!(shooting.iterate(&problem, &NEVER));
        let saved = serde_json::to_string(&shooting).unwrap();
        shooting = serde_json::from_str(&saved).unwrap();
    }
    assert_eq!(shooting.positions, whole.positions);
    assert_eq!(shooting.evaluations, whole.evaluations);
}

#[test]
fn what_is_stopped_has_not_changed() {
    let problem = problem(MEMBRANE, &["a", "b", "c"], (potentials(), "potential"));
    let mut shooting = Shooting::from(None, vec![0.5; 3]);
    assert!(!shooting.iterate(&problem, &AtomicBool::new(true)));
    assert!(shooting.iterate(&problem, &NEVER));
    let before = (shooting.positions.clone(), shooting.evaluations);
    assert!(!shooting.iterate(&problem, &AtomicBool::new(true)));
    assert_eq!((shooting.positions.clone(), shooting.evaluations), before);
    assert!(!shooting.has_ended);
}

#[test]
fn a_candidate_that_cannot_be_simulated_ends_at_once() {
    let unstable = r#"{
        "name": "unstable",
        "parameters": {"k": {"unit": "1/s", "default": 1, "lower": 0.1, "upper": 1000}},
        "states": {"x": {"unit": "1", "initial": 1, "derivative": "k*x^2"}},
        "outputs": {"out": {"unit": "1", "expression": "x"}}
    }"#;
    let truth = (0..60).map(|k| 1.0 / (1.0 - 0.2 * f64::from(k) / 60.0));
    let problem = problem(
        unstable,
        &["k"],
        (record(1.0 / 60.0, ["out", "1"], truth), "out"),
    );
    let mut shooting = Shooting::from(None, vec![1.0]);
    for _ in 0..MOST_ITERATIONS {
        assert!(shooting.iterate(&problem, &NEVER));
    }
    assert!(shooting.has_ended);
}
