//! The genetic operators of the paper's section 3.2, on strings of Gray-coded parameters.
//!
//! [`encoding`] turns positions between bounds into genes and back; [`operators`] select by
//! credit, cross, mutate. All of them draw from streams given by the caller, in a fixed order.

pub mod differential;
pub mod encoding;
pub mod operators;

pub use encoding::{Chromosome, Encoding};
