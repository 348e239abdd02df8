//! greybox finds the physical parameters of a plant from recorded data: of a model whose equations
//! are known and some of whose numbers are not.
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
//! let outcome = Identification::new(&servo, recording)
//!     .free("mass", 20.0..=120.0)
//!     .fix("supply_pressure", 7e6)
//!     .noise("position", 2e-5)
//!     .seed(1)
//!     .run()?;
//! for parameter in &outcome.parameters {
//!     let mass = &parameter.estimate;
//!     println!("{}: {} ± {:?}", parameter.name, mass.estimate, mass.standard_error);
//! }
//! println!("trust: {:?}", outcome.verdict.trust);
//! # Ok(())
//! # }
//! ```
//!
//! The method is synchronous and seeded, reads neither clock nor files, and gives the same bits
//! for the same recording, specification and seed on any number of threads.
//!
//! # Where to go on
//!
//! - several recordings, windows, initial states: [`Experiment`];
//! - equations of one's own, as text: [`Model::from_text`]; in Rust: [`model`];
//! - looking on, stopping, saving and resuming: [`Run`] and [`estimation::Observer`];
//! - the settings of the search: [`estimation::Settings`]; of the intervals:
//!   [`uncertainty::Settings`];
//! - what an outcome says: [`identification::outcome`].
//!
//! # The way of a recording
//!
//! 1. Bytes of any format come to [`intake`], which tells the [`Format`](intake::Format).
//! 2. Cells become times, SI values and classes of quality: a
//!    [`ReceivedRecording`](recording::ReceivedRecording).
//! 3. A [`Recording`] holds named signals over one [`TimeAxis`](recording::TimeAxis).
//! 4. [`identification::assemble`] takes the windows that a specification asks for, under the
//!    model's signal names: a [`recording::ExperimentData`].
//! 5. [`estimation::Problem`] cuts the experiments into estimation and validation data.
//!
//! # The way of a specification
//!
//! 1. [`parsing`] makes a value of JSON or YAML.
//! 2. [`identification::spec`] reads the value with all its faults at once: a
//!    [`JobSpec`](identification::JobSpec), whose every number lies in its range. A section of settings
//!    states each field once ([`settings!`]), with the range that the reader keeps.
//! 3. [`identification::assemble`] joins the specification, the [`model`] and the recordings into
//!    an [`estimation::Problem`].
//! 4. [`Run`] searches, one generation after another: [`simulation`] judges a population,
//!    [`credit`] gives each candidate its share, [`genetic`] breeds the next.
//!
//! # The way of a result
//!
//! 1. [`estimation`] refines the champion of the search by least squares.
//! 2. [`uncertainty`] adds intervals, the budget of what was taken as known, residuals and a
//!    verdict.
//! 3. [`identification::assemble`] writes the [`Outcome`]; [`report`] makes a page of it.

pub mod preparation;

pub mod report;

pub mod identification;

pub mod demo;

pub mod uncertainty;

pub mod estimation;

pub mod credit;

pub mod genetic;

pub use greybox_numerics as numerics;
pub use greybox_numerics::parsing;
pub use greybox_numerics::settings;
pub use greybox_recording as recording;
pub use greybox_recording::intake;
pub use greybox_simulation as simulation;
pub use greybox_simulation::model;

pub use identification::{Experiment, Identification, IdentificationError, Outcome, Run};
pub use model::Model;
pub use recording::Recording;
