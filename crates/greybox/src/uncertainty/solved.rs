//! A problem with the estimate that a run came to.

use crate::estimation::problem::Problem;
use crate::estimation::report::Report;

/// A problem, and what the run came to.
#[derive(Clone, Debug)]
pub(super) struct Solved {
    pub problem: Problem,
    pub report: Report,
}
