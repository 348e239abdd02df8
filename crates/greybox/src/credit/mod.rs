//! The incremental credit assignment (ICRA) network: which candidates of a generation explain
//! the data best, judged block after block until an entropy criterion says stop.
//!
//! [`spread`] adjusts how errors turn into credit, [`icra`] is the recursion itself.

pub mod icra;
pub mod spread;

pub use icra::{Credits, Form, assign};
