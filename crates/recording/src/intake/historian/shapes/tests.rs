//! Documents of services, each with the values that it has, and documents that may be read in two ways.

mod doubts;
mod services;
mod tables;

use crate::intake::{self, MediaKind, Options, ReadError};
use crate::{Recording, TimeAxis};

/// Reads a document with options, each written as `name=text`.
fn read_with(text: &str, given: &[&str]) -> Result<Recording, ReadError> {
    let mut options = Options::default();
    for option in given {
        let (name, text) = option.split_once('=').unwrap();
        match name {
            "time" => options.time = Some(text.to_owned()),
            name => options.set(name, text).unwrap(),
        }
    }
    intake::read(text.as_bytes(), MediaKind::Json, &options)
}

fn read(text: &str) -> Recording {
    read_with(text, &[]).unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// The code of the first fault of a document, and its sentence.
fn fault(text: &str, given: &[&str]) -> (String, String) {
    let error = match read_with(text, given) {
        Ok(recording) => panic!("{text} was read: {:?}", recording.signals),
        Err(error) => error,
    };
    let fault = error.faults().first().unwrap();
    (fault.code.to_string(), fault.detail.to_string())
}

/// The names of the signals with their values.
fn signals(recording: &Recording) -> Vec<(&str, &[f64])> {
    let signals = recording.signals.iter();
    signals
        .map(|signal| (&*signal.name, &*signal.values))
        .collect()
}

fn codes(recording: &Recording) -> Vec<&str> {
    recording.notes.iter().map(|note| &*note.code).collect()
}

/// Checks that a document has samples of 08:15:00, 08:15:01 and 08:15:02 of 2 March 2026 alone.
fn check(text: &str, expected: &[(&str, &[f64])]) -> Recording {
    let recording = read(text);
    check_times(&recording, text);
    assert_eq!(signals(&recording), expected, "{text}");
    recording
}

fn check_times(recording: &Recording, text: &str) {
    let start = recording.start.map(|start| start.to_string());
    assert_eq!(start.as_deref(), Some("2026-03-02T08:15:00Z"), "{text}");
    let axis = TimeAxis::Uniform {
        sample_time: 1.0,
        samples: 3,
    };
    assert_eq!(recording.time, axis, "{text}");
}
