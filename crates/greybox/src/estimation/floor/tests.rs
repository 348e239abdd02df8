//! When the lowest minimum is believed, and what is done when it is not.

use super::*;
use crate::estimation::settings::MethodName;
use crate::identification::outcome::{Rule, Trust};
use crate::{Identification, Outcome, Recording};
use greybox_numerics::rng::{self, Purpose, stream};
use serde_json::{Value, json};

fn landmarks(declares_noise: bool) -> Landmarks {
    Landmarks {
        plateau: 1000.0,
        residuals: 500,
        unknowns: 12,
        declares_noise,
    }
}

/// Descents of searches that ended at costs.
fn ended(costs: &[(u32, f64)]) -> Vec<Descent> {
    let descent = |&(search, cost): &(u32, f64)| {
        let mut descent = Descent::from(vec![0.5]);
        descent.search = Some(search);
        descent.cost = Some(cost);
        descent.end = Some(DescentEnd::Converged);
        descent
    };
    costs.iter().map(descent).collect()
}

#[test]
fn a_poor_fit_is_believed_when_a_second_search_comes_to_it() {
    let landmarks = landmarks(true);
    let first = [(0, 40.0), (0, 40.0), (0, 90.0)];
    assert!(is_doubtful(&landmarks, &ended(&first)));
    let other = [first[0], first[1], first[2], (1, 55.0)];
    assert!(is_doubtful(&landmarks, &ended(&other)));
    let lower = [first[0], (1, 30.0)];
    assert!(is_doubtful(&landmarks, &ended(&lower)), "found once, lower");
    let same = [first[0], first[1], first[2], (1, 40.0)];
    assert!(!is_doubtful(&landmarks, &ended(&same)));
    let floor = FloorReport::of(&landmarks, &ended(&same)).expect("costs");
    assert_eq!(
        (floor.starts, floor.starts_at_floor, floor.searches_at_floor),
        (4, 3, 2)
    );
}

#[test]
fn of_very_few_residuals_declared_noise_is_believed_before_searches_that_agree() {
    let few = |declares_noise| Landmarks {
        residuals: 21,
        ..landmarks(declares_noise)
    };
    let same = ended(&[(0, 40.0), (1, 40.0), (2, 40.0)]);
    assert!(is_doubtful(&few(true), &same));
    assert!(!is_doubtful(&few(false), &same));
    let noise = ended(&[(0, 0.9), (1, 0.9), (2, 40.0)]);
    assert!(!is_doubtful(&few(true), &noise));
    let settings = Settings::default();
    assert_eq!(few(true).most_searches(&settings), 1 + 4 * 12);
    assert_eq!(landmarks(true).most_searches(&settings), 1 + 4);
    let none = Settings {
        further_searches: 0,
        ..settings
    };
    assert_eq!(few(true).most_searches(&none), 1);
}

#[test]
fn searches_beyond_those_a_job_allows_are_of_another_kind() {
    let settings = Settings::default();
    assert_eq!(settings.of_search(4, 12), settings);
    let beyond = settings.of_search(5, 12);
    assert_eq!(beyond.name, MethodName::DifferentialEvolution);
    assert_eq!(beyond.population, 60);
    let rival = Settings {
        name: MethodName::CmaEs,
        ..settings
    };
    assert_eq!(rival.of_search(5, 12), rival);
}

#[test]
fn a_likelier_minimum_costs_more_than_a_standard_error_less() {
    let few = Landmarks {
        residuals: 20,
        ..landmarks(true)
    };
    assert!(few.is_likelier(0.9, 1.0));
    assert!(!few.is_likelier(0.96, 1.0), "0.8 in chi-square");
    let undeclared = Landmarks {
        declares_noise: false,
        ..few
    };
    assert!(!undeclared.is_likelier(0.9, 1.0));
    let long = Landmarks {
        residuals: 5000,
        ..landmarks(true)
    };
    assert!(!long.is_likelier(0.9995, 1.0), "as much as simulation errs");
}

#[test]
fn what_only_noise_is_left_of_is_believed_at_once() {
    let found = ended(&[(0, 1.02), (0, 7.0), (0, 8.0)]);
    let long = Landmarks {
        residuals: 5000,
        ..landmarks(true)
    };
    assert!(!is_doubtful(&long, &found));
    assert!(
        is_doubtful(&landmarks(true), &found),
        "few residuals: found once"
    );
    // A tenth of the spread, squared, is as small where no noise is declared; but found once.
    let found = [(0, 0.004), (0, 0.02)];
    assert!(is_doubtful(&landmarks(false), &ended(&found)));
    assert!(!is_doubtful(
        &landmarks(false),
        &ended(&[found[0], found[0]])
    ));
}

#[test]
fn what_only_an_exchange_came_to_is_looked_for_again() {
    let mut found = ended(&[(0, 0.74), (0, 0.74), (0, 0.31)]);
    found[2].search = None;
    let landmarks = Landmarks {
        residuals: 13,
        ..landmarks(true)
    };
    let floor = FloorReport::of(&landmarks, &found).expect("costs");
    assert_eq!((floor.starts, floor.starts_at_floor), (2, 0));
    assert!(is_doubtful(&landmarks, &found));
}

#[test]
fn costs_of_data_without_noise_are_the_same_when_both_are_next_to_nothing() {
    let found = ended(&[(0, 1e-14), (0, 3e-12), (0, 2e-3)]);
    let floor = FloorReport::of(&landmarks(false), &found).expect("costs");
    assert_eq!((floor.starts, floor.starts_at_floor), (3, 2));
    assert!(!is_doubtful(&landmarks(false), &found));
}

#[test]
fn a_plateau_is_never_believed_however_often_it_is_found() {
    let found = ended(&[(0, 999.0), (1, 999.0), (2, 999.0)]);
    assert!(is_doubtful(&landmarks(true), &found));
    assert!(is_doubtful(&landmarks(true), &[]), "nothing is found");
}

/// What went up and comes down again: a dose is absorbed and eliminated. With the two rates
/// exchanged, and another volume, the concentration is the same.
fn kinetics(seed: u64) -> Outcome {
    let (absorption, elimination, volume) = (1.5, 0.3, 10.0);
    let mut noise = stream(seed, 0, Purpose::Noise);
    let concentration = (0..100).map(|k| {
        let t = 0.1 * f64::from(k);
        let scale = absorption / (volume * (absorption - elimination));
        let exact = scale * ((-elimination * t).exp() - (-absorption * t).exp());
        exact + 1e-3 * rng::normal(&mut noise)
    });
    let concentration = concentration.collect();
    let recording =
        Recording::from_samples(0.1, [("u", "1", vec![0.0; 100]), ("c", "1", concentration)]);
    let rate = json!({"unit": "1/s", "default": 1, "lower": 0.05, "upper": 5, "scale": "log",
                      "unknown": true});
    let job = json!({
        "model": {
            "name": "kinetics",
            "inputs": {"u": {"unit": "1"}},
            "parameters": {
                "absorption": rate,
                "elimination": rate,
                "volume": {"unit": "1", "default": 5, "lower": 1, "upper": 100, "scale": "log",
                           "unknown": true},
            },
            "states": {
                "gut": {"unit": "1", "initial": 1, "derivative": "-absorption*gut"},
                "blood": {"unit": "1", "initial": 0,
                          "derivative": "absorption*gut - elimination*blood"},
            },
            "outputs": {"c": {"unit": "1", "expression": "blood/volume"}},
        },
        "outputs": {"c": {"noise_std": 1e-3}},
        "validation": {"fraction": 0},
        "seed": seed,
    });
    run(job, recording)
}

fn run(job: Value, recording: Recording) -> Outcome {
    let found = Identification::of_job(job, recording).run();
    found.unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn parameters_that_can_change_their_places_are_reported_both_ways() {
    for seed in 1..=3 {
        let outcome = kinetics(seed);
        let mut reasons = outcome.verdict.reasons.iter();
        assert!(
            reasons.any(|reason| reason.code == Rule::TwinMinima),
            "{:?}",
            outcome.verdict
        );
        assert_eq!(outcome.verdict.trust, Trust::Low);
        let twins = outcome.floor.expect("a floor").twins;
        let [twin] = &twins[..] else {
            panic!("{twins:?}");
        };
        let own = |name| outcome.parameters.iter().find(|known| known.name == name);
        let own = own("absorption").expect("it is free").estimate.estimate;
        // Noise of a thousandth leaves some per cent.
        assert!(
            (twin["elimination"] / own - 1.0).abs() < 0.2,
            "{own} {twin:?}"
        );
    }
}

/// Hares and lynxes: over several cycles a wrong period is a valley of its own.
fn prey_and_predators(seed: u64) -> Outcome {
    let rates = |[x, y]: [f64; 2]| [1.0 * x - 0.1 * x * y, 0.075 * x * y - 1.5 * y];
    let mut noise = stream(seed, 0, Purpose::Noise);
    let mut state = [10.0, 5.0];
    let (mut prey, mut predators) = (Vec::new(), Vec::new());
    for _ in 0..150 {
        prey.push(state[0] + 0.5 * rng::normal(&mut noise));
        predators.push(state[1] + 0.5 * rng::normal(&mut noise));
        // The midpoint rule at a hundredth of the sample time.
        for _ in 0..100 {
            let slope = rates(state);
            let half = [state[0] + 5e-4 * slope[0], state[1] + 5e-4 * slope[1]];
            let slope = rates(half);
            state = [state[0] + 1e-3 * slope[0], state[1] + 1e-3 * slope[1]];
        }
    }
    let recording = Recording::from_samples(
        0.1,
        [
            ("u", "1", vec![0.0; 150]),
            ("prey", "1", prey),
            ("predators", "1", predators),
        ],
    );
    let rate = json!({"unit": "1/s", "default": 1, "lower": 0.01, "upper": 10, "scale": "log",
                      "unknown": true});
    let job = json!({
        "model": {
            "name": "prey_and_predators",
            "inputs": {"u": {"unit": "1"}},
            "parameters": {"a": rate, "b": rate, "c": rate, "d": rate},
            "states": {
                "x": {"unit": "1", "initial": 10, "derivative": "a*x - b*x*y"},
                "y": {"unit": "1", "initial": 5, "derivative": "c*x*y - d*y"},
            },
            "outputs": {
                "prey": {"unit": "1", "expression": "x"},
                "predators": {"unit": "1", "expression": "y"},
            },
        },
        "outputs": {"prey": {"noise_std": 0.5}, "predators": {"noise_std": 0.5}},
        "validation": {"fraction": 0},
        "seed": seed,
    });
    run(job, recording)
}

#[test]
fn a_search_that_ends_in_the_wrong_valley_is_repeated_until_the_floor_is_found() {
    for seed in 1..=4 {
        let outcome = prey_and_predators(seed);
        let chi_square = outcome.residuals["prey"].chi_square_per_sample;
        println!(
            "seed {seed}: {chi_square:?}, {} searches, {:?}",
            outcome.searches.len(),
            outcome.floor
        );
        // 150 squares of normal numbers have a mean of 1 ± 0.12.
        assert!(chi_square.is_some_and(|chi_square| chi_square < 1.5));
    }
}
