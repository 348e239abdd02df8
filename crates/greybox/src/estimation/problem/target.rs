//! Which number of the plant is unknown, or taken as known.

/// What a coordinate stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// A parameter that all experiments share but those with a value of their own, by its place
    /// in the model's description.
    Parameter(usize),
    /// A parameter of one experiment, both by their places.
    ExperimentParameter {
        /// The experiment.
        experiment: usize,
        /// The parameter.
        parameter: usize,
    },
    /// A state at the first sample of an experiment, both by their places.
    InitialState {
        /// The experiment.
        experiment: usize,
        /// The state.
        state: usize,
    },
}

impl Target {
    /// The experiment that the unknown belongs to; none: all experiments.
    #[must_use]
    pub fn experiment(self) -> Option<usize> {
        match self {
            Target::Parameter(_) => None,
            Target::ExperimentParameter { experiment, .. }
            | Target::InitialState { experiment, .. } => Some(experiment),
        }
    }
}
