//! When candidates of a row use the method of eighth order: those that take many steps from one
//! sample to the next.

use super::{IntegratedStretch, Integrator, LARGEST_FACTOR, StepTrial};
use crate::equations::{Equations, System};
use crate::explicit::eighth::{self, STABLE_FOR, StepStart};
use crate::explicit::smooth::SmoothRow;
use greybox_numerics::lanes::Real;

/// A candidate that is not at the end of a stretch after so many trials, or after as many more, goes
/// on with it, ...
const MANY_TRIALS: u32 = 4;

/// ... where the last step of the method of fourth order times the fastest rate was below this: its
/// accuracy limits it.
const ACCURACY_LIMITS: f64 = 1.0;

/// How much longer its first step is tried than the last of the method of fourth order.
const FIRST_FACTOR: f64 = 5.0;

impl<'a, P: System, R: Real> Integrator<'a, P, R> {
    /// The method of eighth order, where a candidate uses it.
    #[inline(always)]
    pub(super) fn smooth_in_use(&self) -> Option<&SmoothRow<P::Row<'a, R>, R>> {
        if const { !<P::Row<'a, R>>::MAY_BE_SMOOTH } {
            return None;
        }
        self.smooth.as_deref().filter(|smooth| smooth.is_used)
    }

    /// Whether a candidate that moves does not use it.
    #[inline(always)]
    pub(super) fn has_fourth_order(&self, stretch: &IntegratedStretch<'_, R>) -> bool {
        self.smooth_in_use().is_none_or(|smooth| {
            let zero = R::splat(0.0);
            let fourth_order = smooth
                .candidates
                .select_ge(R::splat(1.0), zero, stretch.remaining);
            fourth_order.any_above(0.0)
        })
    }

    /// A trial of the candidates that use it; that of the others stands.
    #[inline(always)]
    pub(super) fn try_smooth(&mut self, equations: &mut P::Row<'a, R>, trial: &mut StepTrial<R>) {
        if self.smooth_in_use().is_none() {
            return;
        }
        let Some(smooth) = self.smooth.as_deref_mut() else {
            return;
        };
        let start = StepStart {
            states: &self.states,
            slope: &self.stages.first,
            elapsed: trial.elapsed,
        };
        let stages = &mut smooth.stages;
        eighth::step(equations, start, stages, trial.taken);
        let squared_error = stages.squared_error(&self.weights, trial.taken);
        let share = self.shares.eighth;
        let squared_error = squared_error * R::splat(1.0 / (share * share));
        let (is_eighth, one) = (smooth.candidates, R::splat(1.0));
        trial.squared_error = is_eighth.select_ge(one, squared_error, trial.squared_error);
        self.stages.take_where(is_eighth, stages);
    }

    /// Lets candidates use the method that needs fewer derivatives from one sample to the next.
    #[inline(never)]
    pub(super) fn choose_order(
        &mut self,
        stretch: &IntegratedStretch<'_, R>,
        trial: &StepTrial<R>,
    ) {
        let Some(smooth) = self.smooth.as_deref_mut() else {
            return;
        };
        let are_many = |trials: u32| trials.is_multiple_of(MANY_TRIALS);
        let is_used = smooth.is_used;
        if !stretch.any_trials(|trials| are_many(trials) || (trials == 1 && is_used)) {
            return;
        }
        let rates = self
            .stages
            .squared_rate_times_length(&self.weights, trial.taken);
        for lane in 0..R::WIDTH {
            if self.source.follow && lane > 0 {
                let of_first = smooth.candidates.lane(0);
                smooth.candidates.set_lane(lane, of_first);
                continue;
            }
            let (length, duration) = (self.length.lane(lane), stretch.duration.lane(lane));
            let moves = stretch.remaining.lane(lane) > 0.0;
            let uses_it = smooth.candidates.lane(lane) > 0.0;
            let is_slow = rates.lane(lane) < ACCURACY_LIMITS * ACCURACY_LIMITS;
            let trials = stretch.trials_of(lane);
            if are_many(trials) && moves && !uses_it && !self.is_stiff[lane] && is_slow {
                smooth.candidates.set_lane(lane, 1.0);
                self.length.set_lane(lane, FIRST_FACTOR * length);
            } else if trials == 1 && !moves && uses_it && length >= LARGEST_FACTOR * duration {
                // One step, and its error was far below the tolerance.
                smooth.candidates.set_lane(lane, 0.0);
                self.length.set_lane(lane, duration);
            }
        }
        smooth.is_used = smooth.candidates.any_above(0.0);
    }

    /// How much longer than with the method of fourth order stability allows a candidate's steps.
    pub(super) fn stable_for(&self, lane: usize) -> f64 {
        match &self.smooth {
            Some(smooth) if smooth.candidates.lane(lane) > 0.0 => STABLE_FOR,
            _ => 1.0,
        }
    }

    /// Candidates that use the stiff method do not use this one.
    pub(super) fn leave_to_the_stiff(&mut self) {
        if let Some(smooth) = self.smooth.as_deref_mut() {
            for lane in (0..R::WIDTH).filter(|lane| self.is_stiff[*lane]) {
                smooth.candidates.set_lane(lane, 0.0);
            }
            smooth.is_used = smooth.candidates.any_above(0.0);
        }
    }
}
