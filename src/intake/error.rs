//! What can be wrong with a recording, and where.
//!
//! Reading goes on after a fault so that all of them (up to [`MAX_FAULTS`]) are reported at once.

use serde::Serialize;
use std::fmt;
use std::io;

/// The most faults that one reading reports; it stops at the last of them.
pub const MAX_FAULTS: usize = 20;

/// One thing wrong with a recording.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// The place as a JSON pointer, in a recording that is JSON.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pointer: Option<String>,
    /// The line, from 1, in a recording that is CSV and in text that is not JSON.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<u64>,
    /// The column: its name in CSV, the number of the character in text that is not JSON.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub column: Option<String>,
    /// The kind of fault, e.g. `not_a_number`.
    pub code: &'static str,
    /// A sentence that names the place too.
    pub detail: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.detail)
    }
}

/// Why a recording could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The source broke off or its limit was exceeded.
    #[error("the recording could not be read to its end: {0}")]
    Io(#[from] io::Error),
    /// The samples could not be put aside, which is not the source's fault.
    #[error("the samples of the recording could not be put aside: {0}")]
    Scratch(io::Error),
    /// The text is not CSV or not JSON.
    #[error("the recording is malformed: {}", sentences(.0))]
    Malformed(Vec<Fault>),
    /// The text was understood, and what it says is wrong.
    #[error("the recording is wrong: {}", sentences(.0))]
    Invalid(Vec<Fault>),
}

impl ReadError {
    /// What is wrong, in the order of the text; empty when the source itself failed.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        match self {
            Self::Io(_) | Self::Scratch(_) => &[],
            Self::Malformed(faults) | Self::Invalid(faults) => faults,
        }
    }
}

fn sentences(faults: &[Fault]) -> String {
    let details: Vec<&str> = faults.iter().map(|fault| fault.detail.as_str()).collect();
    details.join("; ")
}

/// The faults met so far.
#[derive(Debug, Default)]
pub(super) struct Faults {
    kept: Vec<Fault>,
    malformed: bool,
}

impl Faults {
    /// Keeps a fault in what the text says.
    pub(super) fn invalid(&mut self, fault: Fault) {
        if !self.full() {
            self.kept.push(fault);
        }
    }

    /// Keeps a fault in the form of the text.
    pub(super) fn malformed(&mut self, fault: Fault) {
        self.malformed = true;
        self.invalid(fault);
    }

    /// Whether reading on is pointless because no more faults are kept.
    pub(super) fn full(&self) -> bool {
        self.kept.len() >= MAX_FAULTS
    }

    pub(super) fn is_empty(&self) -> bool {
        self.kept.is_empty()
    }

    /// An error when there are faults.
    pub(super) fn result(self) -> Result<(), ReadError> {
        if self.kept.is_empty() {
            Ok(())
        } else if self.malformed {
            Err(ReadError::Malformed(self.kept))
        } else {
            Err(ReadError::Invalid(self.kept))
        }
    }
}
