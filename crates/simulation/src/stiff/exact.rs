//! Candidates of a row that use the stiff method: eight at once, in double precision whatever the
//! row's is.

use super::{Rosenbrock, StiffOutcome, StiffStep, WideStep};
use crate::equations::{Equations, lanes_from};
use crate::explicit::Sum;
use greybox_numerics::lanes::{Lanes, Real};
use greybox_numerics::width::Width;

/// Eight candidates of a row in double precision, for the stiff method.
pub struct Exact<E: Equations<Lanes>> {
    /// The equations of the candidates.
    pub equations: E,
    rosenbrock: Rosenbrock,
    states: E::States,
    weights: E::States,
    /// Where the step leads.
    pub next: E::States,
    /// The slope where the step leads.
    pub end: E::States,
}

impl<E: Equations<Lanes>> Exact<E> {
    /// Candidates of these equations.
    pub fn new(equations: E) -> Self {
        let states = equations.initial_states();
        Self {
            rosenbrock: Rosenbrock::new(states.as_ref().len()),
            weights: states.clone(),
            next: states.clone(),
            end: states.clone(),
            states,
            equations,
        }
    }

    /// Puts a candidate into the place of another; the equations are those of all.
    pub fn replace(&mut self, lane: usize, equations: E) {
        self.equations = equations;
        self.rosenbrock.begin(lane);
    }

    /// Takes over where the candidates of a row from `first` on are.
    pub fn load<R: Real, S: AsRef<[R]>>(&mut self, from: Sum<'_, S>, weights: &S, first: usize) {
        let sums = from.states.as_ref().iter().zip(from.excess.as_ref());
        for (to, (state, excess)) in self.states.as_mut().iter_mut().zip(sums) {
            *to = lanes_from::<R, Lanes>(state, first) - lanes_from(excess, first);
        }
        for (to, weight) in self.weights.as_mut().iter_mut().zip(weights.as_ref()) {
            *to = lanes_from(weight, first);
        }
    }

    /// A step. Compiled once for rows of every kind.
    #[inline(never)]
    pub fn step(&mut self, width: Width, elapsed: Lanes, length: Lanes) -> StiffOutcome {
        // Candidates that stay get a step all the same, whose outcome nobody reads.
        let length = length.map(|length| if length > 0.0 { length } else { 1.0 });
        width.does(WideStep {
            rosenbrock: &mut self.rosenbrock,
            equations: &mut self.equations,
            step: StiffStep {
                states: &self.states,
                weights: &self.weights,
                elapsed,
                length,
            },
            next: &mut self.next,
            end: &mut self.end,
        })
    }
}
