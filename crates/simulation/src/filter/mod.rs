//! The extended Kalman filter of a plant that disturbances move, many candidates at once.
//!
//! Between the samples the mean goes with the plant's own equations, and the covariance with their
//! Jacobian (`transition`); at a sample both are corrected by what was measured (`covariance`).
//! What comes out at each sample, the predicted outputs and the variances of their errors, is what
//! the likelihood of a record is made of (A. H. Jazwinski, *Stochastic Processes and Filtering
//! Theory*, 1970, chapters 7 and 8). A [`FilteredPlant`] is simulated as any other plant is. Where the
//! filter is traced, a [`TracedRecord`] goes back through the record and says what acted when.

mod block;
mod controller;
mod covariance;
mod layout;
mod noises;
mod plant;
mod smoother;
mod start;
mod trace;
mod transition;

pub use layout::FilterLayout;
pub use plant::{FilteredPlant, LayoutFault};
pub use smoother::{SmoothedPath, SmoothedRecord, TracedRecord};
pub use start::StartVariance;
