//! A selection as a job, whole and in pieces.

use serde_json::json;

use super::*;
use crate::job::{JobKind, JobTask};
use crate::store::JobRow;
use crate::worker::method::Methods;
use crate::worker::run::Method;
use crate::worker::tests::at_work;
use greybox::Identification;
use greybox::identification::JobId;
use greybox::identification::spec::selection::SelectionRequest;
use greybox::model::Catalogue;
use greybox::recording::{RowSignal, Rows};

/// Raised all the time.
static ALWAYS: AtomicBool = AtomicBool::new(true);

/// Samples of a window, one a second.
const SAMPLES: usize = 100;
const WINDOWS: usize = 40;

/// A lag of 5 s with a gain of 2, whose input steps up in every third window, and a sensor of few digits.
fn recording(windows: usize) -> Recording {
    let (mut x, share) = (2.0_f64, (-1.0_f64 / 5.0).exp());
    let samples = (0..windows * SAMPLES).map(|k| {
        let is_up = (k / SAMPLES) % 3 == 1 && k % SAMPLES > 20;
        let u = if is_up {
            1.5 + 0.01 * (k / SAMPLES) as f64
        } else {
            1.0
        };
        let read = (x * 100.0 + (k as f64 * 7.3).sin()).round() / 100.0;
        x = 2.0 * u + share * (x - 2.0 * u);
        (u, read)
    });
    let (u, y): (Vec<f64>, Vec<f64>) = samples.unzip();
    let mut recording = Recording::from_samples(1.0, [("u", "1", u), ("y", "1", y)]);
    recording.start = Some(jiff::Timestamp::UNIX_EPOCH);
    recording
}

/// The windows as a stream.
#[derive(Debug)]
struct Written(Vec<RowSignal>, Rows);

impl StreamReader for Written {
    fn signals(&self) -> &[RowSignal] {
        &self.0
    }

    fn rows(&self, span: Range<i64>, _most: usize) -> Result<Option<Rows>, Failure> {
        Ok(Some(self.1.within(span.start, span.end)))
    }
}

/// A finished job over the first windows, and a selection among all.
fn assignment(checkpoint: Option<Vec<u8>>) -> Assignment {
    let first = recording(3);
    let identification = Identification::of_job(
        json!({"model": "first_order_dead_time", "process_noise": "none", "validation": {"fraction": 0}, "seed": 1,
               "parameters": {"gain": {"estimate": {"lower": 1, "upper": 4}}, "time_constant": {"estimate": {}},
                              "dead_time": {"value": 0}, "offset": {"value": 0}},
               "experiments": [{"initial_state": {"lagged": {"value": 2}}}]}),
        first.clone(),
    );
    let (spec, model) = identification.specification().expect("a specification");
    let outcome = identification.run().expect("an estimate");
    let wanted = outcome.parameters[0].name.clone();
    let asked = json!({
        "job": JobId::new(), "stream": "line", "window_s": SAMPLES, "budget_samples": 3 * SAMPLES, "wanted": [wanted],
        "initial_state": {"lagged": {"estimate": {"lower": 0, "upper": 5}}},
    });
    let before = PastJob::new(&spec, &outcome);
    let end = jiff::Timestamp::from_second((WINDOWS * SAMPLES) as i64).expect("an instant");
    let task = SelectionTask::new(
        SelectionRequest::new(asked),
        &before,
        (jiff::Timestamp::UNIX_EPOCH, end),
        60.0,
    );
    let (signals, rows) = Rows::of(recording(WINDOWS)).expect("a start");
    Assignment {
        job: job(&model.description().name, task),
        model: None,
        datasets: vec![(String::new(), Arc::new(first))],
        past: Some(Past { spec, outcome }),
        stream: Some(Arc::new(Written(signals, rows))),
        checkpoint,
    }
}

fn job(model: &str, task: SelectionTask) -> JobRow {
    at_work(model, JobTask::Selection(task))
}

fn begun(checkpoint: Option<Vec<u8>>) -> Box<dyn Run> {
    let methods = Methods::new(Catalogue::built_in());
    methods.begin(assignment(checkpoint)).expect("a run")
}

fn result(run: &mut dyn Run) -> Selection {
    match run.outcome(None, &NEVER).expect("no failure") {
        Some(ResultOfJob::Selection(selection)) => *selection,
        result => panic!("no selection: {result:?}"),
    }
}

#[test]
fn a_selection_that_is_saved_after_every_unit_is_the_same_with_the_same_events() {
    let mut whole = begun(None);
    let mut rows = Vec::new();
    while whole.advance(&NEVER, &mut |row| rows.push(row)) == Advance::Working {}
    let expected = result(&mut *whole);
    assert!(expected.finished);
    assert_eq!(expected.chosen.len(), 3);
    assert!(
        expected.chosen.iter().all(|window| window.window % 3 == 1),
        "{:?}",
        expected.chosen
    );
    let last = SelectionEvent {
        looked: WINDOWS as u64,
        windows: WINDOWS as u64,
    };
    assert_eq!(rows.last(), Some(&Row::Selection(last)));

    let (mut checkpoint, mut again) = (None, Vec::new());
    loop {
        let mut run = begun(checkpoint.take());
        if run.advance(&NEVER, &mut |row| again.push(row)) == Advance::Finished {
            assert_eq!(result(&mut *run).chosen, expected.chosen);
            assert_eq!(run.progress().fraction, 1.0);
            break;
        }
        checkpoint = Some(run.checkpoint());
    }
    assert_eq!(again, rows);
}

#[test]
fn a_selection_that_is_stopped_has_the_best_so_far() {
    let mut run = begun(None);
    assert_eq!(run.advance(&ALWAYS, &mut |_| ()), Advance::Interrupted);
    let stopped = Some(StopReason::Cancelled);
    assert_eq!(run.outcome(stopped, &ALWAYS).expect("no failure"), None);
    assert_eq!(run.advance(&NEVER, &mut |_| ()), Advance::Working);
    assert_eq!(run.advance(&ALWAYS, &mut |_| ()), Advance::Interrupted);
    let result = run.outcome(stopped, &ALWAYS).expect("no failure");
    let Some(ResultOfJob::Selection(best)) = result else {
        panic!("no selection: {result:?}");
    };
    assert!(!best.finished);
    assert_eq!(best.windows.count, WINDOWS_A_UNIT as u64);
    assert_eq!(best.chosen.len(), 3);
    assert_eq!(
        best.findings.last().map(|finding| &*finding.code),
        Some("not_finished")
    );
}

#[test]
fn a_selection_without_its_stream_says_so() {
    let mut assignment = assignment(None);
    assert_eq!(assignment.job.task.kind(), JobKind::Selection);
    assignment.stream = None;
    let methods = Methods::new(Catalogue::built_in());
    let failure = methods.begin(assignment).err().expect("no stream");
    assert_eq!(
        failure.detail,
        "a selection needs a finished job and a stream"
    );
}
