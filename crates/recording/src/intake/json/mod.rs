//! Recordings from JSON, as a stream.
//!
//! ```json
//! {"name": "rig 4, run 3", "sample_time_s": 0.01, "start": "2026-03-02T08:15:00Z",
//!  "signals": {"reference": {"unit": "m", "values": [0.03, 0.03]},
//!              "position": {"unit": "mm", "values": [0.0, null]}}}
//! ```
//!
//! `"time": {"unit": "s", "values": […]}` instead of `sample_time_s` where samples are not uniform.
//! `null` is a missing sample; unknown fields are faults. Memory holds the values (eight bytes
//! each), never a tree of the document.

mod document;
mod node;
mod scalar;
mod tokens;

use super::error::malformed;
use super::{ReadError, ReadingPurpose};
use crate::Recording;
use document::Document;
use greybox_numerics::parsing::json::not_json;
use node::DocumentTarget;
use serde::de::DeserializeSeed;
use serde_json::error::Category;
use std::io::{BufReader, Read};
pub(super) use tokens::{PlainNumbers, ReplacedNumbers, may_have_words};

/// Reads a recording.
///
/// # Errors
/// When the source fails, when the text is not JSON, or with everything that is wrong with the
/// document.
pub fn read(reader: impl Read, purpose: ReadingPurpose) -> Result<Recording, ReadError> {
    let mut document = Document::default();
    let mut text = serde_json::Deserializer::from_reader(BufReader::new(reader));
    DocumentTarget::Document(&mut document)
        .deserialize(&mut text)
        .and_then(|()| text.end())
        .map_err(from_json)?;
    document.into_recording(purpose)
}

pub(super) fn from_json(error: serde_json::Error) -> ReadError {
    if error.classify() == Category::Io {
        return ReadError::Io(error.into());
    }
    malformed(not_json(&error))
}

#[cfg(test)]
mod tests;
