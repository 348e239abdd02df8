//! Whether the method finds what is there: estimates from noisy recordings, started from a wide
//! box, against the values that made the recordings; and whether it says so where it cannot.
//!
//! The tolerances are those that the project promises. On A (120 s, quantisation noise only) they
//! are more than eight times the Cramér–Rao bounds (mass 0.12, damping 0.23, stiffness 0.02, bulk
//! modulus 0.13 %); on D about three times the standard errors that come with the estimate.

mod budget;
mod constraints;
mod dead_time;
mod drift;
mod effects;
mod grades;
mod intervals;
mod joint;
mod nuisances;
mod outliers;
mod rivals;
mod run;
mod sampling;

use greybox::demo::{self, Demo};
use greybox::identification::Outcome;
use greybox::identification::outcome::{Rule, Trust};
use greybox::recording::{Recording, Signal, TimeAxis};
use run::run;
use serde_json::json;
use std::fs::File;
use std::path::PathBuf;

/// Errors in per cent of the truth that are allowed for M, Ks, Km on the one hand and B on the other.
struct Tolerance {
    sharp: f64,
    damping: f64,
}

fn assert_recovers(demo: Demo, outcome: &Outcome, tolerance: &Tolerance) {
    let mut faults = Vec::new();
    for name in ["mass", "damping", "stiffness", "bulk_modulus"] {
        let found = outcome.parameters.iter().find(|found| found.name == name);
        let estimate = found
            .expect("an estimate of each unknown")
            .estimate
            .estimate;
        let truth = demo::true_parameters(demo)
            .into_iter()
            .find(|(own, _)| own == name);
        let truth = truth.expect("a true value of each parameter").1;
        let error = 100.0 * (estimate / truth - 1.0);
        println!("{name}: {estimate:.5e}, {error:+.3} % from {truth:.5e}");
        let allowed = if name == "damping" {
            tolerance.damping
        } else {
            tolerance.sharp
        };
        if error.abs() > allowed {
            faults.push(format!("{name} is {error:+.3} % from the truth"));
        }
    }
    assert!(faults.is_empty(), "{faults:?}, {:?}", outcome.verdict);
}

/// Beyond four standard errors lies one estimate in 16 000.
fn assert_errors_agree_with_their_deviations(demo: Demo, outcome: &Outcome) {
    let truths = demo::true_parameters(demo);
    for parameter in &outcome.parameters {
        let truth = truths.iter().find(|(name, _)| *name == parameter.name);
        let error = parameter.estimate.estimate - truth.expect("a true value").1;
        let deviation = parameter.estimate.standard_error.expect("a standard error");
        let (name, ratio) = (&parameter.name, error.abs() / deviation);
        assert!(
            ratio < 4.0,
            "{name} is {ratio} standard errors from the truth"
        );
    }
}

#[test]
fn the_four_unknowns_of_a_textbook_recording_are_recovered_and_trusted() {
    for seed in [1, 2] {
        let mut job = demo::job(Demo::A);
        job["seed"] = json!(seed);
        let outcome = run(job, demo::recording(Demo::A, seed));
        assert_recovers(
            Demo::A,
            &outcome,
            &Tolerance {
                sharp: 1.0,
                damping: 5.0,
            },
        );
        // The droop of the supply, which nobody measured, leaves the damping a standard error of 15 %.
        for parameter in &outcome.parameters {
            let expected = match &*parameter.name {
                "damping" => Trust::Moderate,
                _ => Trust::High,
            };
            let trust = parameter.estimate.trust;
            assert_eq!(trust, Some(expected), "{}", parameter.name);
        }
        let reasons = outcome.verdict.reasons.iter();
        let codes: Vec<Rule> = reasons.map(|reason| reason.code).collect();
        assert_eq!(codes, [Rule::AssumptionsDominate]);
        assert_errors_agree_with_their_deviations(Demo::A, &outcome);
    }
}

/// What remains is the method's own error: no noise, no converter, the model that made the data.
#[test]
fn without_noise_the_unknowns_are_found_to_a_millionth() {
    let reference = demo::excitation::textbook(1, 2000);
    let truth = demo::rig::parameters(Demo::A);
    let position = demo::rig::simulate(&truth, &reference).position;
    let time = TimeAxis::Uniform {
        sample_time: 0.01,
        samples: 2000,
    };
    let signals = vec![
        Signal::new("reference", "m", reference),
        Signal::new("position", "m", position),
    ];
    let mut job = demo::job(Demo::A);
    job["outputs"] = json!({});
    let outcome = run(job, Recording::new(time, signals));
    let tolerance = Tolerance {
        sharp: 1e-4,
        damping: 1e-4,
    };
    assert_recovers(Demo::A, &outcome, &tolerance);
}

#[test]
fn a_plant_with_effects_that_the_job_leaves_out_is_not_trusted() {
    let mut job = demo::job(Demo::B);
    // What would help is not asked here, and dear to try.
    job["uncertainty"] = json!({"tried_steps": 0});
    let outcome = run(job, demo::recording(Demo::B, 1));
    println!("{:?}", outcome.verdict);
    // The fit per cent sees nothing of it.
    let fit = outcome.fit.estimation["position"].fit_percent;
    assert!(fit > Some(97.5), "{fit:?}");
    assert_eq!(outcome.verdict.trust, Trust::Low);
    let reasons = outcome.verdict.reasons.iter();
    let codes: Vec<Rule> = reasons.map(|reason| reason.code).collect();
    // The fit takes in the effects that were left out; they are far larger than their tolerances.
    assert!(codes.contains(&Rule::AssumptionContradicted), "{codes:?}");
    assert!(codes.contains(&Rule::ResidualsNotWhite), "{codes:?}");
}

#[test]
fn the_unknowns_are_recovered_from_an_imperfect_plant_when_its_effects_are_free_too() {
    let mut job = demo::job(Demo::D);
    // Nine unknowns and dry friction are dear; the refinement does the rest of a shorter search.
    job["method"] = json!({"generations": 40, "refine_candidates": 2});
    let outcome = run(job, demo::recording(Demo::D, 1));
    println!("{:?}", outcome.verdict);
    assert_recovers(
        Demo::D,
        &outcome,
        &Tolerance {
            sharp: 1.5,
            damping: 10.0,
        },
    );
}

/// A servo axis without spring (A. Janot, M. Gautier, M. Brunot, EMPS benchmark, 2019), in the
/// folder that `GREYBOX_SHARED_DATA` names or in `../shared/data`; it is not part of the repository.
#[test]
fn a_real_positioning_drive_is_followed_within_two_and_a_half_millimetres() {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let folder = std::env::var_os("GREYBOX_SHARED_DATA").map_or_else(beside, PathBuf::from);
    let path = folder.join("emps.csv");
    let Ok(text) = File::open(&path) else {
        eprintln!("skipped: {} is not there", path.display());
        return;
    };
    let recording = Recording::from_csv(text).expect("a sound recording");
    let job = json!({
        "model": "positioning_drive",
        "experiments": [{}],
        "parameters": {
            "mass": {"estimate": {"lower": 10, "upper": 1000}},
            "viscous_friction": {"estimate": {"lower": 1, "upper": 2000}},
            "coulomb_friction": {"estimate": {"lower": 1, "upper": 500}},
            "offset": {"estimate": {"lower": -100, "upper": 100}},
        },
        "validation": {"fraction": 0},
        "seed": 1,
    });
    let outcome = run(job, recording);
    let rmse = outcome.fit.estimation["position"].rmse.expect("a fit");
    println!("rmse {rmse:.5e} m, {:?}", outcome.verdict);
    for parameter in &outcome.parameters {
        println!("{} {:.5e}", parameter.name, parameter.estimate.estimate);
    }
    assert_eq!(outcome.fit.estimation["position"].samples, 24_841);
    // Published reference parameters give 5.06 mm, careful local fits 2.42 to 2.44 mm.
    assert!(rmse <= 2.44e-3, "{rmse} m");
    // The published mass, which other data gave, lies within the interval because that was
    // widened for residuals that are far from white.
    let mass = &outcome.parameters[0].estimate;
    let interval = mass.confidence_interval.as_ref().expect("an interval");
    println!("{interval:?}");
    assert_eq!(interval.method, "fisher_coloured");
    assert!(
        interval.lower < Some(95.1) && interval.upper > Some(95.1),
        "{interval:?}"
    );
    assert_ne!(outcome.verdict.trust, Trust::High);
    let details = outcome.verdict.reasons.iter().map(|reason| &reason.detail);
    let mut frictions = details.filter(|d| d.contains("viscous") && d.contains("coulomb"));
    assert!(frictions.next().is_some(), "{:?}", outcome.verdict);
}
