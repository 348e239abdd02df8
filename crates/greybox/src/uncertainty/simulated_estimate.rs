//! An estimate with its simulation: what intervals and the analysis are made from.

use super::residuals::ResidualReport;
use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use greybox_simulation::single::Outputs;

/// An estimate with its simulation.
#[derive(Clone, Debug)]
pub(super) struct SimulatedEstimate {
    pub problem: Problem,
    pub report: Report,
    /// The simulation at the estimate; empty where it fails.
    pub trajectories: Vec<Outputs>,
    /// For each output what is left unexplained; empty where the simulation fails.
    pub residuals: Vec<ResidualReport>,
}
