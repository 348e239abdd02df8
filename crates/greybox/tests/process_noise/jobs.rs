//! Whole jobs over records of a disturbed rig: what they say of the noise, the parameters and the trust.

use super::coverage::{Disturbed, TRUTH, model, record, records};
use greybox::uncertainty::verdict::Trust;
use greybox::{Identification, Outcome, Recording};
use rayon::prelude::*;
use serde_json::{Value, json};

const NAMES: [&str; 3] = ["mass", "damping", "stiffness"];

/// A job over a recording of the rig.
fn job(noise: &Value, recording: Recording) -> Outcome {
    let document: Value = serde_json::from_str(super::coverage::RIG).unwrap();
    let job = json!({
        "model": document,
        "process_noise": noise,
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
    chosen: std::collections::BTreeMap<String, usize>,
    /// How often the total interval of each parameter covers the truth.
    covered: [usize; 3],
    /// How often each parameter is graded high.
    high: [usize; 3],
    /// How often one that is graded high is not covered by its interval.
    false_high: usize,
    reasons: std::collections::BTreeMap<String, usize>,
}

fn study(disturbed: Disturbed, asked: &Value) -> Study {
    let _ = model();
    let outcomes: Vec<Outcome> = (0..records())
        .into_par_iter()
        .map(|seed| job(asked, record(disturbed, seed)))
        .collect();
    let mut study = Study::default();
    for outcome in &outcomes {
        let noise = outcome.process_noise.as_ref();
        let chosen = noise.map_or("none", |noise| &noise.chosen);
        *study.chosen.entry(chosen.to_owned()).or_default() += 1;
        for reason in &outcome.verdict.reasons {
            let text = format!("{} {:?}", reason.code, reason.concerns);
            *study.reasons.entry(text).or_default() += 1;
        }
        for (place, name) in NAMES.iter().enumerate() {
            let found = &outcome.parameter(name).unwrap().estimate;
            let interval = found.total_interval.unwrap();
            let covers =
                interval.lower.unwrap() < TRUTH[place] && TRUTH[place] < interval.upper.unwrap();
            let is_high = found.trust == Some(Trust::High);
            study.covered[place] += usize::from(covers);
            study.high[place] += usize::from(is_high);
            study.false_high += usize::from(is_high && !covers);
        }
    }
    println!("{disturbed:?} of {}: {study:#?}", records());
    study
}

#[test]
fn a_load_with_memory_is_found_by_the_job() {
    study(Disturbed::Memory, &json!("auto"));
    study(Disturbed::White, &json!("auto"));
    study(Disturbed::Sensor, &json!("auto"));
    study(Disturbed::Nothing, &json!("auto"));
    panic!();
}
