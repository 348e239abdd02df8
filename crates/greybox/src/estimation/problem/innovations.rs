//! The innovations that are compared where disturbances move the plant.

/// The errors of what was expected of each output from all samples before, and their variances.
#[derive(Clone, Debug, PartialEq)]
pub struct Innovations {
    /// How many outputs the model has; the variance of each stands so many places behind it.
    pub n_outputs: usize,
    /// The outputs, by their places in the model's description, that show what a controller computed: what was
    /// recorded of them has acted.
    pub recorded: Vec<usize>,
    /// For each compared output the least variance that its sensor can have.
    pub least_variances: Vec<f64>,
    /// The places of the coordinates that are the logarithm of how large a noise is: strengths of disturbances and
    /// standard deviations of sensors.
    pub sizes: Vec<usize>,
}
