//! greybox finds the physical parameters of a plant from recorded data: of a model whose equations
//! are known and some of whose numbers are not. It runs as an HTTP service and as a library.
//!
//! # As a library
//!
//! A [`Recording`] is what was measured, a [`Model`] the equations, an [`Identification`] what is
//! known and what is not; its [`run`](Identification::run) gives an [`Outcome`] with an estimate
//! and a standard error of each unknown, and a verdict that says how far to trust them.
//!
//! ```no_run
//! use greybox::{Identification, Model, Recording};
//! use std::fs::File;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let recording = Recording::from_csv(File::open("rig.csv")?)?;
//! let servo = Model::named("single_rod_servo").expect("it is in the catalogue");
//! let found = Identification::new(&servo, recording)
//!     .free("mass", 20.0..=120.0)
//!     .fix("supply_pressure", 7e6)
//!     .noise("position", 2e-5)
//!     .seed(1)
//!     .run()?;
//! for parameter in &found.parameters {
//!     let known = &parameter.estimate;
//!     println!("{}: {} ± {:?}", parameter.name, known.estimate, known.standard_error);
//! }
//! println!("trust: {:?}", found.verdict.trust);
//! # Ok(())
//! # }
//! ```
//!
//! Where to go on:
//!
//! - several recordings, windows, initial states: [`Experiment`];
//! - equations of one's own, as text: [`Model::from_text`]; in Rust: [`model`];
//! - looking on, stopping, saving and resuming: [`Run`] and [`estimation::Observer`];
//! - the settings of the search: [`estimation::Settings`]; of the intervals:
//!   [`uncertainty::Settings`];
//! - what an outcome says: [`job::outcome`].
//!
//! The method is synchronous and seeded, reads neither clock nor files, and gives the same bits
//! for the same recording, specification and seed on any number of threads.
//!
//! # As a service
//!
//! A job travels through these modules in the order in which they are declared:
//!
//! ```text
//! client ─HTTP→ api ─JobSpec→ store ──queue→ worker → identification ─Problem→ estimation
//!                                              │        one generation after another
//!                             simulation(model) → credit → genetic ─┘   then refine → uncertainty
//! client ←SSE── api ←── event hub ←── store(events) ←── worker ←── observer
//! ```
//!
//! Two halves meet in [`worker`]: the *service* (async, I/O) above it and the *method*
//! (synchronous, seeded, no I/O, no clock, no environment) below it. Who may import whom is a
//! table in `tests/architecture.rs`, and a test.

pub mod cli;

pub mod app;

pub mod config;

pub mod api;

pub mod access;

pub mod dashboard;

pub mod report;

pub mod job;

pub mod store;

pub mod delivery;

pub mod event;

pub mod span;

pub mod monitor;

pub mod worker;

pub mod identification;

pub mod estimation;

pub mod credit;

pub mod genetic;

pub mod uncertainty;

pub mod demo;

pub mod model;

pub mod simulation;

pub(crate) mod language;

pub mod intake;

pub mod recording;

pub mod parsing;

pub mod numerics;

pub use identification::{Experiment, Identification, IdentificationError, Run};
pub use job::Outcome;
pub use model::Model;
pub use recording::Recording;
