//! The genetic operators.
