//! Whole jobs over records of a disturbed rig: what they say of the noise, the parameters and the trust.

use super::coverage::{Disturbed, RIG, RIGHT_SHARE, TRUTH, assert_covers, record_with, records};
use greybox::uncertainty::verdict::Trust;
use greybox::{Identification, Outcome, Recording};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeMap;

const NAMES: [&str; 3] = ["mass", "damping", "stiffness"];
/// The dry friction that the model leaves out [N].
const FRICTION: f64 = 1.5;

/// A job over a recording of the rig that lets the data choose the noise.
fn job(recording: Recording) -> Outcome {
    let model: Value = serde_json::from_str(RIG).unwrap();
    let job = json!({
        "model": model,
        "process_noise": "auto",
        "validation": {"fraction": 0},
        "seed": 1,
    });
    let found = Identification::of_job(job, recording).run();
    found.unwrap_or_else(|error| panic!("{error}"))
}

/// What the jobs over many records come to.
#[derive(Debug, Default)]
struct Study {
    /// How often each noise model was chosen; the free run is `none`.
    chosen: BTreeMap<String, usize>,
    /// How often the total interval of each parameter covers the truth.
    covered: [usize; 3],
    /// How often each parameter is graded high.
    high: [usize; 3],
    /// How often each parameter is graded moderate.
    moderate: [usize; 3],
    /// How often each reason is given.
    reasons: BTreeMap<String, usize>,
}

fn study(disturbed: Disturbed, friction: f64) -> Study {
    let outcomes: Vec<Outcome> = (0..records())
        .into_par_iter()
        .map(|seed| job(record_with(disturbed, friction, seed)))
        .collect();
    let mut study = Study::default();
    for outcome in &outcomes {
        let noise = outcome.process_noise.as_ref();
        let chosen = noise.map_or("none", |noise| &noise.chosen);
        *study.chosen.entry(chosen.to_owned()).or_default() += 1;
        for reason in &outcome.verdict.reasons {
            *study.reasons.entry(reason.code.to_string()).or_default() += 1;
        }
        for (place, name) in NAMES.iter().enumerate() {
            let found = &outcome.parameter(name).unwrap().estimate;
            let interval = found.total_interval.unwrap();
            let ends = interval.lower.unwrap()..interval.upper.unwrap();
            study.covered[place] += usize::from(ends.contains(&TRUTH[place]));
            study.high[place] += usize::from(found.trust == Some(Trust::High));
            study.moderate[place] += usize::from(found.trust == Some(Trust::Moderate));
        }
    }
    println!(
        "{disturbed:?}, friction {friction}, of {}: {study:?}",
        records()
    );
    study
}

/// The noise is chosen, the intervals hold and the trust is high in nine of ten records; of fewer than 100 one
/// more may miss.
fn assert_right(study: &Study, noise: &str) {
    let least = (0.9 * records() as f64) as usize - usize::from(records() < 100);
    assert!(study.chosen.get(noise).is_some_and(|count| *count >= least));
    assert_covers(study.covered, RIGHT_SHARE);
    assert!(
        study.high.iter().all(|count| *count >= least),
        "{:?}",
        study.high
    );
}

#[test]
fn a_load_with_memory_is_found_and_the_numbers_can_be_used() {
    let study = study(Disturbed::Memory, 0.0);
    assert_right(&study, "memory on the rate of `v`");
    assert_eq!(study.reasons["disturbance"] as u64, records());
}

#[test]
fn a_white_load_is_found_and_the_numbers_can_be_used() {
    assert_right(&study(Disturbed::White, 0.0), "white on the rate of `v`");
}

#[test]
fn a_drifting_sensor_is_found_and_the_numbers_can_be_used() {
    let study = study(Disturbed::Sensor, 0.0);
    assert_right(&study, "memory on the sensor of `position`");
}

/// Where the residuals are white the job is the one without noise, to the bit.
#[test]
fn where_nothing_acts_the_result_is_that_of_the_free_run() {
    let study = study(Disturbed::Nothing, 0.0);
    assert_eq!(study.chosen["none"] as u64, records());
    assert!(!study.reasons.contains_key("disturbance"));
}

/// A filter takes a friction that the model lacks for a disturbance, and the damping pays for it: the pull of the
/// innovations at a loss that the equations have no term for tells it.
#[test]
fn a_friction_that_the_model_lacks_is_told_whatever_else_acts() {
    for disturbed in [Disturbed::Nothing, Disturbed::Memory] {
        let study = study(disturbed, FRICTION);
        let damping = 1;
        assert_eq!(
            study.high[damping], 0,
            "no high trust in a damping that is 40 % off"
        );
        assert_eq!(study.moderate[damping], 0, "nor a moderate one");
        assert_eq!(study.reasons["assumption_contradicted"] as u64, records());
    }
}
