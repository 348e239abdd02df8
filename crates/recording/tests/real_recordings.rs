//! Recordings that others measured, where they are at hand: in the folder that
//! `GREYBOX_SHARED_DATA` names, or else in `../shared/data` beside the repository. They are not part
//! of the repository, so the tests are skipped, aloud, where the folder is missing.

#![expect(clippy::unwrap_used, reason = "a test whose premise fails has failed")]

use greybox_recording::intake;
use greybox_recording::{Mapped, Recording, RecordingSelection, Signal};
use serde_json::json;
use std::fmt::Write as _;
use std::fs::File;
use std::path::PathBuf;

fn recording(file: &str) -> Option<Recording> {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let folder = std::env::var_os("GREYBOX_SHARED_DATA").map_or_else(beside, PathBuf::from);
    let path = folder.join(file);
    let Ok(text) = File::open(&path) else {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    };
    Some(Recording::from_csv(text).expect("the recording is known to be good"))
}

#[test]
fn the_positioning_drive_is_uniform_and_without_warnings() {
    let Some(recording) = recording("emps.csv") else {
        return;
    };
    let summary = recording.summary();
    assert_eq!(
        (summary.samples, summary.sample_time_s, summary.uniform),
        (24_841, 0.001, true)
    );
    assert_eq!(summary.report.warnings, []);
    let force = recording.signal("force").unwrap();
    let voltage = recording.signal("voltage").unwrap();
    let gain = force.values[1000] / voltage.values[1000];
    assert!(
        (gain - 35.150_651_88).abs() < 1e-6,
        "the documented gain is 35.15065188 N/V"
    );
}

#[test]
fn the_jittered_recording_is_resampled_to_its_nominal_rate() {
    let Some(recording) = recording("quarter_drone_irregular.csv") else {
        return;
    };
    assert!(!recording.time.is_uniform());
    let signals = [Mapped::on_line("angle", "angle")];
    let experiment = recording
        .experiment(&signals, RecordingSelection::default())
        .unwrap();
    assert_eq!(experiment.sample_time, 0.01);
    assert_eq!(experiment.notes[0].code, "resampled");
    let angle = &experiment.signals[0].1;
    let missing = angle.iter().filter(|angle| angle.is_nan()).count();
    assert!(missing * 100 < angle.len(), "{missing} of {}", angle.len());
}

#[test]
fn bar_and_degrees_of_the_crane_are_converted() {
    let Some(recording) = recording("lut_patu_crane.csv") else {
        return;
    };
    let pressure = recording.signal("piston_side_pressure").unwrap();
    assert_eq!(
        (pressure.unit.as_str(), pressure.recorded_unit.as_str()),
        ("Pa", "bar")
    );
    assert!((pressure.values[0] - 66.10807e5).abs() < 1e-3);
    let angle = recording.signal("boom_angle").unwrap();
    assert!((angle.values[0] - 0.943545_f64.to_radians()).abs() < 1e-12);
}

/// The bits of samples; one for all that are missing.
fn bits(values: &[f64]) -> Vec<u64> {
    let of = |value: &f64| match value.is_nan() {
        true => u64::MAX,
        false => value.to_bits(),
    };
    values.iter().map(of).collect()
}

fn instants(recording: &Recording) -> impl Iterator<Item = f64> {
    (0..recording.time.samples()).map(|k| recording.time.instant(k))
}

/// The recording as a CSV with a row for each sample.
fn long_csv(recording: &Recording) -> Vec<u8> {
    let mut text = "time,tag,value,unit\n".to_owned();
    for (k, time) in instants(recording).enumerate() {
        for signal in recording
            .signals
            .iter()
            .filter(|signal| !signal.values[k].is_nan())
        {
            let (name, unit) = (&signal.name, &signal.unit);
            writeln!(text, "{time:?},{name},{:?},{unit}", signal.values[k]).unwrap();
        }
    }
    text.into_bytes()
}

/// The recording as this service's JSON.
fn json(recording: &Recording) -> Vec<u8> {
    let values = |values: &[f64]| -> Vec<Option<f64>> {
        let present = values
            .iter()
            .map(|value| (!value.is_nan()).then_some(*value));
        present.collect()
    };
    let signals = recording.signals.iter().map(|signal| {
        let shown = json!({"unit": signal.unit, "values": values(&signal.values)});
        (signal.name.clone(), shown)
    });
    let instants: Vec<f64> = instants(recording).collect();
    let document = json!({
        "time": {"unit": "s", "values": instants},
        "signals": signals.collect::<serde_json::Map<_, _>>(),
    });
    document.to_string().into_bytes()
}

/// The recording as a pandas frame of its columns.
fn pandas(recording: &Recording) -> Vec<u8> {
    let title = |signal: &Signal| match &*signal.unit {
        "" => signal.name.clone(),
        unit => format!("{} [{unit}]", signal.name),
    };
    let rows = instants(recording).enumerate().map(|(k, time)| {
        let values = recording.signals.iter().map(|signal| signal.values[k]);
        let row = std::iter::once(time).chain(values);
        row.map(|value| (!value.is_nan()).then_some(value))
            .collect::<Vec<_>>()
    });
    let titles = recording.signals.iter().map(title);
    let columns: Vec<String> = std::iter::once("time [s]".to_owned())
        .chain(titles)
        .collect();
    let frame = json!({"columns": columns, "data": rows.collect::<Vec<_>>()});
    frame.to_string().into_bytes()
}

/// What an estimate sees of a recording does not depend on the format in which it came, to the last
/// bit; so the estimate does not.
#[test]
fn a_recording_is_the_same_in_four_formats() {
    let files = [
        "emps.csv",
        "lut_patu_crane.csv",
        "tclab_1s.csv",
        "ball_and_hoop_random.csv",
    ];
    for file in files {
        let Some(recording) = recording(file) else {
            return;
        };
        for (format, bytes) in [
            ("long_csv", long_csv(&recording)),
            ("json", json(&recording)),
            ("pandas_split", pandas(&recording)),
        ] {
            let mut options = intake::Options::default();
            options.set("format", format).unwrap();
            let other = intake::read(&bytes[..], intake::MediaKind::Text, &options).unwrap();
            assert_eq!(other.source.format, format);
            assert_eq!(other.time, recording.time, "{file} as {format}");
            for signal in &recording.signals {
                let own = other.signal(&signal.name).expect(format);
                assert_eq!(own.unit, signal.unit, "{file} as {format}");
                assert_eq!(
                    bits(&own.values),
                    bits(&signal.values),
                    "{file} as {format}"
                );
            }
        }
    }
}
