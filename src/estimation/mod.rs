//! The hybrid neural-genetic search and the refinement of its estimates.
