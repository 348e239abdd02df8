//! Why a recording does not yield an experiment.

/// Why a recording does not yield the experiment that was asked for.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The recording has no signal of that name.
    #[error(
        "`{model_signal}` is mapped to `{dataset_signal}`, which the recording does not have; it has {}",
        available.join(", ")
    )]
    NoSuchSignal {
        /// The model's name of the signal.
        model_signal: String,
        /// The name that was looked for.
        dataset_signal: String,
        /// The names that the recording has.
        available: Vec<String>,
    },
    /// A bound of the window is not a finite number, or the window ends before it begins.
    #[error("the window from {from_s} s to {to_s} s is not an interval")]
    NotAnInterval {
        /// The beginning of the window `[s]`.
        from_s: f64,
        /// The end of the window `[s]`.
        to_s: f64,
    },
    /// Fewer than two samples lie in the window.
    #[error(
        "the window from {from_s} s to {to_s} s holds {samples} samples of a recording of {duration_s} s; at least 2 are needed"
    )]
    EmptyWindow {
        /// The beginning of the window `[s]`.
        from_s: f64,
        /// The end of the window `[s]`.
        to_s: f64,
        /// How many samples lie in the window.
        samples: usize,
        /// How long the recording is `[s]`.
        duration_s: f64,
    },
    /// The gaps of an irregular recording are so long that hardly a sample would be there.
    #[error(
        "on a grid of {sample_time} s, {samples} irregular samples would be spread over {grid_samples}; choose a window without the gaps"
    )]
    TooSparse {
        /// The sample time of the grid `[s]`.
        sample_time: f64,
        /// How many samples there are.
        samples: usize,
        /// How many samples the grid would have.
        grid_samples: usize,
    },
    /// The validation fraction is outside [0, 1) or leaves too little for the estimation.
    #[error(
        "a validation fraction of {fraction} leaves {left} of {samples} samples to estimate from"
    )]
    ValidationFraction {
        /// The fraction asked for.
        fraction: f64,
        /// How many samples it leaves.
        left: usize,
        /// How many samples there are.
        samples: usize,
    },
}
