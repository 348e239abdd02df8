//! The hybrid neural-genetic search and the refinement of its estimates.

pub mod settings;

pub use settings::Settings;
