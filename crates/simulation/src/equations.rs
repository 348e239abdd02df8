//! What the integrator asks of a plant: its equations over a row of candidates.
//!
//! A row is one number for each candidate of a block, side by side ([`Real`]). A model written in
//! Rust ([`super::native`]) and the program of a document ([`super::program`]) are the two kinds.

use greybox_numerics::lanes::Real;

/// A row for each state of a plant.
pub trait States<R>: Clone + Send + AsRef<[R]> + AsMut<[R]> + 'static {}

impl<R, S: Clone + Send + AsRef<[R]> + AsMut<[R]> + 'static> States<R> for S {}

/// A plant as the source of equations over rows of any kind and precision.
pub trait System: Send + Sync {
    /// Whether small blocks are compiled too: then large ones are only where registers are wide.
    const HAS_SMALL_BLOCKS: bool;
    /// The equations of the plant over a row.
    type Row<'a, R: Real>: Equations<R>
    where
        Self: 'a;
    /// The equations of candidates whose parameters stand side by side: a row for each parameter,
    /// in the order of the model's description. `sample_time` is that of the recording `[s]`.
    fn row<R: Real>(&self, parameters: &[R], sample_time: f64) -> Self::Row<'_, R>;
}

/// Ordinary differential equations of a row of candidates, driven by sampled inputs.
///
/// Time runs from sample to sample. At each sample the inputs become *held* quantities (a
/// controller that runs once a sample stands here), which act, delayed by
/// [`Equations::input_delay`], until those of the next sample do. All values SI.
pub trait Equations<R: Real>: Send {
    /// A row for each state, in the order of the model's description.
    type States: States<R>;
    /// Whether errors are measured against [`Equations::sizes`] alone, however large a state is.
    const SIZES_ARE_FIXED: bool;
    /// Whether a method of eighth order may be worth its twelve derivatives a step.
    const MAY_BE_SMOOTH: bool = false;

    /// The states at the first sample where the job does not say otherwise.
    fn initial_states(&self) -> Self::States;
    /// The smallest size of each state that an error is measured against.
    fn sizes(&self) -> Self::States;
    /// How long the held quantities take to act `[s]`.
    fn input_delay(&self) -> Option<R>;
    /// What the steps of the explicit methods may err.
    fn shares(&self) -> Shares;
    /// How many quantities are held.
    fn n_held(&self) -> usize;
    /// What the inputs of a sample become.
    fn hold(&mut self, sample: &Sample<'_>, states: &Self::States, held: &mut HeldQuantities<R>);
    /// Lets held quantities act from now on.
    fn act(&mut self, held: &HeldQuantities<R>);
    /// The rates of change, `elapsed` after the held quantities began to act `[s]`.
    fn rates(&mut self, states: &Self::States, elapsed: R, rates: &mut Self::States);
    /// ∂rate/∂state where the rates are `rates`: `matrix[rate · n + state]`.
    fn jacobian(
        &mut self,
        states: &Self::States,
        elapsed: R,
        rates: &Self::States,
        matrix: &mut [R],
    );
    /// ∂rate/∂t where the Jacobian was taken last: nothing where held quantities stand still.
    fn rates_by_time(&mut self, by_time: &mut [R]) -> bool;
    /// The outputs, in the order of the model's description.
    fn outputs(&mut self, states: &Self::States, outputs: &mut [R]);
    /// ∂output/∂state where the outputs are `outputs`: `matrix[output · n + state]`.
    fn output_jacobian(&mut self, states: &Self::States, outputs: &[R], matrix: &mut [R]);
    /// At least 0 where the equations hold at the states whose outputs were taken last.
    fn validity(&mut self, states: &Self::States) -> R;
}

/// The share of the tolerance that a step of an explicit method may err.
#[derive(Clone, Copy, Debug)]
pub struct Shares {
    /// The share for the method of fourth order.
    pub fourth: f64,
    /// The share for the method of eighth order.
    pub eighth: f64,
}

/// The inputs at one sample and at the next, and the time between them.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Which of the model's input sets the values belong to.
    pub input_set: usize,
    /// The samples of each input of the set, SI.
    pub inputs: &'a [Vec<f64>],
    /// Which sample.
    pub index: usize,
    /// The time to the next sample `[s]`; 0 at the last.
    pub interval: f64,
}

impl Sample<'_> {
    /// An input at this sample.
    #[inline(always)]
    #[must_use]
    pub fn input(&self, input: usize) -> f64 {
        self.inputs[input][self.index]
    }

    /// How fast an input moves to its value at the next sample [unit/s].
    #[must_use]
    pub fn slope(&self, input: usize) -> f64 {
        let values = &self.inputs[input];
        match values.get(self.index + 1) {
            Some(next) if self.interval > 0.0 => (next - values[self.index]) / self.interval,
            _ => 0.0,
        }
    }
}

/// What acts on the plant over a stretch of time.
#[derive(Clone, Debug)]
pub struct HeldQuantities<R> {
    /// The quantities as the stretch begins.
    pub values: Vec<R>,
    /// How fast the first of them move [1/s]; empty where all stand still.
    pub slopes: Vec<R>,
}

impl<R> Default for HeldQuantities<R> {
    fn default() -> HeldQuantities<R> {
        HeldQuantities {
            values: Vec::new(),
            slopes: Vec::new(),
        }
    }
}

impl<R: Real> HeldQuantities<R> {
    /// Takes over one candidate's quantities as they stand `seconds` later.
    pub fn set_lane(&mut self, lane: usize, source: &HeldQuantities<R>, seconds: f64) {
        for (value, held) in self.values.iter_mut().zip(&source.values) {
            value.set_lane(lane, held.lane(lane));
        }
        let moving = self.slopes.iter_mut().zip(&source.slopes);
        for ((slope, held), value) in moving.zip(&mut self.values) {
            slope.set_lane(lane, held.lane(lane));
            value.set_lane(lane, value.lane(lane) + held.lane(lane) * seconds);
        }
    }

    /// The quantities as they stand so many seconds later.
    pub fn go_on(&mut self, seconds: R) {
        for (value, slope) in self.values.iter_mut().zip(&self.slopes) {
            *value += *slope * seconds;
        }
    }

    /// The held quantities, standing still.
    #[must_use]
    pub fn standing(&self) -> HeldQuantities<R> {
        HeldQuantities {
            values: self.values.clone(),
            slopes: vec![R::splat(0.0); self.slopes.len()],
        }
    }

    /// The candidates from `first` on as a row of another kind; lanes left over repeat the first.
    #[must_use]
    pub fn lanes_from<S: Real>(&self, first: usize) -> HeldQuantities<S> {
        let rows = |rows: &[R]| rows.iter().map(|row| lanes_from(row, first)).collect();
        HeldQuantities {
            values: rows(&self.values),
            slopes: rows(&self.slopes),
        }
    }
}

/// The lanes of a row from `first` on as a row of another kind; lanes left over repeat the first.
#[inline]
pub fn lanes_from<R: Real, S: Real>(row: &R, first: usize) -> S {
    let mut lanes = S::splat(row.lane(0));
    for lane in 0..S::WIDTH.min(R::WIDTH - first) {
        lanes.set_lane(lane, row.lane(first + lane));
    }
    lanes
}
