//! Plants whose equations are written in Rust.

use super::equations::{Equations, HeldQuantities, Sample, Shares, System};
use super::{Accuracy, BlockSimulator, CandidateBlock, DrivingInputs, Plant, block};
use greybox_numerics::lanes::{Real, RealArray};

/// A plant: ordinary differential equations driven by sampled inputs.
///
/// At a sample the inputs become *held* quantities, which act until the next sample, delayed by
/// [`Dynamics::input_delay`]. All values SI.
pub trait Dynamics: Send + Sync + 'static {
    /// The states, in the order of the model's description.
    type State<R: Real>: RealArray<R>;
    /// What is held over a sample, e.g. the valve command.
    type Held<R: Real>: RealArray<R>;
    /// What follows from a candidate's parameters alone.
    type Constants<R: Real>: Copy + Send + Sync;

    /// Derives the constants from the parameters, in the order of the model's description.
    fn constants<R: Real>(&self, parameters: &[R]) -> Self::Constants<R>;

    /// The state at the first sample where the job does not say otherwise.
    fn initial_state<R: Real>(&self, constants: &Self::Constants<R>) -> Self::State<R>;

    /// What a sample's inputs become.
    fn hold<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        sample: &Sample<'_>,
        state: &Self::State<R>,
    ) -> Self::Held<R>;

    /// The state's rate of change.
    fn derivative<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        held: &Self::Held<R>,
        state: &Self::State<R>,
    ) -> Self::State<R>;

    /// Writes the outputs, in the order of the model's description.
    fn outputs<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        state: &Self::State<R>,
        outputs: &mut [R],
    );

    /// How long the held quantities take to act `[s]`; none where the plant has no delay.
    fn input_delay<R: Real>(&self, _constants: &Self::Constants<R>) -> Option<R> {
        None
    }

    /// The size that an error of each state is measured against: a step may err by
    /// [`Accuracy::tolerance`] times this.
    fn sizes<R: Real>(&self, constants: &Self::Constants<R>) -> Self::State<R>;

    /// A rate that grows with the work that a candidate takes [1/s]. Candidates of like work go
    /// side by side; nothing else depends on it.
    fn work_rate(&self, _constants: &Self::Constants<f64>) -> f64 {
        0.0
    }

    /// At least 0 where the equations hold at this state; a candidate that leaves the range has
    /// failed.
    fn validity<R: Real>(&self, _constants: &Self::Constants<R>, _state: &Self::State<R>) -> R {
        R::splat(0.0)
    }
}

/// Dynamics with the number of outputs of their model's description.
#[derive(Clone, Copy, Debug)]
pub struct Native<D> {
    /// The equations.
    pub dynamics: D,
    /// How many outputs they have.
    pub n_outputs: usize,
}

impl<D: Dynamics> Plant for Native<D> {
    fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    fn work_rate(&self, parameters: &[f64]) -> f64 {
        self.dynamics
            .work_rate(&self.dynamics.constants(parameters))
    }

    fn block_sizes(&self, accuracy: Accuracy) -> &'static [usize] {
        block::sizes(accuracy)
    }

    fn simulator<'a>(
        &'a self,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
    ) -> Box<dyn BlockSimulator + 'a> {
        block::simulator(self, excitation, candidates)
    }
}

impl<D: Dynamics> System for Native<D> {
    const HAS_SMALL_BLOCKS: bool = true;
    type Row<'a, R: Real> = NativeRow<'a, D, R>;

    fn row<R: Real>(&self, parameters: &[R], _sample_time: f64) -> NativeRow<'_, D, R> {
        NativeRow {
            dynamics: &self.dynamics,
            constants: self.dynamics.constants(parameters),
            held: D::Held::zeros(),
        }
    }
}

/// The equations of a row of candidates.
pub struct NativeRow<'a, D: Dynamics, R: Real> {
    dynamics: &'a D,
    constants: D::Constants<R>,
    held: D::Held<R>,
}

/// The change of a state that a derivative by differences is taken with, as a share of the larger
/// of the state and its size: half the digits.
const SHARE: f64 = 1e-8;

impl<D: Dynamics, R: Real> NativeRow<'_, D, R> {
    /// The states with one of them moved a little, and by how much.
    #[inline(always)]
    fn shifted(&self, states: &D::State<R>, column: usize) -> (D::State<R>, R) {
        let sizes = self.dynamics.sizes(&self.constants);
        let state = states.as_ref()[column];
        let size = state.abs().max(sizes.as_ref()[column]);
        let mut shifted = *states;
        let moved = state + size * R::splat(SHARE);
        shifted.as_mut()[column] = moved;
        (shifted, moved - state)
    }
}

impl<D: Dynamics, R: Real> Equations<R> for NativeRow<'_, D, R> {
    type States = D::State<R>;
    const SIZES_ARE_FIXED: bool = true;

    fn initial_states(&self) -> D::State<R> {
        self.dynamics.initial_state(&self.constants)
    }

    fn sizes(&self) -> D::State<R> {
        self.dynamics.sizes(&self.constants)
    }

    fn input_delay(&self) -> Option<R> {
        self.dynamics.input_delay(&self.constants)
    }

    /// The sizes of the states are chosen with the method.
    fn shares(&self) -> Shares {
        Shares {
            fourth: 1.0,
            eighth: 1.0,
        }
    }

    fn n_held(&self) -> usize {
        self.held.as_ref().len()
    }

    #[inline(always)]
    fn hold(&mut self, sample: &Sample<'_>, states: &D::State<R>, held: &mut HeldQuantities<R>) {
        let now = self.dynamics.hold(&self.constants, sample, states);
        held.values.copy_from_slice(now.as_ref());
    }

    #[inline(always)]
    fn act(&mut self, held: &HeldQuantities<R>) {
        self.held.as_mut().copy_from_slice(&held.values);
    }

    #[inline(always)]
    fn rates(&mut self, states: &D::State<R>, _elapsed: R, rates: &mut D::State<R>) {
        *rates = self
            .dynamics
            .derivative(&self.constants, &self.held, states);
    }

    #[inline(always)]
    fn jacobian(
        &mut self,
        states: &D::State<R>,
        _elapsed: R,
        rates: &D::State<R>,
        matrix: &mut [R],
    ) {
        let n = states.as_ref().len();
        for column in 0..n {
            let (shifted, by) = self.shifted(states, column);
            let slope = self
                .dynamics
                .derivative(&self.constants, &self.held, &shifted);
            for (row, (after, before)) in slope.as_ref().iter().zip(rates.as_ref()).enumerate() {
                matrix[row * n + column] = (*after - *before) / by;
            }
        }
    }

    fn rates_by_time(&mut self, _by_time: &mut [R]) -> bool {
        false
    }

    #[inline(always)]
    fn outputs(&mut self, states: &D::State<R>, outputs: &mut [R]) {
        self.dynamics.outputs(&self.constants, states, outputs);
    }

    fn output_jacobian(&mut self, states: &D::State<R>, outputs: &[R], matrix: &mut [R]) {
        let n = states.as_ref().len();
        let mut after = vec![R::splat(0.0); outputs.len()];
        for column in 0..n {
            let (shifted, by) = self.shifted(states, column);
            self.dynamics.outputs(&self.constants, &shifted, &mut after);
            for (row, (after, before)) in after.iter().zip(outputs).enumerate() {
                matrix[row * n + column] = (*after - *before) / by;
            }
        }
    }

    #[inline(always)]
    fn validity(&mut self, states: &D::State<R>) -> R {
        self.dynamics.validity(&self.constants, states)
    }
}
