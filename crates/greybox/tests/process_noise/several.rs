//! Plants on which several disturbances act: one alone leaves the other output unexplained.

use super::coverage::records;
use greybox::numerics::rng::{Purpose, below, normal, stream};
use greybox::uncertainty::verdict::Trust;
use greybox::{Identification, Outcome, Recording};
use rayon::prelude::*;
use serde_json::json;

/// Steps of Euler and Maruyama between two samples.
const SUBSTEPS: usize = 50;

/// Two rooms with a heater each, of which each loses heat and is disturbed by a white flow of its own.
fn rooms(seed: u64) -> Recording {
    let mut rng = stream(seed, 12, Purpose::Noise);
    let (mut first, mut second) = (0.0, 0.0);
    let (mut heat_1, mut heat_2) = (0.0, 0.0);
    let mut signals = [const { Vec::new() }; 4];
    let step = 1.0 / SUBSTEPS as f64;
    for sample in 0..400 {
        if sample % 25 == 0 {
            heat_1 = f64::from(below(&mut rng, 5) as u32);
            heat_2 = f64::from(below(&mut rng, 5) as u32);
        }
        let seen = [first, second].map(|value| value + 0.02 * normal(&mut rng));
        for (signal, value) in signals.iter_mut().zip([heat_1, heat_2, seen[0], seen[1]]) {
            signal.push(value);
        }
        for _ in 0..SUBSTEPS {
            let between = 0.1 * (first - second);
            first +=
                step * (heat_1 - 0.05 * first - between) + 0.1 * step.sqrt() * normal(&mut rng);
            second +=
                step * (heat_2 - 0.05 * second + between) + 0.1 * step.sqrt() * normal(&mut rng);
        }
    }
    let [heat_1, heat_2, first, second] = signals;
    Recording::from_samples(
        1.0,
        [
            ("heat_1", "K/s", heat_1),
            ("heat_2", "K/s", heat_2),
            ("first", "K", first),
            ("second", "K", second),
        ],
    )
}

fn job(recording: Recording) -> Outcome {
    let unknown = |symbol: &str, default: f64| {
        json!({"symbol": symbol, "unit": "1/s", "default": default, "lower": default / 10.0,
               "upper": default * 10.0, "scale": "log", "unknown": true})
    };
    let job = json!({
        "model": {
            "name": "rooms",
            "inputs": {"heat_1": {"symbol": "u1", "unit": "K/s"}, "heat_2": {"symbol": "u2", "unit": "K/s"}},
            "parameters": {"loss": unknown("a", 0.08), "exchange": unknown("c", 0.06)},
            "states": {
                "room_1": {"symbol": "x1", "unit": "K", "initial": 0,
                           "derivative": "u1 - a*x1 - c*(x1 - x2)"},
                "room_2": {"symbol": "x2", "unit": "K", "initial": 0,
                           "derivative": "u2 - a*x2 + c*(x1 - x2)"}
            },
            "outputs": {"first": {"unit": "K", "expression": "x1"},
                        "second": {"unit": "K", "expression": "x2"}}
        },
        "process_noise": "auto",
        "validation": {"fraction": 0},
        "seed": 1,
    });
    let outcome = Identification::of_job(job, recording).run();
    outcome.unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn a_disturbance_of_each_of_two_rooms_is_found() {
    let outcomes: Vec<Outcome> = (0..records())
        .into_par_iter()
        .map(|seed| job(rooms(seed)))
        .collect();
    let least = (0.88 * records() as f64) as usize - usize::from(records() < 100);
    let both = outcomes.iter().filter(|outcome| {
        let noise = outcome
            .process_noise
            .as_ref()
            .expect("noise models are compared");
        let acts_on = |state: &str| noise.chosen.contains(&format!("on the rate of `{state}`"));
        acts_on("room_1") && acts_on("room_2")
    });
    let both = both.count();
    let of = |name: &str, truth: f64| {
        let estimates = outcomes
            .iter()
            .map(|outcome| &outcome.parameter(name).unwrap().estimate);
        let covers = estimates.clone().filter(|estimate| {
            let interval = estimate.total_interval.unwrap();
            (interval.lower.unwrap()..interval.upper.unwrap()).contains(&truth)
        });
        let usable = estimates
            .clone()
            .filter(|estimate| estimate.trust != Some(Trust::Low));
        (covers.count(), usable.count())
    };
    let (loss, exchange) = (of("loss", 0.05), of("exchange", 0.1));
    println!(
        "both {both}, loss {loss:?}, exchange {exchange:?} of {}",
        records()
    );
    assert!(both >= least, "{both}");
    for (covered, usable) in [loss, exchange] {
        assert!(covered >= least && usable >= least, "{covered} {usable}");
    }
}
