//! Whole jobs over records of a disturbed rig: what they say of the noise, the parameters and the trust.

use super::coverage::{Disturbed, RIG, RIGHT_SHARE, TRUTH, assert_covers, record_with, records};
use greybox::estimation::Advance;
use greybox::uncertainty::verdict::Trust;
use greybox::{Identification, Outcome, Recording, Run};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

const NAMES: [&str; 3] = ["mass", "damping", "stiffness"];
/// The dry friction that the model leaves out [N].
const FRICTION: f64 = 1.5;

/// A job over a recording of the rig that lets the data choose the noise.
fn identification(recording: Recording) -> Identification {
    let model: Value = serde_json::from_str(RIG).unwrap();
    let job = json!({
        "model": model,
        "process_noise": "auto",
        "validation": {"fraction": 0},
        "seed": 1,
    });
    Identification::of_job(job, recording)
}

fn job(recording: Recording) -> Outcome {
    let outcome = identification(recording).run();
    outcome.unwrap_or_else(|error| panic!("{error}"))
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
    /// The farthest that the residuals of a record pull at an assumption, standard deviations of noise.
    farthest_pull: f64,
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
        let pulls = outcome.budget.iter().filter_map(|line| line.score);
        study.farthest_pull = pulls.map(f64::abs).fold(study.farthest_pull, f64::max);
        for (place, name) in NAMES.iter().enumerate() {
            let estimate = &outcome.parameter(name).unwrap().estimate;
            let interval = estimate.total_interval.unwrap();
            let ends = interval.lower.unwrap()..interval.upper.unwrap();
            study.covered[place] += usize::from(ends.contains(&TRUTH[place]));
            study.high[place] += usize::from(estimate.trust == Some(Trust::High));
            study.moderate[place] += usize::from(estimate.trust == Some(Trust::Moderate));
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
    // Of 700 standard normal numbers one is beyond 5 in 2500 studies.
    assert!(study.farthest_pull < 5.0, "{}", study.farthest_pull);
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

/// Every unit of work is written down and taken up again, those of the noise models among them.
#[test]
fn saving_a_run_after_any_unit_changes_no_bit() {
    let record = || record_with(Disturbed::Memory, 0.0, 1);
    let never = AtomicBool::new(false);
    let (assembly, spec) = identification(record()).assembly().unwrap();
    let model = assembly.problem.model;
    let recordings = [record()];
    let mut run = identification(record()).begin().unwrap();
    while run.advance(&never, &mut ()) == Advance::Working {
        let text = serde_json::to_string(&run.checkpoint()).unwrap();
        let checkpoint = serde_json::from_str(&text).unwrap();
        run = Run::resume(&spec, &model, &recordings, checkpoint).unwrap();
    }
    let saved = run.outcome(None, &never).unwrap().unwrap();
    let unbroken = job(record());
    assert_eq!(saved.parameters, unbroken.parameters);
    assert_eq!(saved.process_noise, unbroken.process_noise);
    assert!(saved.process_noise.is_some());
}

/// The numbers of listed disturbances are given, looked for within a range, or left open.
#[test]
fn listed_disturbances_are_estimated_or_taken_as_they_are() {
    let model: Value = serde_json::from_str(RIG).unwrap();
    let listed = |noise: Value| {
        let job = json!({
            "model": model, "process_noise": [noise], "validation": {"fraction": 0.25}, "seed": 1
        });
        let recording = record_with(Disturbed::Memory, 0.0, 2);
        let outcome = Identification::of_job(job, recording).run();
        outcome.unwrap_or_else(|error| panic!("{error}"))
    };
    let acts_on = json!({"state": "v"});
    let open = listed(json!({
        "acts_on": acts_on, "kind": "memory",
        "std": {"estimate": {}}, "time_constant_s": {"estimate": {"lower": 0.05, "upper": 5}}
    }));
    let noise = open.process_noise.as_ref().unwrap();
    let disturbance = &noise.disturbances[0];
    // 2 N on 10 kg that remember 0.5 s.
    let std = disturbance.std.as_ref().unwrap();
    assert!((std.estimate / 0.2 - 1.0).abs() < 0.3, "{std:?}");
    let memory = disturbance.time_constant_s.as_ref().unwrap();
    let interval = memory.confidence_interval.as_ref().unwrap();
    assert!(interval.lower.unwrap() < 0.5 && 0.5 < interval.upper.unwrap());
    let band = &noise.held_back["position"];
    assert!(band.samples == 250 && band.inside > 0.7, "{band:?}");
    let given = listed(json!({
        "acts_on": acts_on, "kind": "memory", "std": 0.2, "time_constant_s": 0.5
    }));
    let disturbance = &given.process_noise.as_ref().unwrap().disturbances[0];
    assert_eq!(disturbance.std.as_ref().unwrap().standard_error, None);
    let [open, given] = [open, given].map(|outcome| outcome.parameter("mass").unwrap().clone());
    let [open, given] = [open.estimate, given.estimate];
    let error = open.standard_error.unwrap();
    assert!((open.estimate - given.estimate).abs() < error);
}

#[test]
fn draws_from_the_posterior_are_those_of_the_likelihood_of_the_filter() {
    let recording = record_with(Disturbed::Memory, 0.0, 3);
    let mut job = json!({
        "model": serde_json::from_str::<Value>(RIG).unwrap(),
        "process_noise": [{
            "acts_on": {"state": "v"}, "kind": "memory",
            "std": {"estimate": {}}, "time_constant_s": {"estimate": {}},
        }],
        "validation": {"fraction": 0},
        "seed": 1,
    });
    let by_curvature = Identification::of_job(job.clone(), recording.clone()).run();
    job["uncertainty"] = json!({"intervals": "posterior", "posterior_generations": 500});
    let drawn = Identification::of_job(job, recording).run();
    let (by_curvature, drawn) = (by_curvature.unwrap(), drawn.unwrap());
    for name in NAMES {
        let [narrow, wide] = [&by_curvature, &drawn].map(|outcome| {
            let estimate = &outcome.parameter(name).unwrap().estimate;
            estimate.confidence_interval.clone().unwrap()
        });
        assert_eq!(wide.method, "posterior");
        // A rig is nearly linear, so that both are the same but for the draws.
        let width = narrow.upper.unwrap() - narrow.lower.unwrap();
        for (drawn, end) in [(wide.lower, narrow.lower), (wide.upper, narrow.upper)] {
            let off = (drawn.unwrap() - end.unwrap()) / width;
            assert!(off.abs() < 0.1, "{name}: {off}");
        }
    }
    let names = drawn.posterior.unwrap().names;
    assert_eq!(names, NAMES, "the noise is summed out");
}
