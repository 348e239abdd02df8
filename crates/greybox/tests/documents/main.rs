//! Models that are documents: against the same models in Rust, against recordings that they made
//! themselves, and against recordings that others measured.

mod bodies;

mod catalogue;

mod hostile;

mod native;

mod published;

mod recordings;

#[path = "../recovery/run.rs"]
mod run;

mod unruly;

use serde_json::Value;

/// A document of the folder `models`.
fn document(name: &str) -> Value {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/documents/models");
    let text = std::fs::read_to_string(format!("{folder}/{name}.json")).expect("a document");
    serde_json::from_str(&text).expect("a document is JSON")
}
