//! Recipes as a whole, from the document to the prepared recording.

use super::{prepare, read_recipe};
use greybox_numerics::parsing::Fault;
use greybox_recording::{Recording, TimeAxis};
use serde_json::{Value, json};

fn tank() -> Recording {
    let level = (0..200).map(|k| 1.0 + 0.01 * f64::from(k)).collect();
    let pressure = (0..200).map(|k| 1e5 + 100.0 * f64::from(k)).collect();
    Recording::from_samples(0.5, [("level", "m", level), ("PT 101.PV", "Pa", pressure)])
}

fn prepared(steps: Value) -> Result<Recording, Vec<Fault>> {
    let recipe = read_recipe(&json!({ "steps": steps }), 200, 1000)?;
    prepare(tank(), &recipe.steps)
}

#[test]
fn steps_follow_one_another_and_are_told() {
    let recording = prepared(json!([
        {"step": "cut", "from_s": 10.0, "to_s": 90.0},
        {"step": "calculate", "signal": "head", "unit": "mm", "equation": "p/(1000*9.81)",
         "names": {"p": "PT 101.PV"}},
        {"step": "remove", "signals": ["PT 101.PV"]},
        {"step": "resample", "sample_time_s": 2.0, "held": ["level"]},
    ]));
    let faults = recording.unwrap_err();
    // A pressure over a number is no length: the density and the acceleration have units of their own.
    assert_eq!(
        (&*faults[0].code, faults[0].pointer()),
        ("units_do_not_fit", "/steps/1/equation")
    );
    let recording = prepared(json!([
        {"step": "cut", "from_s": 10.0, "to_s": 90.0},
        {"step": "calculate", "signal": "head", "equation": "p/(1000*9.81)", "names": {"p": "PT 101.PV"}},
        {"step": "remove", "signals": ["PT 101.PV"]},
        {"step": "resample", "sample_time_s": 2.0, "held": ["level"]},
    ]))
    .unwrap();
    let names: Vec<&str> = recording
        .signals
        .iter()
        .map(|signal| &*signal.name)
        .collect();
    assert_eq!(names, ["level", "head"]);
    assert_eq!(
        recording.time,
        TimeAxis::Uniform {
            sample_time: 2.0,
            samples: 41
        }
    );
    // Sample 60 of the recording was taken 20 s after the cut.
    assert_eq!(recording.signals[0].values[10], 1.6);
    let head = recording.signals[1].values[10];
    assert!((head - 1.06e5 / 9810.0).abs() < 1e-6, "{head}");
    let told: Vec<&str> = recording.notes.iter().map(|note| &*note.detail).collect();
    assert_eq!(told[0], "step 1: cut to 10 to 90 s");
    assert_eq!(told[1], "step 2: `head` = p/(1000*9.81), p is `PT 101.PV`");
    assert_eq!(told.len(), 4);
}

#[test]
fn an_equation_without_a_value_leaves_samples_missing_and_says_so() {
    let steps =
        json!([{"step": "calculate", "signal": "level", "equation": "sqrt(level - 1.555)"}]);
    let recording = prepared(steps).unwrap();
    assert_eq!(recording.signals.len(), 2);
    assert_eq!(recording.signals[0].missing(), 56);
    let told = &recording.notes[1];
    assert_eq!(
        (&*told.code, told.signal.as_deref()),
        ("no_finite_value", Some("level"))
    );
    assert!(told.detail.starts_with("56 samples"), "{}", told.detail);
}

/// Asserts the place and the code of the first fault of steps.
#[track_caller]
fn assert_refused(steps: Value, place: &str, code: &str) {
    let faults = prepared(steps).unwrap_err();
    assert_eq!(
        (faults[0].pointer(), &*faults[0].code),
        (place, code),
        "{faults:?}"
    );
}

#[test]
fn a_step_that_cannot_be_done_is_refused_at_its_place() {
    for (steps, place, code) in [
        (json!([]), "/steps", "out_of_range"),
        (
            json!([{"step": "smooth"}]),
            "/steps/0/step",
            "unknown_choice",
        ),
        (
            json!([{"step": "cut", "from_s": 5, "to_s": 2}]),
            "/steps/0",
            "bounds_reversed",
        ),
        (
            json!([{"step": "cut", "from_s": 1e4}]),
            "/steps/0",
            "too_short",
        ),
        (
            json!([{"step": "median", "samples": 4}]),
            "/steps/0/samples",
            "out_of_range",
        ),
        (
            json!([{"step": "low_pass", "cutoff_hz": 1.0}]),
            "/steps/0/cutoff_hz",
            "out_of_range",
        ),
        (
            json!([{"step": "shift", "signals": ["levle"], "by_s": 1}]),
            "/steps/0/signals",
            "unknown_signal",
        ),
        (
            json!([{"step": "remove", "signals": []}]),
            "/steps/0/signals",
            "no_signals",
        ),
        (
            json!([{"step": "remove", "signals": ["level", "PT 101.PV"]}]),
            "/steps/0/signals",
            "no_signals",
        ),
        (
            json!([{"step": "resample", "sample_time_s": 1000}]),
            "/steps/0/sample_time_s",
            "out_of_range",
        ),
        (
            json!([{"step": "remove", "signals": ["level"]},
                   {"step": "detrend", "signals": ["level"], "trend": "mean"}]),
            "/steps/1/signals",
            "unknown_signal",
        ),
    ] {
        assert_refused(steps, place, code);
    }
}

#[test]
fn an_equation_that_cannot_be_calculated_is_refused_at_its_place() {
    for (steps, place, code) in [
        (
            json!([{"step": "calculate", "signal": "x", "equation": "level", "unit": "furlong"}]),
            "/steps/0/unit",
            "unknown_unit",
        ),
        (
            json!([{"step": "calculate", "signal": "", "equation": "level"}]),
            "/steps/0/signal",
            "empty_name",
        ),
        (
            json!([{"step": "calculate", "signal": "x", "equation": "levels"}]),
            "/steps/0/equation",
            "unknown_name",
        ),
        (
            json!([{"step": "calculate", "signal": "x", "equation": "p", "names": {"p": "P"}}]),
            "/steps/0/names",
            "unknown_signal",
        ),
    ] {
        assert_refused(steps, place, code);
    }
}

#[test]
fn steps_that_take_too_long_are_refused_at_the_step_that_is_too_much() {
    let long = Recording::from_samples(0.5, [("level", "m", vec![1.0; 1_000_000])]);
    let steps = json!({"steps": [
        {"step": "resample", "sample_time_s": 0.05},
        {"step": "median", "samples": 1001},
    ]});
    let recipe = read_recipe(&steps, 200, 1000).unwrap();
    let faults = prepare(long, &recipe.steps).unwrap_err();
    assert_eq!(
        (faults[0].pointer(), &*faults[0].code),
        ("/steps/1", "too_much_work")
    );
}

#[test]
fn a_filter_needs_a_grid_and_tells_what_it_does_to_noise() {
    let mut recording = tank();
    let mut instants: Vec<f64> = (0..200).map(|k| 0.5 * f64::from(k)).collect();
    instants[7] += 0.1;
    recording.time = TimeAxis::Instants(instants);
    let steps = json!([{"step": "low_pass", "cutoff_hz": 0.1, "signals": ["level"]}]);
    let recipe = read_recipe(&json!({ "steps": steps }), 200, 1000).unwrap();
    let faults = prepare(recording, &recipe.steps).unwrap_err();
    assert_eq!(
        (faults[0].pointer(), &*faults[0].code),
        ("/steps/0", "not_uniform")
    );
    let codes = prepare(tank(), &recipe.steps)
        .unwrap()
        .notes
        .into_iter()
        .map(|note| note.code);
    assert_eq!(
        codes.collect::<Vec<_>>(),
        ["prepared", "filtered_noise", "filtered_in_part"]
    );
}
