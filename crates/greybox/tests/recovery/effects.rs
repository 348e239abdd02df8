//! Which effects the data support, found by leaving them out.

use super::run::run;
use super::{Tolerance, assert_recovers};
use greybox::demo::{self, Demo};
use greybox::identification::Outcome;
use serde_json::json;
use std::collections::BTreeSet;

/// What rig D has and the data sheet does not, and one that it does not have.
const EFFECTS: [&str; 6] = [
    "coulomb_friction",
    "dead_band",
    "valve_offset",
    "flow_gain",
    "spool_natural_frequency",
    "internal_leakage",
];

fn searched(demo: Demo, effects: &[&str], to: f64) -> Outcome {
    let mut job = demo::job(demo);
    job["method"] = json!({"generations": 40, "refine_candidates": 2});
    job["model_search"] = json!({ "effects": effects });
    job["experiments"][0]["window"] = json!({ "to_s": to });
    run(job, demo::recording(demo, 1))
}

fn supported(outcome: &Outcome) -> BTreeSet<&str> {
    let search = outcome.model_search.as_ref().expect("a model search");
    for tried in &search.tried {
        println!(
            "{:?}: bic {:?}, cost {:?}",
            tried.effects, tried.bic, tried.cost
        );
    }
    search.supported.iter().map(String::as_str).collect()
}

#[test]
fn the_effects_of_an_imperfect_plant_are_found_and_one_that_it_does_not_have_is_left_out() {
    let outcome = searched(Demo::D, &EFFECTS, 120.0);
    assert_eq!(supported(&outcome), EFFECTS[..5].iter().copied().collect());
    let tolerance = Tolerance {
        sharp: 1.5,
        damping: 10.0,
    };
    assert_recovers(Demo::D, &outcome, &tolerance);
    let truths = demo::true_parameters(Demo::D);
    for parameter in &outcome.parameters {
        let truth = truths.iter().find(|(name, _)| *name == parameter.name);
        let truth = truth.expect("a true value").1;
        let interval = parameter.estimate.confidence_interval.as_ref();
        let interval = interval.expect("an interval");
        let covers = interval.lower <= Some(truth) && interval.upper >= Some(truth);
        assert!(covers, "{}: {interval:?} without {truth}", parameter.name);
    }
}

#[test]
fn a_plant_without_any_of_the_effects_keeps_none() {
    let outcome = searched(Demo::A, &EFFECTS[..3], 40.0);
    assert_eq!(supported(&outcome), BTreeSet::new());
    let estimated: Vec<&str> = outcome.parameters.iter().map(|p| &*p.name).collect();
    assert_eq!(estimated, ["mass", "damping", "stiffness", "bulk_modulus"]);
    let tolerance = Tolerance {
        sharp: 1.0,
        damping: 5.0,
    };
    assert_recovers(Demo::A, &outcome, &tolerance);
}
