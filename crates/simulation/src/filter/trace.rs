//! The columns that a traced filter answers at each sample, for the smoother.

use std::ops::Range;

/// The places of the numbers that a traced filter answers at a sample. The expected outputs and the
/// variances of their errors stand first, as in a filter that is not traced.
#[derive(Clone, Copy, Debug)]
pub(super) struct TraceLayout {
    /// The number of states, those of the disturbances among them.
    pub n_states: usize,
    /// The number of outputs of the model.
    pub n_outputs: usize,
}

impl TraceLayout {
    /// The number of columns.
    pub fn n_columns(self) -> usize {
        self.transition().end
    }

    /// The states before the sample's measurements correct them.
    pub fn mean(self) -> Range<usize> {
        let first = 2 * self.n_outputs;
        first..first + self.n_states
    }

    /// The covariance of the states before the sample's measurements correct it, row by row.
    pub fn covariance(self) -> Range<usize> {
        let first = self.mean().end;
        first..first + self.n_states * self.n_states
    }

    /// c = ∂output/∂state.
    pub fn derivatives(self, output: usize) -> Range<usize> {
        let first = self.covariance().end + 2 * output * self.n_states;
        first..first + self.n_states
    }

    /// Pcᵀ with the covariance P that the outputs before this output have left.
    pub fn gain(self, output: usize) -> Range<usize> {
        let first = self.derivatives(output).end;
        first..first + self.n_states
    }

    /// Φ from the sample to the next, row by row.
    pub fn transition(self) -> Range<usize> {
        let first = self.derivatives(self.n_outputs).start;
        first..first + self.n_states * self.n_states
    }
}
