//! The language of model documents: from the text of an expression to a graph of operations.
//!
//! [`token`] cuts a text into words, [`syntax`] makes a tree of them, [`unit`] says what units its
//! parts have, and [`graph`] holds what is computed, each part once, as [`operation`]s. [`mathml`]
//! shows an equation to people, with [`name`]s as they are written by hand.

pub mod function;
pub mod graph;
pub mod mathml;
mod name;
pub mod operation;
pub mod syntax;
pub mod token;
pub mod unit;
