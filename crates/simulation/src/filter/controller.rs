//! A controller within the model, which computes quantities from the states once a sample.
//!
//! What the controller has computed is as uncertain as the states that the controller saw. The filter
//! therefore carries the newest values of each quantity as states that stand still between the samples:
//! slot 0 has the value of this sample, slot 1 that of the sample before, and so on until the slot whose
//! value acts on the plant. After the states of a sample are corrected, slot 0 is computed from them with
//! the controller's own derivatives; before the next sample each value moves on by one slot.

use super::covariance::StateCovariance;
use super::transition::Matrix;
use greybox_numerics::lanes::{Lanes, Real};
use std::ops::Range;

/// How what a controller computes reaches the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ControllerLayout {
    /// How many quantities the controller computes.
    pub n_quantities: usize,
    /// How many samples later the quantities act; a part of a sample counts as one.
    pub delay: usize,
}

impl ControllerLayout {
    /// How many values of a quantity are carried: a controller may read the value of the sample before.
    fn n_slots(self) -> usize {
        self.delay.max(1) + 1
    }

    /// How many states the filter has for the controller.
    #[must_use]
    pub fn n_states(self) -> usize {
        self.n_quantities * self.n_slots()
    }

    /// The state of the value that acts, where those of the controller begin with `first`.
    #[must_use]
    pub fn acting(self, first: usize, quantity: usize) -> usize {
        first + quantity * self.n_slots() + self.delay
    }

    /// The state of the value at the sample before, where those of the controller begin with `first`.
    #[must_use]
    pub fn previous(self, first: usize, quantity: usize) -> usize {
        first + quantity * self.n_slots() + 1
    }

    /// The slots of each quantity that the first `kept` hold.
    fn slots(self, first: usize, kept: usize) -> impl Iterator<Item = (usize, Range<usize>)> {
        (0..self.n_quantities).map(move |quantity| {
            let newest = first + quantity * self.n_slots();
            (quantity, newest..newest + kept)
        })
    }
}

/// The controller of each candidate.
pub struct SampledController {
    layout: ControllerLayout,
    /// The first state of the controller.
    first: usize,
    /// Each quantity before the first sample.
    before: Vec<Lanes>,
    /// For each quantity whether its recorded value acts at the sample at hand.
    is_recorded: Vec<bool>,
    /// ∂quantity/∂state over all states, where the quantities were computed last.
    pub by_state: Matrix,
}

impl SampledController {
    /// A controller whose states begin with `first`.
    pub fn new(layout: ControllerLayout, first: usize, before: Vec<Lanes>) -> SampledController {
        let n_states = first + layout.n_states();
        SampledController {
            layout,
            first,
            before,
            is_recorded: vec![false; layout.n_quantities],
            by_state: vec![Lanes::splat(0.0); layout.n_quantities * n_states],
        }
    }

    /// Whether the outputs of a sample follow what the controller computes at that very sample.
    pub fn acts_at_once(&self, sample: usize) -> bool {
        sample == 0 || self.layout.delay == 0
    }

    /// Before the first sample the controller had computed what the model says.
    pub fn begin(&self, states: &mut [Lanes]) {
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
            let kept = match self.is_recorded[quantity] {
                true => kept.min(layout.delay),
                false => kept,
            };
            (quantity, slots.start..slots.start + kept)
        };
        let slots = layout.slots(self.first, kept).map(computed);
        slots.filter(|(_, slots)| !slots.is_empty())
    }

    /// Lets the recorded value of each quantity act, where there is one at the sample.
    pub fn take_recorded(
        &mut self,
        recorded: impl Iterator<Item = (usize, f64)>,
        states: &mut [Lanes],
        covariance: &mut StateCovariance,
    ) {
        let less = states.len() - covariance.states.len();
        for (quantity, value) in recorded {
            self.is_recorded[quantity] = !value.is_nan();
            if self.is_recorded[quantity] {
                let acting = self.layout.acting(self.first, quantity);
                states[acting] = Lanes::splat(value);
                covariance.fix(acting - less);
            }
        }
    }

    /// Puts what the controller has computed at a sample among the states.
    pub fn put(&mut self, quantities: &[Lanes], sample: usize, states: &mut [Lanes]) {
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
                let mut by_quantity = Lanes::splat(0.0);
                for value in &mut row[slots] {
                    by_quantity += std::mem::replace(value, Lanes::splat(0.0));
                }
                *added += by_quantity * by_quantity * self.added_by(quantity, whites);
                let derivatives = &self.by_state[quantity * n_states..][..n_states];
                for (value, derivative) in row.iter_mut().zip(derivatives) {
                    *value += by_quantity * *derivative;
                }
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
                let rows = crossed.chunks_exact(n).zip(&derivatives);
                let mut sums = vec![Lanes::splat(0.0); n];
                for (row, derivative) in rows {
                    for (sum, value) in sums.iter_mut().zip(row) {
                        *sum += *value * *derivative;
                    }
                }
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

/// Makes one state another, in the covariance and in the transition.
fn copy(from: usize, to: usize, covariance: &mut StateCovariance, crossed: Option<&mut Matrix>) {
    covariance.copy(from, to);
    if let Some(crossed) = crossed {
        let n = covariance.states.len();
        crossed.copy_within(from * n..(from + 1) * n, to * n);
    }
}
