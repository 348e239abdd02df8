//! Identifications as other programs run them: what is known, what is unknown, and a run that
//! comes to an estimate.
//!
//! [`Identification`] says what is asked, [`Run`] works on it. The worker, the command line, the
//! tests and the benchmarks go through the same two types; what a program says is checked by the
//! same reader as what a client submits, so the faults have the same words and the same places.

mod advice;
pub mod assemble;
pub mod budget;
mod checkpoint;
mod description;
pub mod design;
mod error;
mod experiment;
pub mod id;
mod next_steps;
pub mod outcome;
mod run;
pub mod selection;
pub mod simulation;
pub mod spec;
mod tried;

pub use checkpoint::{Checkpoint, Part};
pub use description::Identification;
pub use error::IdentificationError;
pub use experiment::Experiment;
pub use id::{DatasetId, InvalidId, JobId};
pub use outcome::Outcome;
pub use run::Run;
pub use spec::JobSpec;

#[cfg(test)]
mod tests;
