//! Random streams, statistics, interpolation and linear algebra.

pub mod interpolation;
