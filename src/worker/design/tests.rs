//! A design as a job, whole and in pieces.

use serde_json::{Value, json};

use super::*;
use crate::job::{DesignTask, JobTask};
use crate::store::JobRow;
use crate::worker::method::Methods;
use crate::worker::run::Method;
use crate::worker::tests::at_work;
use greybox::model::Catalogue;

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);
/// Raised all the time.
static ALWAYS: AtomicBool = AtomicBool::new(true);

/// A push on a drive of which mass and viscous friction are to be known better.
fn job() -> JobRow {
    job_with(|_| ())
}

/// The job with the document of its design changed.
fn job_with(change: impl FnOnce(&mut Value)) -> JobRow {
    let mut design = json!({
        "model": "positioning_drive",
        "parameters": {
            "mass": {"estimate": {}, "prior": {"mean": 95, "std": 10}},
            "viscous_friction": {"estimate": {}, "prior": {"mean": 200, "std": 50}},
            "coulomb_friction": {"value": 20, "tolerance": "10 %"},
            "offset": {"value": 0}
        },
        "initial_state": {"position": 0, "velocity": 0},
        "outputs": {"position": {"noise_std": 1e-4}},
        "sensors": {"velocity": {"noise_std": 1e-3}},
        "inputs": {"force": {"lower": -100, "upper": 100}},
        "families": ["steps", "sine"],
        "proposals": [{"kind": "steps", "hold_s": 1, "levels": [1, 0]}],
        "sample_time_s": 0.05, "duration_s": 1, "points": 2
    });
    change(&mut design);
    let task = DesignTask::new(DesignRequest::new(design), None, 3600.0);
    at_work("positioning_drive", JobTask::Design(task))
}

fn begun(checkpoint: Option<Vec<u8>>) -> Box<dyn Run> {
    let assignment = Assignment {
        job: job(),
        model: None,
        datasets: Vec::new(),
        past: None,
        stream: None,
        checkpoint,
    };
    let methods = Methods::new(Catalogue::built_in());
    methods.begin(assignment).expect("a run")
}

fn result(run: &mut dyn Run) -> Design {
    let result = run.outcome(None, &NEVER).expect("no failure");
    match result {
        Some(ResultOfJob::Design(design)) => *design,
        result => panic!("no design: {result:?}"),
    }
}

/// What events told, in order.
fn told(rows: &[Row]) -> Vec<(u64, f64)> {
    let told = rows.iter().map(|row| match row {
        Row::Design(event) => (event.assessed, event.best.log10_determinant),
        other => panic!("no row of a design: {other:?}"),
    });
    told.collect()
}

#[test]
fn a_design_that_is_saved_after_every_unit_is_the_same_with_the_same_events() {
    let mut whole = begun(None);
    let mut rows = Vec::new();
    while whole.advance(&NEVER, &mut |row| rows.push(row)) == Advance::Working {}
    let expected = result(&mut *whole);
    assert!(expected.finished);
    let events = told(&rows);
    assert!(events.len() > 1, "{events:?}");
    assert!(
        events.windows(2).all(|pair| pair[0].1 < pair[1].1),
        "{events:?}"
    );

    let (mut checkpoint, mut rows) = (None, Vec::new());
    let mut units = 0;
    loop {
        let mut run = begun(checkpoint.take());
        let advance = run.advance(&NEVER, &mut |row| rows.push(row));
        let progress = run.progress();
        assert!(progress.fraction <= 1.0, "{progress:?}");
        units += 1;
        if advance == Advance::Finished {
            assert_eq!(result(&mut *run), expected);
            break;
        }
        assert_eq!(progress.evaluations, units * EXPERIMENTS_A_UNIT as u64);
        checkpoint = Some(run.checkpoint());
    }
    assert_eq!(told(&rows), events);
}

#[test]
fn a_design_that_is_stopped_has_the_best_so_far() {
    let mut run = begun(None);
    assert_eq!(run.advance(&ALWAYS, &mut |_| ()), Advance::Interrupted);
    let stopped = Some(StopReason::Cancelled);
    assert_eq!(run.outcome(stopped, &ALWAYS).expect("no failure"), None);
    assert_eq!(run.advance(&NEVER, &mut |_| ()), Advance::Working);
    assert_eq!(run.advance(&ALWAYS, &mut |_| ()), Advance::Interrupted);
    let best = result(&mut *run);
    assert!(!best.finished);
    assert_eq!(best.assessed, EXPERIMENTS_A_UNIT as u64);
    assert_eq!(best.findings[0].code, "not_finished");
}

#[test]
fn a_task_that_does_not_read_back_says_why() {
    let job = job_with(|design| design["wanted"] = json!(["offset"]));
    let assignment = Assignment {
        job,
        model: None,
        datasets: Vec::new(),
        past: None,
        stream: None,
        checkpoint: None,
    };
    let methods = Methods::new(Catalogue::built_in());
    let failure = methods.begin(assignment).err().expect("nothing to design");
    assert_eq!(failure.detail, "the design cannot be made");
    assert_eq!(failure.errors[0].code, "not_estimated");
}
