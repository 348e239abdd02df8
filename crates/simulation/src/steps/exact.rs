//! The candidates of a row that use the stiff method: eight at once, in double precision whatever
//! the row's is.

use super::{
    CALM_STEPS, EXPLICIT_DERIVATIVES, IntegratedStretch, Integrator, MOST_STIFF_LOOKS, NOT_STIFF,
    RowCandidates, StepTrial,
};
use crate::equations::{Equations, System, lanes_from};
use crate::explicit;
use crate::stiff::{self, Rosenbrock, WideStep};
use greybox_numerics::lanes::{LANES, Lanes, Real};
use greybox_numerics::width::Width;

/// Eight candidates of a row in double precision, for the stiff method.
pub(super) struct Exact<E: Equations<Lanes>> {
    equations: E,
    rosenbrock: Rosenbrock,
    states: E::States,
    weights: E::States,
    /// Where a step leads, and the slope there.
    next: E::States,
    end: E::States,
}

impl<'a, P: System, R: Real> Integrator<'a, P, R> {
    /// Whether a candidate that moves uses the explicit method.
    #[inline(never)]
    pub(super) fn has_explicit(&self, stretch: &IntegratedStretch<'_, R>) -> bool {
        let moves = |lane: usize| stretch.remaining.lane(lane) > 0.0;
        (0..R::WIDTH).any(|lane| moves(lane) && !self.is_stiff[lane])
    }

    /// A trial of the candidates that use the stiff method; that of the others stands.
    #[inline(never)]
    pub(super) fn try_stiff(
        &mut self,
        stretch: &mut IntegratedStretch<'_, R>,
        trial: &mut StepTrial<R>,
    ) {
        let remaining = stretch.remaining;
        let moves = |lane: &usize| remaining.lane(*lane) > 0.0;
        self.prepare_exact(stretch);
        let mut exact = std::mem::take(&mut self.exact);
        for (group, exact) in exact.iter_mut().enumerate() {
            let first = group * LANES;
            let lanes = first..R::WIDTH.min(first + LANES);
            let members: Vec<usize> = lanes
                .filter(|lane| self.is_stiff[*lane] && moves(lane))
                .collect();
            if members.is_empty() {
                continue;
            }
            exact.load(self, first);
            let taken = lanes_from(&trial.taken, first);
            let taken = exact.step(self.source.width, lanes_from(&trial.elapsed, first), taken);
            for lane in members {
                let place = lane - first;
                self.stages.set_end(lane, &exact.next, &exact.end, place);
                let error = taken.squared_error.lane(place);
                trial.squared_error.set_lane(lane, error);
                self.note_stiff_step(lane, taken.rate_times_length.lane(place));
            }
        }
        self.exact = exact;
        self.has_stiff = self.is_stiff.contains(&true);
    }

    /// Leaves the stiff method after steps that another could have taken.
    fn note_stiff_step(&mut self, lane: usize, rate_times_length: f64) {
        let n = self.states.as_ref().len();
        let derivatives = self.derivatives.lane(lane) + stiff::derivatives(n) - explicit::STAGES;
        self.derivatives.set_lane(lane, derivatives);
        if self.source.follow && lane > 0 {
            self.is_stiff[lane] = self.is_stiff[0];
            return;
        }
        let of_explicit = EXPLICIT_DERIVATIVES * rate_times_length;
        let is_calm = of_explicit < NOT_STIFF * stiff::derivatives(n);
        self.calm_steps[lane] = if is_calm {
            self.calm_steps[lane] + 1
        } else {
            0
        };
        if self.calm_steps[lane] >= CALM_STEPS {
            self.is_stiff[lane] = false;
            self.stiff_looks[lane] = 0;
            let needed = self.stiff_looks_needed[lane];
            self.stiff_looks_needed[lane] = MOST_STIFF_LOOKS.min(2 * needed);
        }
    }

    /// Rows of eight candidates in double precision that know what is held.
    fn prepare_exact(&mut self, stretch: &mut IntegratedStretch<'_, R>) {
        let RowCandidates {
            plant,
            parameters,
            sample_time,
            ..
        } = &self.source;
        if self.exact.is_empty() {
            for first in (0..R::WIDTH).step_by(LANES) {
                let of_group: Vec<Lanes> = parameters
                    .iter()
                    .map(|row| lanes_from(row, first))
                    .collect();
                let equations = plant.row(&of_group, *sample_time);
                let states = equations.initial_states();
                self.exact.push(Exact {
                    rosenbrock: Rosenbrock::new(states.as_ref().len()),
                    weights: states.clone(),
                    next: states.clone(),
                    end: states.clone(),
                    states,
                    equations,
                });
            }
            stretch.is_exact = false;
        }
        if !stretch.is_exact {
            for (group, exact) in self.exact.iter_mut().enumerate() {
                exact.equations.act(&stretch.held.lanes_from(group * LANES));
            }
            stretch.is_exact = true;
        }
    }
}

impl<E: Equations<Lanes>> Exact<E> {
    /// Takes over where the candidates from `first` on are.
    fn load<'a, P: System + 'a, R: Real>(
        &mut self,
        integrator: &Integrator<'a, P, R>,
        first: usize,
    ) {
        let sums = integrator.states.as_ref().iter();
        let sums = sums.zip(integrator.excess.as_ref());
        for (to, (state, excess)) in self.states.as_mut().iter_mut().zip(sums) {
            *to = lanes_from::<R, Lanes>(state, first) - lanes_from(excess, first);
        }
        let weights = integrator.weights.as_ref().iter();
        for (to, weight) in self.weights.as_mut().iter_mut().zip(weights) {
            *to = lanes_from(weight, first);
        }
    }

    /// A step. Compiled once for rows of every kind.
    #[inline(never)]
    fn step(&mut self, width: Width, elapsed: Lanes, length: Lanes) -> stiff::StiffOutcome {
        // Candidates that stay get a step all the same, whose outcome nobody reads.
        let length = length.map(|length| if length > 0.0 { length } else { 1.0 });
        width.does(WideStep {
            rosenbrock: &mut self.rosenbrock,
            equations: &mut self.equations,
            step: stiff::StiffStep {
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
