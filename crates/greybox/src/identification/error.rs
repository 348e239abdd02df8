//! Why identifications come to no result.

use crate::estimation::{CheckpointError, Finding};
use greybox_numerics::parsing::Fault;
use std::fmt;

/// Why an identification comes to no result.
#[derive(Debug, thiserror::Error)]
pub enum IdentificationError {
    /// The request cannot be done: everything that is wrong with it, with JSON pointers into the
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
