//! A controller within the model, which computes quantities from the states once a sample.
//!
//! What the controller has computed is as uncertain as the states that the controller saw. The filter
//! therefore carries the newest values of each quantity as states that stand still between the samples:
//! slot 0 has the value of this sample, slot 1 that of the sample before, and so on until the slot whose
//! value acts on the plant. After the states of a sample are corrected, slot 0 is computed from them with
//! the controller's own derivatives; before the next sample each value moves on by one slot.

use super::covariance::StateCovariance;
use super::layout::FilterLayout;
use super::transition::Matrix;
use crate::block::SimulationBlock;
use crate::program::{ControllerLayout, Program};
use greybox_numerics::lanes::{LANES, Lanes, Real};
use std::ops::Range;

/// The means of candidates on their way through a record.
type ControlledBlock<'a> = SimulationBlock<'a, Program, f64, LANES>;

/// The controller of each candidate.
pub struct SampledController {
    layout: ControllerLayout,
    /// The first state of the controller.
    first: usize,
    /// Each quantity before the first sample.
    before: Vec<Lanes>,
    /// For each quantity the recorded value that acts at the sample at hand; NaN where there is none.
    recorded: Vec<f64>,
    /// ∂quantity/∂state over all states, where the quantities were computed last.
    by_state: Matrix,
}

impl SampledController {
    /// A controller whose states begin with `first`.
    pub fn new(layout: ControllerLayout, first: usize, before: Vec<Lanes>) -> SampledController {
        let n_states = first + layout.n_states();
        SampledController {
            layout,
            first,
            before,
            recorded: vec![f64::NAN; layout.n_quantities],
            by_state: vec![Lanes::splat(0.0); layout.n_quantities * n_states],
        }
    }

    /// Whether the outputs of a sample follow what the controller computes at that very sample.
    pub fn acts_at_once(&self, sample: usize) -> bool {
        sample == 0 || self.layout.delay == 0
    }

    /// Before the first sample the controller had computed what the model says.
    fn begin(&self, states: &mut [Lanes]) {
        for (quantity, before) in self.before.iter().enumerate() {
            states[self.layout.previous(self.first, quantity)] = *before;
        }
    }

    /// The slots that a value computed at a sample fills: before the record the plant saw the first value, and
    /// where what acts was recorded no computed value acts.
    fn filled(&self, sample: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
        let layout = self.layout;
        let kept = match sample {
            0 => layout.n_slots(),
            _ => 1,
        };
        let computed = move |(quantity, slots): (usize, Range<usize>)| {
            let kept = match self.recorded[quantity].is_nan() {
                true => kept,
                false => kept.min(layout.delay),
            };
            (quantity, slots.start..slots.start + kept)
        };
        let slots = layout.slots(self.first, kept).map(computed);
        slots.filter(|(_, slots)| !slots.is_empty())
    }

    /// At the beginning of a sample recorded values act, and the controller computes where the outputs of that sample
    /// follow it.
    #[inline(always)]
    pub fn begin_sample(
        &mut self,
        block: &mut ControlledBlock<'_>,
        layout: &FilterLayout,
        covariance: &mut StateCovariance,
    ) {
        let states = &mut block.integrator.states;
        let less = states.len() - covariance.states.len();
        let measured = &block.excitation.inputs[layout.n_inputs..];
        for shown in &layout.recorded {
            let value = measured[shown.output][block.sample];
            self.recorded[shown.quantity] = value;
            if !value.is_nan() {
                let acting = self.layout.acting(self.first, shown.quantity);
                states[acting] = Lanes::splat(value);
                covariance.fix(acting - less);
            }
        }
        if self.acts_at_once(block.sample) {
            self.run(block);
        }
    }

    /// Computes what the controller makes of the states as they stand.
    #[inline(always)]
    pub fn run(&mut self, block: &mut ControlledBlock<'_>) {
        let states = &mut block.integrator.states;
        if block.sample == 0 {
            self.begin(states);
        }
        block.equations.sample_again(states);
        block.equations.sampled_jacobian(&mut self.by_state);
        self.put(block.equations.sampled(), block.sample, states);
    }

    /// Puts what the controller has computed at a sample among the states.
    fn put(&mut self, quantities: &[Lanes], sample: usize, states: &mut [Lanes]) {
        let n_states = states.len();
        let filled: Vec<_> = self.filled(sample).collect();
        for (quantity, slots) in filled {
            states[slots].fill(quantities[quantity]);
            if sample == 0 {
                // No slot was filled by an earlier sample.
                let row = &mut self.by_state[quantity * n_states..][..n_states];
                row[self.first..].fill(Lanes::splat(0.0));
            }
        }
        for (quantity, value) in self.recorded.iter().enumerate() {
            if !value.is_nan() {
                states[self.layout.acting(self.first, quantity)] = Lanes::splat(*value);
            }
        }
    }

    /// Lets the derivatives of outputs follow what the controller computes at once from the states. What white
    /// noises add to an output through the controller goes to `added`.
    pub fn follow(
        &self,
        sample: usize,
        whites: &[(usize, Lanes)],
        by_state: &mut [Lanes],
        added: &mut [Lanes],
    ) {
        let n_states = self.first + self.layout.n_states();
        for (row, added) in by_state.chunks_exact_mut(n_states).zip(added) {
            for (quantity, slots) in self.filled(sample) {
                let by_quantity = taken(&mut row[slots]);
                *added += by_quantity * by_quantity * self.added_by(quantity, whites);
                let derivatives = &self.by_state[quantity * n_states..][..n_states];
                add(row, derivatives, by_quantity);
            }
        }
    }

    /// The variance that white noises, each a state with its own variance, add to a quantity.
    fn added_by(&self, quantity: usize, whites: &[(usize, Lanes)]) -> Lanes {
        let n_states = self.first + self.layout.n_states();
        let row = &self.by_state[quantity * n_states..][..n_states];
        let mut added = Lanes::splat(0.0);
        for (state, variance) in whites {
            added += row[*state] * row[*state] * *variance;
        }
        added
    }

    /// Gives what the controller has computed at a sample the errors of the states, in the covariance and
    /// in the transition. `whites` are the states of white noises, each with its variance over the interval.
    pub fn spread(
        &self,
        sample: usize,
        whites: &[(usize, Lanes)],
        covariance: &mut StateCovariance,
        crossed: Option<&mut Matrix>,
    ) {
        let n_states = self.first + self.layout.n_states();
        let n = covariance.states.len();
        let mut crossed = crossed;
        for (quantity, slots) in self.filled(sample) {
            let row = &self.by_state[quantity * n_states..][..n_states];
            let derivatives = covariance.states.iter().map(|state| row[*state]);
            let derivatives: Vec<Lanes> = derivatives.collect();
            let newest = slots.start + n - n_states;
            covariance.replace(newest, &derivatives);
            covariance.matrix[newest * (n + 1)] += self.added_by(quantity, whites);
            if let Some(crossed) = &mut crossed {
                let sums = combined(crossed, &derivatives);
                crossed[newest * n..][..n].copy_from_slice(&sums);
            }
            for slot in newest + 1..newest + slots.len() {
                copy(newest, slot, covariance, crossed.as_deref_mut());
            }
        }
    }

    /// Lets the values that follow the acting ones act, within an interval.
    pub fn act(
        &self,
        states: &mut [Lanes],
        covariance: &mut StateCovariance,
        crossed: Option<&mut Matrix>,
    ) {
        let places = self.layout.delay..self.layout.delay + 1;
        self.move_on(places, states, covariance, crossed);
    }

    /// Lets each value move on by a slot, before the next sample.
    pub fn end_interval(
        &self,
        states: &mut [Lanes],
        covariance: &mut StateCovariance,
        crossed: Option<&mut Matrix>,
    ) {
        let places = 1..self.layout.n_slots();
        self.move_on(places, states, covariance, crossed);
    }

    /// Fills these slots, the last first, each with the value of the slot before it.
    fn move_on(
        &self,
        slots: Range<usize>,
        states: &mut [Lanes],
        covariance: &mut StateCovariance,
        mut crossed: Option<&mut Matrix>,
    ) {
        let less = states.len() - covariance.states.len();
        for (_, of_quantity) in self.layout.slots(self.first, 1) {
            for slot in slots.clone().rev().filter(|slot| *slot > 0) {
                let state = of_quantity.start + slot;
                states[state] = states[state - 1];
                let place = state - less;
                copy(place - 1, place, covariance, crossed.as_deref_mut());
            }
        }
    }
}

/// The sum of derivatives, which become 0.
fn taken(derivatives: &mut [Lanes]) -> Lanes {
    let mut sum = Lanes::splat(0.0);
    for value in derivatives {
        sum += std::mem::replace(value, Lanes::splat(0.0));
    }
    sum
}

/// Adds so many times a row to another.
fn add(sums: &mut [Lanes], row: &[Lanes], times: Lanes) {
    for (sum, value) in sums.iter_mut().zip(row) {
        *sum += *value * times;
    }
}

/// The sum of the rows of a matrix, each so many times.
fn combined(matrix: &Matrix, times: &[Lanes]) -> Vec<Lanes> {
    let n = times.len();
    let mut sums = vec![Lanes::splat(0.0); n];
    for (row, times) in matrix.chunks_exact(n).zip(times) {
        add(&mut sums, row, *times);
    }
    sums
}

/// Makes one state another, in the covariance and in the transition.
fn copy(from: usize, to: usize, covariance: &mut StateCovariance, crossed: Option<&mut Matrix>) {
    covariance.copy(from, to);
    if let Some(crossed) = crossed {
        let n = covariance.states.len();
        crossed.copy_within(from * n..(from + 1) * n, to * n);
    }
}
