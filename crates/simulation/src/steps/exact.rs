//! When candidates of a row use the stiff method, and when they leave it.

use super::{
    CALM_STEPS, EXPLICIT_DERIVATIVES, IntegratedStretch, Integrator, MOST_STIFF_LOOKS, NOT_STIFF,
    RowCandidates, StepTrial,
};
use crate::equations::{Equations, System, lanes_from};
use crate::explicit::{self, Sum};
use crate::stiff::{self, exact::Exact};
use greybox_numerics::lanes::{LANES, Lanes, Real};

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
            let from = Sum {
                states: &self.states,
                excess: &self.excess,
            };
            exact.load(from, &self.weights, first);
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
                self.exact
                    .push(Exact::new(plant.row(&of_group, *sample_time)));
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
