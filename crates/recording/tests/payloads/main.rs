//! Payloads as historians send them: for each format a clean, a typical and a nasty one, made after
//! the vendors' documents, with the recording that is expected of each beside it; and the same
//! source through several formats.

#![expect(clippy::unwrap_used, reason = "a test whose premise fails has failed")]

mod layouts;
mod same;

use greybox_recording::Recording;
use greybox_recording::intake::{self, MediaKind, Options, ReadError};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

fn expectations() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/payloads");
    let mut found = Vec::new();
    for folder in std::fs::read_dir(root).unwrap() {
        let folder = folder.unwrap().path();
        if !folder.is_dir() {
            continue;
        }
        for file in std::fs::read_dir(folder).unwrap() {
            let file = file.unwrap().path();
            if file.to_string_lossy().ends_with(".expected.json") {
                found.push(file);
            }
        }
    }
    found.sort();
    found
}

/// The payload that an expectation stands beside.
fn payload(expectation: &Path) -> Vec<u8> {
    let path = expectation.to_string_lossy();
    let stem = path.strip_suffix(".expected.json").unwrap();
    let candidates = ["csv", "json", "txt", "xlsx", "parquet"].map(|end| format!("{stem}.{end}"));
    let payload = candidates.iter().find_map(|path| std::fs::read(path).ok());
    payload.unwrap_or_else(|| panic!("nothing stands beside {path}"))
}

fn kind(name: &Value) -> MediaKind {
    match name.as_str().unwrap() {
        "csv" => MediaKind::Csv,
        "json" => MediaKind::Json,
        "text" => MediaKind::Text,
        _ => MediaKind::Binary,
    }
}

fn read(bytes: &[u8], expected: &Value) -> Result<Recording, ReadError> {
    let mut options = Options::default();
    for (option, text) in expected["options"].as_object().into_iter().flatten() {
        options.set(option, text.as_str().unwrap()).unwrap();
    }
    intake::read(bytes, kind(&expected["kind"]), &options)
}

/// The recording in the form of an expectation, as far as that says something.
fn found(recording: &Recording, expected: &Value) -> Value {
    let summary = recording.summary();
    let warnings = summary.report.warnings.iter();
    let warnings: Vec<&str> = warnings.map(|warning| warning.code.as_str()).collect();
    let mut signals = serde_json::Map::new();
    let mut interpolation = serde_json::Map::new();
    for (signal, about) in recording.signals.iter().zip(&summary.signals) {
        let values: Vec<Option<f64>> = signal
            .values
            .iter()
            .map(|value| (!value.is_nan()).then_some(*value))
            .collect();
        let mut found = json!({"unit": signal.unit, "values": values});
        if about.quality.is_some() {
            found["quality"] = json!(about.quality);
        }
        signals.insert(signal.name.clone(), found);
        interpolation.insert(signal.name.clone(), json!(signal.interpolation));
    }
    let mut all = json!({
        "kind": expected["kind"],
        "format": recording.source.format,
        "start": recording.start,
        "sample_time_s": recording.time.sample_time(),
        "signals": signals,
        "warnings": warnings,
    });
    for (key, value) in [
        ("options", json!(recording.source.options)),
        ("zone", json!(recording.zone)),
        ("interpolation", Value::Object(interpolation)),
    ] {
        if expected.get(key).is_some() {
            all[key] = value;
        }
    }
    all
}

/// Numbers that are equal as numbers, whatever JSON wrote them like.
fn same(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => {
            // A unit's factor rounds once; 1e5 times 3.3 is not the double next to 330000.
            let (one, other) = (one.as_f64().unwrap(), other.as_f64().unwrap());
            (one - other).abs() <= 1e-15 * one.abs()
        }
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(a, b)| same(a, b))
        }
        (Value::Object(one), Value::Object(other)) => {
            one.len() == other.len()
                && one
                    .iter()
                    .all(|(key, a)| other.get(key).is_some_and(|b| same(a, b)))
        }
        _ => one == other,
    }
}

/// What is wrong with the reading of one payload.
fn wrong(expectation: &Path) -> Option<String> {
    let expected: Value =
        serde_json::from_slice(&std::fs::read(expectation).unwrap()).expect("an expectation");
    let read = read(&payload(expectation), &expected);
    let difference = match (&read, expected.get("faults"), expected.get("unsupported")) {
        (Err(error), Some(faults), _) => {
            let codes: Vec<&str> = error.faults().iter().map(|fault| &*fault.code).collect();
            (json!(codes) != *faults).then(|| format!("{codes:?}: {error}"))
        }
        (Err(ReadError::Unsupported(detail)), _, Some(name)) => {
            let named = detail.contains(name.as_str().unwrap());
            (!named).then(|| detail.clone())
        }
        (Ok(recording), None, None) => {
            let found = found(recording, &expected);
            (!same(&found, &expected)).then(|| format!("{found:#}"))
        }
        (Ok(_), ..) => Some("it was read".to_owned()),
        (Err(error), ..) => Some(error.to_string()),
    };
    difference.map(|difference| format!("{}: {difference}", expectation.display()))
}

#[test]
fn every_payload_is_read_as_expected() {
    let expectations = expectations();
    assert!(expectations.len() > 60, "the corpus is there");
    let wrong: Vec<String> = expectations.iter().filter_map(|path| wrong(path)).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
}

#[test]
fn a_payload_that_is_cut_anywhere_is_no_panic() {
    for expectation in expectations() {
        let bytes = payload(&expectation);
        let expected = std::fs::read(&expectation).unwrap();
        let expected: Value = serde_json::from_slice(&expected).unwrap();
        for length in (0..bytes.len()).step_by(7) {
            let _ = read(&bytes[..length], &expected);
        }
    }
}
