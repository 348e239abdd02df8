//! What is submitted, of any kind: JSON or YAML text to a value, a value to types, and what is wrong.
//!
//! Reading never stops at the first fault: all of them come back at once, each with its place.

pub mod fault;
pub mod json;
pub mod reader;
pub mod settings;
pub mod yaml;

pub use fault::Fault;
