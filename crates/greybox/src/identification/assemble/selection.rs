//! A selection: from a finished job and the windows of a stream to those that fix the job's parameters.
//!
//! A window is scored from what drives the plant in it and from what the model answers at the job's estimate. Of the
//! measured outputs only their instants and where the states start are taken: a window whose noise looks like what was
//! wanted is chosen no more often than another.

mod answer;
mod selecting;
mod window;

pub use selecting::Selecting;
pub use window::{HistoryWindow, LookedWindow, SelectedSpan};

#[cfg(test)]
mod tests;
