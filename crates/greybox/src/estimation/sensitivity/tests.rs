//! Derivatives at the edge of what a model can do.

use super::*;
use crate::identification::Identification;
use greybox_recording::Recording;
use serde_json::json;

/// A discharge whose rate is no number where `loss` is below 0.
fn problem() -> Problem {
    let model = json!({
        "name": "discharge",
        "inputs": {"supply": {"symbol": "u", "unit": "V"}},
        "parameters": {"loss": {"symbol": "k", "unit": "1/s", "default": 0.5, "lower": -1, "upper": 1}},
        "constants": {"second": {"value": 1.0, "unit": "s"}},
        "states": {"voltage": {"symbol": "v", "unit": "V", "initial": 1,
                               "derivative": "(u - v)*k*(1 + sqrt(k*second))"}},
        "outputs": {"voltage": {"unit": "V", "expression": "v"}},
    });
    let job = json!({
        "model": model,
        "parameters": {"loss": {"estimate": {"scale": "linear"}}},
        "outputs": {"voltage": {"noise_std": 0.5}},
        "validation": {"fraction": 0},
    });
    let voltages = (0..11).map(|sample| 1.0 - 0.01 * f64::from(sample));
    let recording = Recording::from_samples(
        0.1,
        [
            ("supply", "V", vec![0.0; 11]),
            ("voltage", "V", voltages.collect()),
        ],
    );
    Identification::of_job(job, recording).problem().unwrap()
}

#[test]
fn where_one_neighbour_cannot_be_simulated_the_other_tells_the_derivative() {
    let problem = problem();
    let never = AtomicBool::new(false);
    // The loss is 2e-7 1/s: below it by one shift nothing can be simulated.
    let around = around(&problem, &[0.500_000_1], Accuracy::Full, &never).unwrap();
    assert!(!around.fails_along(0));
    let mut visited = 0;
    let visit = |row: Row<'_>| {
        // v = exp(−k·t), whose derivative by k is −t at k = 0; the range is 2 1/s long.
        let time = 0.1 * row.sample as f64;
        let scale = around.scale(row.place());
        let expected = 2.0 * time / scale;
        let error = (row.derivatives[0] - expected).abs();
        assert!(
            error <= 0.01 * expected,
            "{} {expected}",
            row.derivatives[0]
        );
        visited += 1;
    };
    around.visit(visit).unwrap();
    assert_eq!(visited, 11);
}

#[test]
fn where_neither_neighbour_can_be_simulated_there_is_no_derivative() {
    let problem = problem();
    let never = AtomicBool::new(false);
    let around = around(&problem, &[0.25], Accuracy::Full, &never).unwrap();
    assert!(around.fails_along(0) && around.visit(|_| ()).is_err());
}
