//! How well the states are known as a record begins.

/// The knowledge of a state at the first sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StartVariance {
    /// The state's variance, in its unit squared; 0 where it is known.
    Known(f64),
    /// What disturbances make in one interval between samples: the start is an unknown of the
    /// estimate (the rule of CTSM, N. R. Kristensen, H. Madsen and S. B. Jørgensen, *Automatica*
    /// 40, 2004).
    OneInterval,
}
