//! Identifications as other programs run them: what is known, what is unknown, and a run that
//! comes to an estimate.
//!
//! [`Identification`] says what is asked, [`Run`] works on it. The worker, the command line, the
//! tests and the benchmarks go through the same two types; what a program says is checked by the
//! same reader as what a client submits, so the faults have the same words and the same places.

mod description;
mod experiment;
mod inputs;
mod run;

pub use description::Identification;
pub use experiment::Experiment;
pub use run::{Checkpoint, Part, Run};

use crate::estimation::{CheckpointError, Finding};
use crate::parsing::Fault;
use std::fmt;

/// Why an identification comes to no result.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IdentificationError {
    /// What is asked for cannot be done: all that is wrong with it, with JSON pointers into the
    /// specification.
    #[error("{}", listed(.0))]
    Invalid(Vec<Fault>),
    /// The unknowns can change along what is named here, and the outputs stay as they are.
    #[error("the data do not fix the unknowns: {}", listed(&details(.0)))]
    NotIdentifiable(Vec<Finding>),
    /// No candidate could be simulated over the recordings.
    #[error("no candidate could be simulated over the recordings")]
    NoEstimate,
    /// The checkpoint belongs to another problem.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

fn listed(items: &[impl fmt::Display]) -> String {
    let items: Vec<String> = items.iter().map(ToString::to_string).collect();
    items.join("; ")
}

fn details(findings: &[Finding]) -> Vec<&str> {
    findings
        .iter()
        .map(|finding| finding.detail.as_str())
        .collect()
}

#[cfg(test)]
mod tests;
