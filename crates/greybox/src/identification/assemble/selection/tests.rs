//! A lag whose history is written down: what is chosen, what is left out and why, and what is foretold held against
//! what estimates do.

use super::*;
use crate::identification::JobSpec;
use crate::identification::selection::{LeftOut, Selection};
use crate::identification::spec::design::PastJob;
use crate::identification::spec::selection::SelectionRequest;
use crate::identification::{JobId, Outcome};
use crate::{Identification, Recording};
use greybox_numerics::rng::{self, Purpose};
use greybox_recording::{RecordingSource, RowSignal, Rows};
use greybox_simulation::model::Model;
use rayon::prelude::*;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

const TIME_CONSTANT: f64 = 20.0;
const GAIN: f64 = 2.0;
const NOISE: f64 = 0.05;
/// Samples of a window, one a second.
const SAMPLES: usize = 300;

fn lag() -> Arc<Model> {
    let text = json!({
        "name": "lag",
        "inputs": {"u": {"unit": "1"}},
        "parameters": {
            "T": {"unit": "s", "default": 10, "lower": 2, "upper": 100, "scale": "log", "unknown": true},
            "K": {"unit": "1", "default": 1, "lower": 0.2, "upper": 10, "scale": "log", "unknown": true},
            "bias": {"unit": "1", "default": 0}
        },
        "states": {"x": {"unit": "1", "initial": 0, "derivative": "(K*(u + bias) - x)/T"}},
        "outputs": {"y": {"unit": "1", "expression": "x"}}
    });
    Model::from_text(&text.to_string()).expect("a model")
}

/// What the input does in a window.
fn input(window: usize, second: usize) -> f64 {
    match window % 4 {
        // A square wave that is slow beside the lag, and one that is fast: later ones are larger.
        1 => [1.0, 2.0 + 0.01 * window as f64][second / 75 % 2],
        3 => [1.0, 1.5 + 0.01 * window as f64][second / 10 % 2],
        _ => 1.0,
    }
}

/// So many windows of the plant, by the exact answer of a lag to a held input, and what its sensor reads.
fn history(windows: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut random = rng::stream(seed, 0, Purpose::Noise);
    let (mut x, share) = (GAIN, libm::exp(-1.0 / TIME_CONSTANT));
    let inputs = (0..windows * SAMPLES).map(|k| input(k / SAMPLES, k % SAMPLES));
    inputs
        .map(|u| {
            let read = x + NOISE * rng::normal(&mut random);
            x = GAIN * u + share * (x - GAIN * u);
            (u, read)
        })
        .unzip()
}

/// The plant under a controller that looks at the noisy sensor, with a set point that moves.
fn controlled(windows: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut random = rng::stream(seed, 0, Purpose::Noise);
    let (mut x, mut integral, mut u) = (GAIN, 1.0, 1.0);
    let share = libm::exp(-1.0 / TIME_CONSTANT);
    let samples = (0..windows * SAMPLES).map(|k| {
        let read = x + NOISE * rng::normal(&mut random);
        let played = u;
        x = GAIN * u + share * (x - GAIN * u);
        let off = GAIN * input(k / SAMPLES, k % SAMPLES) - read;
        integral += 0.01 * off;
        u = integral + 0.3 * off;
        (played, read)
    });
    samples.unzip()
}

fn recording(u: &[f64], y: &[f64]) -> Recording {
    Recording::from_samples(1.0, [("u", "1", u.to_vec()), ("y", "1", y.to_vec())])
}

fn job(more: &Value) -> Value {
    let mut job = json!({
        "model": "lag", "process_noise": "none",
        "parameters": {"T": {"estimate": {}}, "K": {"estimate": {}}, "bias": {"value": 0}},
        "experiments": [{"initial_state": {"x": {"estimate": {"lower": 0, "upper": 6}}}}],
        "validation": {"fraction": 0}, "seed": 1
    });
    for (name, value) in more.as_object().expect("an object") {
        job[name] = value.clone();
    }
    job
}

/// The windows of the finished job.
fn history_of_job() -> (Vec<f64>, Vec<f64>) {
    history(4, 1)
}

/// A job over the first four windows of a history.
fn finished(more: &Value) -> (JobSpec, Outcome) {
    let (u, y) = history_of_job();
    let identification = Identification::of_job(job(more), recording(&u, &y)).model(&lag());
    let (spec, _) = identification.specification().expect("a specification");
    (spec, identification.run().expect("an estimate"))
}

/// The rows of a history, from 1970 on.
fn rows(u: &[f64], y: &[f64]) -> (Vec<RowSignal>, Rows) {
    let mut recording = recording(u, y);
    recording.start = Some(jiff::Timestamp::UNIX_EPOCH);
    recording.source = RecordingSource::default();
    Rows::of(recording).expect("a start")
}

/// A selection among the windows of a history, with an answer as the service makes it.
fn selected(
    (spec, outcome): &(JobSpec, Outcome),
    (u, y): &(Vec<f64>, Vec<f64>),
    asked: &Value,
) -> Selection {
    let mut asked = asked.clone();
    asked["job"] = json!(JobId::new());
    asked["stream"] = json!("line");
    asked["window_s"] = json!(SAMPLES);
    let before = PastJob::new(spec, outcome);
    let asked = SelectionRequest::new(asked)
        .read(Some(lag().description()), Some(&before))
        .expect("a selection");
    let first = history_of_job();
    let past = super::super::PastResult {
        spec,
        outcome,
        recordings: &[Arc::new(recording(&first.0, &first.1))],
    };
    let selecting = Selecting::begin(asked, &lag(), past, &NEVER).expect("a beginning");
    let selecting = selecting.expect("nobody stopped it");
    let (signals, rows) = rows(u, y);
    let window = SAMPLES as i64 * 1_000_000_000;
    let span = SelectedSpan {
        from: 0,
        until: (u.len() / SAMPLES) as i64 * window,
        window,
    };
    let windows = (0..span.count()).map(|place| {
        let bounds = span.bounds(place);
        match selecting.is_excluded(bounds) {
            true => HistoryWindow::LeftOut(LeftOut::Excluded),
            false => HistoryWindow::Recorded {
                rows: rows.within(bounds.0, bounds.1),
                bounds,
            },
        }
    });
    let looked = selecting.look(windows.collect(), &signals, &NEVER);
    let looked = looked.expect("nobody stopped it");
    selecting
        .select(span, &looked, &NEVER)
        .expect("a selection")
}

fn chosen(selection: &Selection) -> Vec<u64> {
    selection
        .chosen
        .iter()
        .map(|window| window.window)
        .collect()
}

fn total(selection: &Selection, name: &str) -> f64 {
    let parameter = selection
        .with_chosen
        .iter()
        .find(|parameter| parameter.name == name);
    parameter
        .and_then(|parameter| parameter.total_standard_error)
        .expect("it is fixed")
}

#[test]
fn windows_that_say_something_of_what_is_wanted_are_chosen_and_the_others_have_a_reason() {
    let finished = finished(&json!({}));
    let mut history = history(12, 2);
    // A sensor that stands still in window 5, nothing at all in window 7.
    history.1[5 * SAMPLES..6 * SAMPLES].fill(1.0);
    history.1[7 * SAMPLES..8 * SAMPLES].fill(f64::NAN);
    history.0[7 * SAMPLES..8 * SAMPLES].fill(f64::NAN);
    let asked = json!({
        "wanted": ["K"], "budget_samples": 2 * SAMPLES,
        "exclude": [{"from": "1970-01-01T00:05:10Z", "to": "1970-01-01T00:05:20Z"}]
    });
    let selection = selected(&finished, &history, &asked);
    assert!(selection.finished);
    let reasons = &selection.windows.left_out;
    let flat = Some(LeftOut::InputsStoodStill);
    assert_eq!(reasons[0], flat);
    assert_eq!(reasons[1], Some(LeftOut::Excluded));
    assert_eq!(reasons[2], flat);
    assert_eq!(reasons[3], None);
    assert_eq!(reasons[5], Some(LeftOut::OutputStoodStill));
    assert_eq!(reasons[9], None);
    assert!(reasons[7].is_some());
    // The gain is seen where the input moves slowly: window 9 before 3 and 11.
    assert!(chosen(&selection).contains(&9), "{:?}", chosen(&selection));
    assert_eq!(selection.samples, 2 * SAMPLES as u64);
    let alone = &selection.windows.alone["K"];
    assert!(alone[9] < alone[3], "{alone:?}");
    assert_eq!(alone[0], None);
    assert_eq!(selection.chosen[0].moved, ["u"]);
    let hours: f64 = selection.left_out.iter().map(|count| count.hours).sum();
    let windows: u64 = selection.left_out.iter().map(|count| count.windows).sum();
    assert!((hours - windows as f64 * SAMPLES as f64 / 3600.0).abs() < 1e-9);
}

#[test]
fn windows_follow_each_other_and_the_last_one_ends_where_the_time_does() {
    let span = |until: i64, window: i64| SelectedSpan {
        from: 10,
        until,
        window,
    };
    assert_eq!(span(110, 30).count(), 4);
    assert_eq!(span(110, 30).bounds(3), (100, 110));
    assert_eq!(span(100, 30).bounds(2), (70, 100));
    assert_eq!((span(100, 30).count(), span(10, 30).count()), (3, 0));
    assert_eq!(span(110, i64::MAX).count(), 1);
    assert_eq!(span(110, i64::MAX).bounds(0), (10, 110));
    assert_eq!(span(i64::MAX, 1).count(), i64::MAX as usize - 10);
}

#[test]
fn what_the_sensor_reads_decides_nothing() {
    let finished = finished(&json!({}));
    let asked = json!({"wanted": ["T"], "budget_samples": 2 * SAMPLES});
    let quiet = selected(&finished, &history(24, 3), &asked);
    let mut noisy = history(24, 4);
    // Noise that looks like an answer to the input in one window.
    for second in 9 * SAMPLES..10 * SAMPLES {
        noisy.1[second] += 0.2 * noisy.0[second];
    }
    let noisy = selected(&finished, &noisy, &asked);
    assert_eq!(chosen(&quiet), chosen(&noisy));
    assert!(
        chosen(&quiet).iter().all(|window| *window > 12),
        "{:?}",
        chosen(&quiet)
    );
}

#[test]
fn what_no_window_fixes_is_said() {
    let finished = finished(&json!({"parameters": {
        "T": {"estimate": {}}, "K": {"estimate": {}}, "bias": {"value": 0, "tolerance": 0.05}
    }}));
    // The gain is known no better than the bias of the input, which every window has.
    let asked = json!({"target": {"K": "0.1 %"}});
    let selection = selected(&finished, &history(40, 5), &asked);
    assert_eq!(selection.never_fixed, ["K"]);
    assert_eq!(selection.reached, Some(false));
    assert!(
        selection
            .findings
            .iter()
            .any(|finding| finding.code == "never_fixed")
    );
    let asked = json!({"target": {"T": "5 %"}});
    let selection = selected(&finished, &history(40, 5), &asked);
    assert_eq!(
        (selection.never_fixed.len(), selection.reached),
        (0, Some(true))
    );
}

#[test]
fn an_input_that_a_controller_makes_is_named() {
    let begun = finished(&json!({}));
    let asked = json!({"wanted": ["T"], "budget_samples": 4 * SAMPLES});
    let selection = selected(&begun, &controlled(24, 6), &asked);
    let followed = &selection.feedback[0];
    assert_eq!((&*followed.input, &*followed.output), ("u", "y"));
    assert_eq!(followed.samples_later, 1);
    assert!(
        selection
            .findings
            .iter()
            .any(|finding| finding.code == "feedback")
    );
    for seed in 0..20 {
        let selection = selected(&begun, &history(24, 200 + seed), &asked);
        assert_eq!(selection.feedback, []);
    }
}

#[test]
fn errors_are_as_large_as_was_foretold_and_the_choice_does_not_bias_them() {
    let begun = finished(&json!({}));
    let records = 96;
    let asked = json!({"target": {"T": "3 %"}});
    let errors: Vec<(f64, f64)> = (0..records)
        .into_par_iter()
        .map(|seed| {
            let history = history(24, 100 + seed);
            let selection = selected(&begun, &history, &asked);
            let mut identification: Option<Identification> = None;
            for window in chosen(&selection) {
                let span = window as usize * SAMPLES..(window as usize + 1) * SAMPLES;
                let recording = recording(&history.0[span.clone()], &history.1[span]);
                identification = Some(match identification {
                    None => Identification::of_job(
                        job(&json!({"outputs": {"y": {"noise_std": NOISE}}})),
                        recording,
                    )
                    .model(&lag()),
                    Some(before) => before.experiment(recording),
                });
            }
            let outcome = identification
                .expect("a window")
                .run()
                .expect("an estimate");
            let mut parameters = outcome.parameters.iter();
            let time_constant = parameters
                .find(|parameter| parameter.name == "T")
                .expect("T");
            (
                time_constant.estimate.estimate - TIME_CONSTANT,
                total(&selection, "T"),
            )
        })
        .collect();
    let n = errors.len() as f64;
    let ratios = errors.iter().map(|(error, foretold)| error / foretold);
    let mean = ratios.clone().sum::<f64>() / n;
    let spread = (ratios.map(|ratio| ratio * ratio).sum::<f64>() / n).sqrt();
    // A mean of 96 has a standard error of 0.10, their spread one of 0.07.
    assert!(mean.abs() < 0.3, "{mean}");
    assert!((0.8..1.2).contains(&spread), "{spread}");
}
