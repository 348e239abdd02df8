//! An elimination that begins above the floor of the model with all effects.

use super::*;
use crate::estimation::observer::Counters;
use crate::estimation::stop_reason::StopReason;
use crate::identification::Identification;
use crate::uncertainty::refits::{Quota, Refits};
use greybox_recording::Recording;
use serde_json::json;

/// A carriage on a spring and a damper; drag and dry friction, which a model may leave out, are not in the recording.
fn problem() -> Problem {
    let number = |symbol: &str, unit: &str, range: [f64; 3]| {
        let [default, lower, upper] = range;
        json!({"symbol": symbol, "unit": unit, "default": default, "lower": lower, "upper": upper})
    };
    let model = json!({
        "name": "carriage",
        "inputs": {"force": {"symbol": "f", "unit": "N"}},
        "parameters": {
            "mass": number("m", "kg", [2.0, 0.2, 20.0]),
            "stiffness": number("k", "N/m", [50.0, 5.0, 500.0]),
            "damping": number("d", "N*s/m", [3.0, 1.0, 9.0]),
            "drag": number("q", "N*s^2/m^2", [0.0, 0.0, 50.0]),
            "dry_friction": number("Fc", "N", [0.0, 0.0, 10.0]),
        },
        "states": {
            "position": {"symbol": "x", "unit": "m", "derivative": "v", "initial": 0},
            "velocity": {"symbol": "v", "unit": "m/s", "initial": 0,
                         "derivative": "(f - d*v - k*x - q*v*abs(v) - Fc*soft_sign(v, 0.01))/m"},
        },
        "outputs": {"position": {"unit": "m", "expression": "x"}},
    });
    let job = json!({
        "model": model,
        "parameters": {"mass": {"estimate": {}}, "stiffness": {"estimate": {}},
                       "drag": {"estimate": {}}, "dry_friction": {"estimate": {}}},
        "outputs": {"position": {"noise_std": 1e-4}},
        "validation": {"fraction": 0},
        "model_search": {"effects": ["drag", "dry_friction"]},
    });
    let (mut position, mut velocity) = (0.0, 0.0);
    let forces = (0..300).map(|k| if (k / 17) % 2 == 0 { 20.0 } else { -20.0 });
    let forces: Vec<f64> = forces.collect();
    let positions = forces.iter().enumerate().map(|(k, force)| {
        let now = position + 1e-4 * ((k * k * 7919 % 101) as f64 / 50.0 - 1.0);
        for _ in 0..100 {
            velocity += 2e-4 * (force - 3.0 * velocity - 60.0 * position) / 2.5;
            position += 2e-4 * velocity;
        }
        now
    });
    let positions: Vec<f64> = positions.collect();
    let recording =
        Recording::from_samples(0.02, [("force", "N", forces), ("position", "m", positions)]);
    Identification::of_job(job, recording).problem().unwrap()
}

#[test]
fn the_model_with_all_effects_never_ends_above_a_smaller_one() {
    let problem = problem();
    let never = AtomicBool::new(false);
    // What a search that has missed its floor would leave.
    let positions = vec![0.9; problem.coordinates.len()];
    let report = Report {
        stop_reason: StopReason::GenerationLimit,
        values: problem.values(&positions),
        positions,
        cost: Some(1e6),
        generations: 1,
        counters: Counters::default(),
        best_credit: None,
        best_generation: None,
        declared_positions: None,
        searches: Vec::new(),
        starts: Vec::new(),
        floor: None,
        twins: Vec::new(),
    };
    let effects = ["drag".to_owned(), "dry_friction".to_owned()];
    let mut elimination = Elimination::begin(&problem, &report, &effects, &never).unwrap();
    let mut refits = Refits::default();
    let selected = loop {
        let mut sequences = elimination.sequences();
        refits.run(&mut sequences, Quota::UNLIMITED, &never);
        match elimination.after_round() {
            AfterRound::Further(further) => elimination = *further,
            AfterRound::Selected(selected) => break selected,
        }
    };
    let tried = &selected.selection.tried;
    let mut by_effects = tried.iter();
    let whole = by_effects.find(|model| model.effects.len() == 2).unwrap();
    let cost = whole.cost.unwrap();
    for model in tried {
        assert!(cost <= model.cost.unwrap() * (1.0 + 1e-5), "{tried:#?}");
    }
    assert!(cost < 2.0, "{cost}");
    let mut wholes = tried.iter().filter(|model| model.effects.len() == 2);
    assert!(
        wholes.next().is_some() && wholes.next().is_none(),
        "it is listed once"
    );
}
