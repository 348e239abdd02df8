//! Recordings that others measured, where they are at hand: in the folder that
//! `GREYBOX_SHARED_DATA` names, or else in `../shared/data` beside the repository. They are not part
//! of the repository, so the tests are skipped, aloud, where the folder is missing.

use greybox::intake::csv;
use greybox::recording::{Mapped, Recording, Selection};
use std::fs::File;
use std::path::PathBuf;

fn recording(file: &str) -> Option<Recording> {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data"));
    let folder = std::env::var_os("GREYBOX_SHARED_DATA").map_or_else(beside, PathBuf::from);
    let path = folder.join(file);
    let Ok(text) = File::open(&path) else {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    };
    Some(csv::read(text, &csv::Options::default()).expect("the recording is known to be good"))
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
        .experiment(&signals, Selection::default())
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
