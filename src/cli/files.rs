//! Reading and writing the files that commands are given.

use super::error::CommandError;
use super::reading::{self, Reading};
use greybox::intake;
use greybox::model::{Catalogue, Model, document as model_document};
use greybox::parsing::{json, yaml};
use greybox::recording::Recording;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use std::sync::Arc;

/// A recording of any format that the service takes.
pub fn recording(path: &Path, reading: &Reading) -> Result<Recording, CommandError> {
    let file = File::open(path).map_err(|error| unreadable(path, &error))?;
    parsed(path, file, reading)
}

/// A recording with the digest of its bytes; that of standard input where the path is `-`.
pub fn recorded(path: &Path, reading: &Reading) -> Result<(Recording, String), CommandError> {
    let mut bytes = Vec::new();
    let read = if path == Path::new("-") {
        std::io::stdin().lock().read_to_end(&mut bytes)
    } else {
        File::open(path).and_then(|mut file| file.read_to_end(&mut bytes))
    };
    read.map_err(|error| unreadable(path, &error))?;
    let digits = hex::encode(Sha256::digest(&bytes));
    let recording = parsed(path, &bytes[..], reading)?;
    Ok((recording, format!("sha256:{digits}")))
}

fn parsed(path: &Path, text: impl Read, reading: &Reading) -> Result<Recording, CommandError> {
    let kind = match ends_with(path, &["json"]) {
        true => intake::MediaKind::Json,
        false => intake::MediaKind::Text,
    };
    let read = intake::read(text, kind, &reading.options()?);
    read.map_err(|error| match &reading::faults(path, &error)[..] {
        [] => unreadable(path, &error),
        faults => CommandError::inputs(faults.iter().cloned()),
    })
}

/// A document, read as strictly as the service reads it: YAML where the name ends so, else JSON.
pub fn document(path: &Path) -> Result<Value, CommandError> {
    let text = std::fs::read(path).map_err(|error| unreadable(path, &error))?;
    if !ends_with(path, &["yaml", "yml"]) {
        return json::parse(&text).map_err(|error| unreadable(path, &error));
    }
    let text = std::str::from_utf8(&text).map_err(|error| unreadable(path, &error))?;
    yaml::parse(text).map_err(|error| unreadable(path, &error))
}

fn ends_with(path: &Path, extensions: &[&str]) -> bool {
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension.is_some_and(|extension| extensions.contains(&extension))
}

/// The model of `--model`: a name of the catalogue, or the file of a document. Warnings of the document are
/// printed.
pub fn model(name: &str) -> Result<Arc<Model>, CommandError> {
    let path = Path::new(name);
    if ends_with(path, &["json", "yaml", "yml"]) {
        let document = document(path)?;
        let read = model_document::referenced(&document);
        let read = read.map_err(|faults| CommandError::faults(name, &faults))?;
        for warning in &read.warnings {
            eprintln!("note: {name}: {warning}");
        }
        return Ok(read.model);
    }
    Model::named(name).ok_or_else(|| {
        let models = Catalogue::built_in();
        let names: Vec<&str> = models
            .iter()
            .map(|model| &*model.description().name)
            .collect();
        CommandError::input(format!(
            "--model {name}: the models are {}, or the file of a document (.json, .yaml)",
            names.join(", ")
        ))
    })
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
