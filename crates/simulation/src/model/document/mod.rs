//! Models that users write: equations as text, in a JSON or YAML document.
//!
//! `reading` reads names, units and texts, `compile` puts the expressions of the language
//! (`language`) together to one graph and checks their units, and
//! [`crate::program`] runs them. A document can be slow or wrong but cannot disturb
//! another.

mod calculation;
mod compile;
mod condition;
mod definition;
mod describe;
mod expansion;
mod reading;
mod reference;
mod runnable;

pub use calculation::{Calculation, Quantity};
pub use condition::Condition;
pub use reference::{Referenced, referenced};
pub use runnable::{Read, read};

/// The functions that an expression may call, each with the names of its arguments.
pub fn functions() -> impl Iterator<Item = (&'static str, &'static [&'static str])> {
    let functions = crate::language::function::ALL.into_iter();
    functions.map(|(name, arguments, _)| (name, arguments))
}

#[cfg(test)]
mod tests;
