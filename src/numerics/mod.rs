//! Random streams, statistics, interpolation and linear algebra.
