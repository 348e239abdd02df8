//! A run of the method, from its job to its result.

use std::sync::atomic::Ordering;

use serde_json::{Value, json};

use super::*;
use crate::job::JobTask;
use crate::store::JobRow;
use crate::worker::method::Methods;
use crate::worker::run::Method;
use crate::worker::tests::at_work;
use greybox::estimation::Phase;
use greybox::identification::Outcome;
use greybox::identification::outcome::{Rule, Trust};
use greybox::identification::spec::MethodName;
use greybox::model::Catalogue;
use greybox::recording::{Signal, TimeAxis};
use greybox::uncertainty::settings::FlatDirections;

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

/// A carriage of 2 kg with 3 N·s/m of viscous friction under a square wave, integrated at a
/// tenth of the sample time.
fn recording() -> Recording {
    carriage(|k| if (k / 17) % 2 == 0 { 20.0 } else { -20.0 })
}

/// The carriage under forces \[N\], one for each sample.
fn carriage(force_of: impl Fn(usize) -> f64) -> Recording {
    let (sample_time, samples) = (0.02, 200);
    let (mut position, mut velocity) = (0.0, 0.0);
    let (mut positions, mut forces) = (Vec::new(), Vec::new());
    for k in 0..samples {
        let force = force_of(k);
        forces.push(force);
        positions.push(position);
        for _ in 0..10 {
            velocity += sample_time / 10.0 * (force - 3.0 * velocity) / 2.0;
            position += sample_time / 10.0 * velocity;
        }
    }
    let time = TimeAxis::Uniform {
        sample_time,
        samples,
    };
    let signals = vec![
        Signal::new("force", "N", forces),
        Signal::new("position", "m", positions),
    ];
    Recording::new(time, signals)
}

fn job() -> JobRow {
    job_with(|_| ())
}

fn spec_of(job: &mut JobRow) -> &mut JobSpec {
    match &mut job.task {
        JobTask::Identification(spec) => spec,
        JobTask::Design(_) | JobTask::Selection(_) => panic!("the job estimates"),
    }
}

/// The job with its document changed.
fn job_with(change: impl FnOnce(&mut Value)) -> JobRow {
    let mut document = json!({
        "model": "positioning_drive",
        "experiments": [{}],
        "parameters": {
            "mass": {"estimate": {"lower": 0.5, "upper": 10}},
            "viscous_friction": {"estimate": {"lower": 0.1, "upper": 20}},
            "coulomb_friction": {"value": 0},
            "offset": {"value": 0}
        },
        "outputs": {"position": {"noise_std": 1e-3}},
        "method": {"population": 10, "generations": 6},
        "seed": 7
    });
    change(&mut document);
    let identification = greybox::Identification::of_job(document, recording());
    let (spec, _) = identification
        .specification()
        .expect("a sound specification");
    at_work(&spec.model.clone(), JobTask::Identification(Box::new(spec)))
}

fn begin(job: &JobRow, checkpoint: Option<Vec<u8>>) -> Box<dyn Run> {
    begin_on(recording(), job, checkpoint)
}

fn begin_on(data: Recording, job: &JobRow, checkpoint: Option<Vec<u8>>) -> Box<dyn Run> {
    let assignment = Assignment {
        model: None,
        job: job.clone(),
        datasets: vec![("sha256:1".to_owned(), Arc::new(data))],
        checkpoint,
        past: None,
        stream: None,
    };
    let method = Methods::new(Catalogue::built_in());
    method.begin(assignment).expect("a run")
}

fn work(run: &mut dyn Run) -> Vec<Row> {
    let mut rows = Vec::new();
    while run.advance(&NEVER, &mut |row| rows.push(row)) == Advance::Working {}
    rows
}

fn outcome(run: &mut dyn Run, stopped: Option<StopReason>) -> Outcome {
    analysed(run, stopped, &NEVER)
}

fn analysed(run: &mut dyn Run, stopped: Option<StopReason>, hurry: &AtomicBool) -> Outcome {
    match run.outcome(stopped, hurry).expect("no failure") {
        Some(ResultOfJob::Identification(outcome)) => *outcome,
        result => panic!("no estimate: {result:?}"),
    }
}

#[test]
fn a_run_finds_the_parameters_and_tells_how_it_went() {
    let mut run = begin(&job(), None);
    let rows = work(&mut *run);
    let generations = rows.iter().filter(|row| matches!(row, Row::Generation(_)));
    assert_eq!(generations.count(), 6);
    assert_eq!(run.progress().phase, Phase::Analyse);
    let outcome = outcome(&mut *run, None);
    let mass = outcome.parameters[0].estimate.estimate;
    // The recording was integrated with an error of about 1 %.
    assert!((mass / 2.0 - 1.0).abs() < 0.03, "{mass}");
    assert_eq!(outcome.engine.dataset_digests, ["sha256:1"]);
}

#[test]
fn a_run_taken_up_after_every_unit_comes_to_the_same_result() {
    let job = job();
    let mut unbroken = begin(&job, None);
    work(&mut *unbroken);
    let expected = outcome(&mut *unbroken, None);
    let mut run = begin(&job, None);
    while run.advance(&NEVER, &mut |_| ()) == Advance::Working {
        run = begin(&job, Some(run.checkpoint()));
    }
    let broken = outcome(&mut *run, None);
    assert_eq!(broken.parameters, expected.parameters);
    assert_eq!(broken.verdict, expected.verdict);
}

#[test]
fn several_searches_and_other_methods_are_taken_up_with_the_same_bits_too() {
    for method in [
        MethodName::IcraGenetic,
        MethodName::DifferentialEvolution,
        MethodName::CmaEs,
        MethodName::MultistartLm,
    ] {
        let mut job = job();
        let settings = &mut spec_of(&mut job).method;
        settings.name = method;
        settings.restarts = 2;
        let mut unbroken = begin(&job, None);
        let rows = work(&mut *unbroken);
        let generations = rows.iter().filter(|row| matches!(row, Row::Generation(_)));
        let n_searches = if method == MethodName::MultistartLm {
            0
        } else {
            2
        };
        assert_eq!(generations.count(), 6 * n_searches);
        let expected = outcome(&mut *unbroken, None);
        let mass = expected.parameters[0].estimate.estimate;
        assert!((mass / 2.0 - 1.0).abs() < 0.03, "{method:?}: {mass}");
        assert_eq!(expected.searches.len(), n_searches);
        let mut run = begin(&job, None);
        while run.advance(&NEVER, &mut |_| ()) == Advance::Working {
            run = begin(&job, Some(run.checkpoint()));
        }
        let broken = outcome(&mut *run, None);
        assert_eq!(broken.parameters, expected.parameters);
        assert_eq!(broken.searches, expected.searches);
    }
}

/// The carriage left alone: nothing of it can be seen.
fn standing_still() -> Recording {
    let time = TimeAxis::Uniform {
        sample_time: 0.02,
        samples: 200,
    };
    let zeros = || vec![0.0; 200];
    let force = Signal::new("force", "N", zeros());
    Recording::new(time, vec![force, Signal::new("position", "m", zeros())])
}

#[test]
fn what_the_data_do_not_see_is_told_before_the_search_begins() {
    let mut run = begin_on(standing_still(), &job(), None);
    let rows = work(&mut *run);
    let reported = rows.iter().map_while(|row| match row {
        Row::Finding(finding) => Some((&*finding.code, &*finding.pointer)),
        _ => None,
    });
    let reported: Vec<(&str, &str)> = reported.collect();
    for expected in [
        ("input_constant", "/experiments/0/signals/force"),
        ("not_identifiable", "/parameters/mass"),
        ("not_identifiable", "/parameters/viscous_friction"),
    ] {
        assert!(reported.contains(&expected), "{reported:?}");
    }
    // A run that is resumed has reported it before.
    let mut resumed = begin_on(standing_still(), &job(), Some(run.checkpoint()));
    let is_finding = |row: &Row| matches!(row, Row::Finding(_));
    assert!(!work(&mut *resumed).iter().any(is_finding));
}

#[test]
fn a_job_that_asks_for_it_ends_where_the_data_do_not_fix_a_single_unknown() {
    let mut job = job();
    spec_of(&mut job).uncertainty.flat_directions = FlatDirections::Refuse;
    let mut run = begin_on(standing_still(), &job, None);
    assert_eq!(work(&mut *run), []);
    let failure = run.outcome(None, &NEVER).expect_err("a refusal");
    assert_eq!(failure.kind, "/problems/not-identifiable");
    assert_eq!(failure.errors.len(), 2);
    // With a moving carriage the same job goes on.
    let mut run = begin(&job, None);
    assert!(!work(&mut *run).is_empty());
    assert!(run.outcome(None, &NEVER).is_ok());
}

#[test]
fn unknowns_that_change_together_unseen_end_a_job_unless_it_says_otherwise() {
    // A carriage that only ever moves ahead does not tell dry friction from a constant force.
    let only_ahead = || carriage(|k| if (k / 17) % 2 == 0 { 20.0 } else { 12.0 });
    let job = |flat_directions: Option<&str>| {
        job_with(|document| {
            document["experiments"][0]["initial_state"] = json!({"position": 0, "velocity": 0.5});
            for (name, lower) in [("coulomb_friction", 0.1), ("offset", -5.0)] {
                document["parameters"][name] =
                    json!({"estimate": {"lower": lower, "upper": 5, "scale": "linear"}});
            }
            if let Some(word) = flat_directions {
                document["uncertainty"] = json!({"flat_directions": word});
            }
        })
    };
    let mut run = begin_on(only_ahead(), &job(None), None);
    assert!(work(&mut *run).is_empty(), "nothing is searched");
    let failure = run.outcome(None, &NEVER).expect_err("a refusal");
    assert_eq!(failure.kind, "/problems/not-identifiable");
    let [fault] = &failure.errors[..] else {
        panic!("{:?}", failure.errors);
    };
    for name in ["coulomb_friction", "offset", "give one of them"] {
        assert!(fault.detail.contains(name), "{}", fault.detail);
    }
    // The user who knows it has an estimate all the same, and low trust in it.
    let mut run = begin_on(only_ahead(), &job(Some("report")), None);
    work(&mut *run);
    let reported = outcome(&mut *run, None);
    assert_eq!(reported.verdict.trust, Trust::Low);
    // Back and forth they are reported apart.
    let mut run = begin(&job(Some("refuse")), None);
    work(&mut *run);
    assert!(run.outcome(None, &NEVER).is_ok());
}

#[test]
fn a_run_that_is_hurried_has_its_best_so_far_without_what_takes_long() {
    let mut run = begin(&job(), None);
    run.advance(&NEVER, &mut |_| ());
    let slow = outcome(&mut *run, Some(StopReason::Cancelled));
    let hurry = AtomicBool::new(true);
    let soon = analysed(&mut *run, Some(StopReason::Cancelled), &hurry);
    let estimates = |outcome: &Outcome| -> Vec<f64> {
        let parameters = outcome.parameters.iter();
        parameters
            .map(|parameter| parameter.estimate.estimate)
            .collect()
    };
    assert_eq!(estimates(&soon), estimates(&slow));
    assert_eq!(soon.verdict.trust, Trust::Low);
    assert_eq!(soon.verdict.reasons[0].code, Rule::NotAnalysed);
}

#[test]
fn a_stopped_run_has_the_best_so_far_and_can_go_on() {
    let job = job();
    let mut run = begin(&job, None);
    assert_eq!(run.outcome(Some(StopReason::Cancelled), &NEVER), Ok(None));
    run.advance(&NEVER, &mut |_| ());
    let paused = outcome(&mut *run, Some(StopReason::Paused));
    assert_eq!(paused.stop_reason, StopReason::Paused);
    work(&mut *run);
    let mut unbroken = begin(&job, None);
    work(&mut *unbroken);
    let (resumed, unbroken) = (outcome(&mut *run, None), outcome(&mut *unbroken, None));
    assert_eq!(resumed.parameters, unbroken.parameters);
}

#[test]
fn a_raised_flag_interrupts_the_analysis_too() {
    let mut run = begin(&job(), None);
    let stop = AtomicBool::new(false);
    while run.progress().phase != Phase::Analyse {
        assert_eq!(run.advance(&stop, &mut |_| ()), Advance::Working);
    }
    stop.store(true, Ordering::Relaxed);
    assert_eq!(run.advance(&stop, &mut |_| ()), Advance::Interrupted);
    work(&mut *run);
    assert_eq!(run.advance(&NEVER, &mut |_| ()), Advance::Finished);
}

#[test]
fn a_job_that_does_not_read_back_says_why() {
    let method = Methods::new(Catalogue::built_in());
    let assignment = |job: JobRow, checkpoint| Assignment {
        model: None,
        job,
        datasets: vec![("sha256:1".to_owned(), Arc::new(recording()))],
        checkpoint,
        past: None,
        stream: None,
    };
    let mut unknown = job();
    unknown.model = "perpetuum_mobile".to_owned();
    let failure = method.begin(assignment(unknown, None)).err();
    let detail = failure.expect("no such model").detail;
    assert_eq!(detail, "there is no model `perpetuum_mobile`");
    let failure = method.begin(assignment(job(), Some(b"{}".to_vec()))).err();
    let detail = failure.expect("no checkpoint").detail;
    assert!(
        detail.starts_with("the stored checkpoint does not read back"),
        "{detail}"
    );
}
