//! Reading and writing the files that commands are given.

use super::error::CommandError;
use crate::dataset::{self, Recording};
use crate::document::json as document;
use serde_json::Value;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// A recording: JSON where the name ends so, else CSV.
pub fn recording(path: &Path, time: Option<&str>) -> Result<Recording, CommandError> {
    let file = File::open(path).map_err(|error| unreadable(path, &error))?;
    let is_json = path
        .extension()
        .is_some_and(|extension| extension == "json");
    let read = if is_json {
        dataset::json::read(file)
    } else {
        let options = dataset::csv::Options {
            time: time.map(str::to_owned),
            name: None,
        };
        dataset::csv::read(file, &options)
    };
    read.map_err(|error| match error.faults() {
        [] => unreadable(path, &error),
        faults => CommandError::inputs(
            faults
                .iter()
                .map(|fault| format!("{}: {fault}", path.display())),
        ),
    })
}

/// A JSON document, read as strictly as the service reads it.
pub fn document(path: &Path) -> Result<Value, CommandError> {
    let text = std::fs::read(path).map_err(|error| unreadable(path, &error))?;
    document::parse(&text[..]).map_err(|error| unreadable(path, &error))
}

/// Writes to a file, or to standard output.
pub fn write(path: Option<&Path>, bytes: &[u8]) -> Result<(), CommandError> {
    match path {
        Some(path) => std::fs::write(path, bytes)
            .map_err(|error| CommandError::failed(format!("{}: {error}", path.display()))),
        None => match std::io::stdout().write_all(bytes) {
            // Whoever read the output has seen enough of it.
            Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
            written => {
                written.map_err(|error| CommandError::failed(format!("standard output: {error}")))
            }
        },
    }
}

/// A recording as CSV, SI.
pub fn csv(recording: &Recording) -> Vec<u8> {
    let mut text = Vec::new();
    recording
        .write_csv(&mut text)
        .expect("a vector takes all that is written");
    text
}

fn unreadable(path: &Path, error: &dyn std::fmt::Display) -> CommandError {
    CommandError::input(format!("{}: {error}", path.display()))
}
