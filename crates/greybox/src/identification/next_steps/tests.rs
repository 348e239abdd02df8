//! Every patch makes a document that can be submitted, and changes what its label says.

use super::*;
use crate::estimation::observer::Counters;
use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use crate::estimation::stop_reason::StopReason;
use crate::identification::Identification;
use crate::identification::outcome::{Outcome, Reason};
use crate::uncertainty::budget::Line;
use crate::uncertainty::residuals::ResidualReport;
use crate::uncertainty::unanalysed;
use crate::uncertainty::verdict::Trust;
use greybox_recording::Recording;
use serde_json::json;
use std::collections::BTreeMap;

/// A carriage on a damper; the spring and the dry friction are effects that a job may leave out.
fn model() -> Value {
    let effect = |symbol: &str, unit: &str, upper: f64| {
        json!({"symbol": symbol, "unit": unit, "default": 0, "lower": 0, "upper": upper,
               "minimum": 0, "tolerance": 0.1 * upper})
    };
    let unknown = |symbol: &str, unit: &str, default: f64| {
        json!({"symbol": symbol, "unit": unit, "default": default, "lower": 0.1 * default,
               "upper": 10.0 * default, "scale": "log", "minimum": 0, "unknown": true})
    };
    json!({
        "name": "carriage",
        "inputs": {"force": {"symbol": "f", "unit": "N"}},
        "parameters": {
            "mass": unknown("m", "kg", 2.0),
            "damping": unknown("d", "N*s/m", 3.0),
            "stiffness": effect("k", "N/m", 100.0),
            "dry_friction": effect("Fc", "N", 10.0),
            "gain": {"symbol": "g", "unit": "1", "default": 1, "lower": 0.5, "upper": 2, "minimum": 0},
        },
        "states": {
            "position": {"symbol": "x", "unit": "m", "derivative": "v", "initial": 0},
            "velocity": {"symbol": "v", "unit": "m/s", "initial": 0,
                         "derivative": "(g*f - d*v - k*x - Fc*soft_sign(v, 0.01))/m"},
        },
        "outputs": {"position": {"unit": "m", "expression": "x"}},
    })
}

/// 2 kg and 3 N·s/m, pushed to and fro for 4 s, with an error of a tenth of a millimetre that has
/// no pattern.
fn recording(stiffness: f64) -> Recording {
    let (mut position, mut velocity) = (0.0, 0.0);
    let forces = (0..200).map(|k| if (k / 17) % 2 == 0 { 20.0 } else { -20.0 });
    let forces: Vec<f64> = forces.collect();
    let positions = forces.iter().enumerate().map(|(k, force)| {
        let now = position + 1e-4 * ((k * k * 7919 % 101) as f64 / 50.0 - 1.0);
        for _ in 0..100 {
            velocity += 2e-4 * (force - 3.0 * velocity - stiffness * position) / 2.0;
            position += 2e-4 * velocity;
        }
        now
    });
    let positions = positions.collect();
    Recording::from_samples(0.02, [("force", "N", forces), ("position", "m", positions)])
}

fn identification(mut job: Value, recording: Recording) -> Identification {
    job["model"] = model();
    Identification::of_job(job, recording)
}

/// A job of which as much as possible is said.
fn talkative() -> Value {
    json!({
        "experiments": [
            {
                "window": {"from_s": 0.5, "to_s": 3.5},
                "initial_state": {
                    "velocity": {"value": 0.0, "tolerance": 0.01},
                    "position": {"estimate": {"lower": -1.0, "upper": 1.0},
                                 "prior": {"mean": 0.0, "std": 0.1}}
                },
            },
            {"parameters": {"damping": {"estimate": {"lower": 1.0, "upper": 9.0}}}},
            {"role": "validation", "parameters": {"damping": {"value": 3.0, "tolerance": "1 %"}}},
        ],
        "parameters": {
            "mass": {"estimate": {"lower": 1.0, "upper": 4.0}},
            "gain": {"value": 1.0, "tolerance": "2 %"},
        },
        "outputs": {"position": {"gain_tolerance": "1 %", "offset_tolerance": 1e-3,
                                 "lag_tolerance_s": 1e-3}},
        "clock_tolerance": "0.01 %",
        "constraints": ["mass < 3.5", "gain*mass < 3.4"],
        "priors": [{"parameters": ["mass", "damping"], "mean": [2.0, 3.0],
                    "covariance": [[0.1, 0.0], [0.0, 0.1]]}],
        "limits": {"max_duration_s": 60},
        "seed": 1,
    })
}

/// A report with every unknown at one position, and another minimum at another.
fn report(problem: &Problem, position: f64, stop_reason: StopReason) -> Report {
    let positions = vec![position; problem.coordinates.len()];
    let other = vec![1.0 - 0.5 * position; problem.coordinates.len()];
    Report {
        stop_reason,
        values: problem.values(&positions),
        positions,
        cost: Some(1.0),
        generations: 1,
        counters: Counters::default(),
        best_credit: None,
        best_generation: None,
        declared_positions: None,
        searches: Vec::new(),
        starts: Vec::new(),
        floor: None,
        twins: vec![problem.named_values(&other)],
    }
}

/// A conclusion in which every assumption is contradicted.
fn conclusion(problem: &Problem, position: f64, stop_reason: StopReason) -> Conclusion {
    let mut conclusion = unanalysed(problem, &report(problem, position, stop_reason));
    let lines = problem.assumptions.iter().map(|assumption| Line {
        assumption: assumption.clone(),
        score: Some(9.0),
        suggested: Some((
            assumption.value + 7.0 * assumption.tolerance,
            assumption.tolerance,
        )),
        posterior: None,
        is_pulled: true,
        unnoticed: None,
        contributions: vec![None; problem.coordinates.len()],
    });
    conclusion.analysis.budget.lines = lines.collect();
    let residuals = problem.outputs.iter().map(|_| ResidualReport {
        noise_std: 1.234_567e-4,
        noise_std_source: "estimated".to_owned(),
        chi_square_per_sample: None,
        lag_1_autocorrelation: None,
        white: None,
        ljung_box_p: None,
        is_noise_overstated: false,
        inputs: BTreeMap::new(),
        effective_samples: None,
        outliers: None,
        inlier_share: 1.0,
    });
    conclusion.analysis.residuals = residuals.collect();
    conclusion
}

/// Every subject that a doubt about the problem can have.
fn subjects(problem: &Problem) -> Vec<Subject> {
    let mut subjects = vec![Subject::Job, Subject::Twin(0)];
    let coordinates = 0..problem.coordinates.len();
    subjects.extend(coordinates.map(|index| Subject::Coordinates(vec![index])));
    let lines = 0..problem.assumptions.len();
    subjects.extend(lines.map(|line| Subject::Assumptions(vec![line])));
    subjects.extend((0..problem.outputs.len()).map(Subject::Output));
    subjects.extend((0..problem.constraints.len()).map(Subject::Constraint));
    subjects
}

#[test]
fn every_patch_for_every_rule_makes_a_specification_that_can_be_read() {
    let (assembly, spec) = identification(talkative(), recording(0.0))
        .assembly()
        .expect("a sound job");
    let problem = assembly.problem;
    assert_eq!(problem.coordinates.len(), 4, "mass, damping twice, a start");
    let mut labels = Vec::new();
    for (position, stop_reason) in [
        (0.0, StopReason::TimeLimit),
        (0.5, StopReason::Stagnation),
        (1.0, StopReason::Cancelled),
    ] {
        let conclusion = conclusion(&problem, position, stop_reason);
        let finished = Finished {
            spec: &spec,
            conclusion: &conclusion,
            tries: &Tries::new(),
        };
        for (rule, subject) in Rule::ALL
            .iter()
            .flat_map(|rule| subjects(&problem).into_iter().map(move |all| (*rule, all)))
        {
            let doubt = Doubt {
                rule,
                detail: String::new(),
                trust: Trust::Low,
                concerns: None,
                at_stake: 0.0,
                subject,
            };
            for step in finished.next_steps(&doubt) {
                let document = patch::applied(&json!(spec), &step.patch);
                let read = identification(document, recording(0.0)).specification();
                let read = read.map(|(spec, _)| spec);
                assert!(read.is_ok(), "{rule}, {}: {read:?}", step.label);
                assert_ne!(read.ok(), Some(spec.clone()), "{rule}, {}", step.label);
                labels.push(step.label);
            }
        }
    }
    labels.sort();
    labels.dedup();
    println!("{labels:#?}");
    for expected in [
        "Fix mass",
        "Fix damping in experiment 2",
        "Forget the prior of mass",
        "Forget the prior of position at the start of experiment 1",
        "Free gain",
        "Free velocity at the start of experiment 1",
        "Give the noise of position",
        "Keep the other minimum of damping in experiment 2",
        "Know the clock better",
        "Know the sensor's lag of position better",
        "Leave out mass < 3.5",
        "Let the data choose the effects",
        "Run it longer",
        "Search longer",
        "Use the first half of the record",
        "Use the whole recordings",
        "Widen the range of damping in experiment 2",
    ] {
        assert!(
            labels.iter().any(|label| label == expected),
            "{expected}: {labels:#?}"
        );
    }
}

fn run(job: Value, stiffness: f64) -> Outcome {
    let outcome = identification(job, recording(stiffness)).run();
    outcome.unwrap_or_else(|error| panic!("{error}"))
}

/// The reason of a rule, and the job once more with its first step.
fn followed(job: &Value, outcome: &Outcome, code: Rule, stiffness: f64) -> (NextStep, Outcome) {
    let mut reasons = outcome.verdict.reasons.iter();
    let reason: &Reason = reasons
        .find(|reason| reason.code == code)
        .unwrap_or_else(|| panic!("{:#?}", outcome.verdict));
    let step = reason.next.first().expect("a next step").clone();
    let (spec, _) = identification(job.clone(), recording(stiffness))
        .specification()
        .expect("a sound job");
    let outcome = run(patch::applied(&json!(spec), &step.patch), stiffness);
    (step, outcome)
}

/// Whether a step was tried, with the estimates and the trust that the job with the step comes to.
fn was_told_what_it_comes_to(step: &NextStep, outcome: &Outcome) {
    let tried = step.tried.as_ref().expect("it was tried");
    assert!(step.why.contains("Tried: "), "{}", step.why);
    assert_eq!(tried.trust, outcome.verdict.trust);
    for parameter in &outcome.parameters {
        let (expected, tried) = (&parameter.estimate, &tried.parameters[&parameter.name]);
        let error = expected.total_standard_error.expect("an error");
        let off = (tried.estimate - expected.estimate) / error;
        // A search may end in another of the minima that a friction near 0 has.
        assert!(off.abs() < 0.2, "{}: {off}", parameter.name);
        assert_eq!(Some(tried.trust), expected.trust);
    }
}

fn is_told(outcome: &Outcome, code: Rule) -> bool {
    let mut reasons = outcome.verdict.reasons.iter();
    reasons.any(|reason| reason.code == code)
}

#[test]
fn a_range_that_cuts_the_estimate_off_is_widened_until_it_does_not() {
    let job = json!({
        "parameters": {"mass": {"estimate": {"lower": 0.5, "upper": 1.5}}},
        "outputs": {"position": {"noise_std": 1e-4}},
        "seed": 1,
    });
    let (step, outcome) = followed(&job, &run(job.clone(), 0.0), Rule::AtBound, 0.0);
    assert_eq!(step.label, "Widen the range of mass");
    assert_eq!(
        step.patch,
        json!({"parameters": {"mass": {"estimate": {"upper": 15.0}}}})
    );
    assert!(!is_told(&outcome, Rule::AtBound), "{:#?}", outcome.verdict);
    was_told_what_it_comes_to(&step, &outcome);
    let mass = outcome
        .parameter("mass")
        .expect("it is free")
        .estimate
        .estimate;
    assert!((mass - 2.0).abs() < 0.05, "{mass}");
}

#[test]
fn an_effect_that_the_data_ask_for_is_found_by_the_next_step_of_a_misfit() {
    // The spring is far stronger than it may be, so that the fit does not take it in by itself.
    let job = json!({
        "parameters": {"stiffness": {"value": 0, "tolerance": 0.01}},
        "outputs": {"position": {"noise_std": 1e-4}},
        "seed": 1,
    });
    let before = run(job.clone(), 5.0);
    let (step, outcome) = followed(&job, &before, Rule::Misfit, 5.0);
    assert_eq!(step.label, "Let the data choose the effects");
    // The search begins at what was reached without the effects.
    for parameter in &before.parameters {
        let range = &step.patch["parameters"][&parameter.name]["estimate"];
        let start = range["start"].as_f64().expect("a start");
        let estimate = parameter.estimate.estimate;
        assert!((start / estimate - 1.0).abs() < 1e-5, "{}", parameter.name);
    }
    let search = outcome.model_search.as_ref().expect("a search");
    assert!(
        search.supported.contains(&"stiffness".to_owned()),
        "{search:?}"
    );
    assert!(!is_told(&outcome, Rule::Misfit), "{:#?}", outcome.verdict);
    was_told_what_it_comes_to(&step, &outcome);
    let change = step.tried.and_then(|tried| tried.bic_change);
    assert!(change.is_some_and(|change| change < -100.0), "{change:?}");
    let silent = json!({"uncertainty": {"tried_steps": 0}});
    let silent = run(patch::applied(&job, &silent), 5.0);
    let mut steps = silent
        .verdict
        .reasons
        .iter()
        .flat_map(|reason| &reason.next);
    assert!(steps.all(|step| step.tried.is_none() && !step.why.contains("Tried")));
}

/// Without a search the middle of the range is refined, from where the frequency of the spring is far off; a descent
/// from a start that is a sixth off comes to the floor.
#[test]
fn a_descent_begins_where_the_job_says() {
    let cost = |start: Option<f64>| {
        let mut stiffness = json!({"estimate": {"lower": 1.0, "upper": 1e5}});
        if let Some(start) = start {
            stiffness["estimate"]["start"] = json!(start);
        }
        let job = json!({
            "parameters": {"mass": {"value": 2.0}, "damping": {"value": 3.0},
                           "stiffness": stiffness},
            "outputs": {"position": {"noise_std": 1e-4}},
            "method": {"generations": 0, "further_searches": 0},
            "validation": {"fraction": 0},
            "process_noise": "none",
            "tolerances": {"*": 0},
            "seed": 1,
        });
        let outcome = run(job, 60.0);
        outcome.criteria.cost.expect("a cost")
    };
    let (without, with) = (cost(None), cost(Some(70.0)));
    assert!(with < 4.0 && with < 0.01 * without, "{with} {without}");
}

#[test]
fn a_noise_level_that_is_not_declared_is_proposed_as_large_as_the_residuals() {
    let outcome = run(json!({"validation": {"fraction": 0}, "seed": 1}), 60.0);
    let step = outcome
        .verdict
        .reasons
        .iter()
        .flat_map(|reason| &reason.next);
    let mut step = step.filter(|step| step.label == "Give the noise of position");
    let step = step
        .next()
        .unwrap_or_else(|| panic!("{:#?}", outcome.verdict));
    let noise = step.patch["outputs"]["position"]["noise_std"]
        .as_f64()
        .expect("a number");
    let left = outcome.residuals["position"].noise_std;
    assert!((noise / left - 1.0).abs() < 1e-3, "{noise}, {left}");
}

#[test]
fn one_of_two_parameters_that_only_act_together_is_fixed() {
    let job = json!({
        "parameters": {"gain": {"estimate": {"lower": 0.5, "upper": 2.0}}},
        "outputs": {"position": {"noise_std": 1e-4}},
        "seed": 1,
    });
    let outcome = run(job.clone(), 0.0);
    let (step, better) = followed(&job, &outcome, Rule::NotIdentifiable, 0.0);
    assert!(step.label.starts_with("Fix "), "{step:?}");
    assert!(
        !is_told(&better, Rule::NotIdentifiable),
        "{:#?}",
        better.verdict
    );
    assert_eq!(better.parameters.len(), outcome.parameters.len() - 1);
}

#[test]
fn reasons_of_earlier_versions_have_no_next_steps() {
    let stored = json!({"code": "misfit", "detail": "the model misses an effect"});
    let reason: Reason = serde_json::from_value(stored).expect("a stored reason");
    assert_eq!((reason.code, reason.next), (Rule::Misfit, Vec::new()));
}
