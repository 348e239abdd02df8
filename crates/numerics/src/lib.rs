//! Random streams, statistics, normal distributions, interpolation, linear algebra, rows of numbers
//! side by side, and the [reading](parsing) of what is submitted.

pub mod chain;
pub mod convergence;
pub mod digits;
pub mod dimension;
pub mod eigenvalues;
mod elementary;
pub mod inequalities;
pub mod interpolation;
pub mod json;
pub mod lanes;
pub mod least_squares;
pub mod normal;
pub mod parsing;
pub mod rng;
pub mod singular_values;
pub mod statistics;
pub mod symmetric;
pub mod width;
