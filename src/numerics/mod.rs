//! Random streams, statistics, interpolation and linear algebra.

pub mod dimension;
pub mod interpolation;
pub mod least_squares;
pub mod rng;
pub mod singular_values;
pub mod statistics;
pub mod symmetric;
