//! Integration of any model, many candidates at once.
