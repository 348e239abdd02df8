//! Candidates that take many steps are looked at: some fail, some go on with the stiff method.

use super::{IntegratedStretch, Integrator, LOOK_EVERY, StepTrial};
use crate::SimulationFailure;
use crate::equations::System;
use greybox_numerics::lanes::Real;

/// Steps are limited by stability where their length times the fastest rate is beyond this: the
/// explicit method ends to be stable at 2.78.
const STIFF: f64 = 1.5;

/// A step does not get on that is shorter than rounding leaves of the time since its stretch began,
/// or, where that has just begun, than this share of the stretch.
const SHORTEST: f64 = 1e-30;

/// A state that would grow to so many times its size in the time since its stretch began has
/// diverged.
const RUNAWAY: f64 = 1e9;

impl<'a, P: System, R: Real> Integrator<'a, P, R> {
    /// Looks at candidates that take many steps: those that do not get on fail, and those whose
    /// steps are limited by stability go on with the stiff method.
    #[inline(never)]
    pub(super) fn look(&mut self, stretch: &mut IntegratedStretch<'_, R>, trial: &StepTrial<R>) {
        let rates = self
            .stages
            .squared_rate_times_length(&self.weights, trial.taken);
        for lane in 0..R::WIDTH {
            let trials = stretch.trials_of(lane);
            let is_due = trials >= self.first_look && trials.is_multiple_of(LOOK_EVERY);
            if !is_due || stretch.remaining.lane(lane) <= 0.0 {
                continue;
            }
            let duration = stretch.duration.lane(lane);
            let elapsed = duration - stretch.remaining.lane(lane);
            let shortest = (f64::EPSILON * elapsed).max(SHORTEST * duration);
            let failure = if self.length.lane(lane) < shortest {
                Some(self.why_too_short(lane, elapsed))
            } else if self.derivatives.lane(lane) > self.budget {
                Some(SimulationFailure::StepBudget)
            } else {
                None
            };
            if let Some(failure) = failure {
                self.fail(lane, failure);
                stretch.remaining.set_lane(lane, 0.0);
            } else if !self.is_stiff[lane] {
                let limit = STIFF * self.stable_for(lane);
                let shows_it = u8::from(rates.lane(lane) > limit * limit);
                self.stiff_looks[lane] = shows_it * self.stiff_looks[lane].saturating_add(1);
                self.is_stiff[lane] = self.stiff_looks[lane] >= self.stiff_looks_needed[lane];
                self.calm_steps[lane] = 0;
            }
        }
        self.follow_the_first(stretch);
        self.has_stiff = self.is_stiff.contains(&true);
        self.leave_to_the_stiff();
    }

    /// Has following candidates use the method of the first candidate, and fail with it.
    fn follow_the_first(&mut self, stretch: &mut IntegratedStretch<'_, R>) {
        if !self.source.follow {
            return;
        }
        for lane in 1..R::WIDTH {
            self.is_stiff[lane] = self.is_stiff[0];
            if let Some(failure) = self.failures[0] {
                self.fail(lane, failure);
                stretch.remaining.set_lane(lane, 0.0);
            }
        }
    }

    /// A state has diverged that moves so fast that the time so far would take it away.
    fn why_too_short(&self, lane: usize, elapsed: f64) -> SimulationFailure {
        let states = self.states.as_ref().iter().zip(self.sizes.as_ref());
        let slopes = self.stages.first.as_ref().iter();
        let stays = |((state, size), slope): ((&R, &R), &R)| {
            let size = state.lane(lane).abs().max(size.lane(lane));
            (slope.lane(lane) * elapsed).abs() <= RUNAWAY * size
        };
        if states.zip(slopes).all(stays) {
            SimulationFailure::Tolerance
        } else {
            SimulationFailure::Diverged
        }
    }
}
