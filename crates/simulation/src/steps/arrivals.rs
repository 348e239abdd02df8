//! Candidates that run by themselves come to the end of their stretch, each in its own time.

use super::{Arrivals, IntegratedStretch, Integrator, MOST, RowCandidates, STIFF_LOOKS};
use crate::SimulatedCandidate;
use crate::equations::{Equations, HeldQuantities, System, lanes_from};
use greybox_numerics::lanes::{LANES, Lanes, Real};

impl<'a, P: System, R: Real> Integrator<'a, P, R> {
    /// Begins the next stretch of each candidate that has come to the end of one.
    #[inline(never)]
    pub(super) fn arrive(
        &mut self,
        arrivals: &mut dyn Arrivals<'a, P, R>,
        equations: &mut P::Row<'a, R>,
        stretch: &mut IntegratedStretch<'_, R>,
    ) {
        let mut has_arrived = [false; MOST];
        for (lane, has_arrived) in has_arrived[..R::WIDTH].iter_mut().enumerate() {
            *has_arrived = stretch.duration.lane(lane) > 0.0 && stretch.remaining.lane(lane) <= 0.0;
        }
        let arrived: Vec<usize> = (0..R::WIDTH).filter(|lane| has_arrived[*lane]).collect();
        if arrived.is_empty() {
            return;
        }
        let next = arrivals.next(self, equations, &has_arrived[..R::WIDTH]);
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let mut begins = zero;
        let mut has_new = false;
        for &lane in &arrived {
            let duration = match self.failures[lane] {
                Some(_) => 0.0,
                None => next.lane(lane),
            };
            stretch.duration.set_lane(lane, duration);
            stretch.remaining.set_lane(lane, duration);
            stretch.trials_before[lane] = stretch.trials;
            begins.set_lane(lane, 1.0);
            has_new |= duration > 0.0 && self.length.lane(lane) == 0.0;
        }
        // Slopes at the end of a trial are read no more.
        equations.rates(&self.states, zero, &mut self.stages.end);
        let slopes = self.stages.first.as_mut().iter_mut();
        for (slope, at_begin) in slopes.zip(self.stages.end.as_ref()) {
            *slope = begins.select_ge(one, *at_begin, *slope);
        }
        if has_new {
            self.choose_first_lengths(stretch.duration);
        }
    }

    /// Puts a candidate into the place of another, where its equations begin and before its first step.
    pub fn replace(
        &mut self,
        lane: usize,
        candidate: SimulatedCandidate<'_>,
        equations: &mut P::Row<'a, R>,
        held: &HeldQuantities<R>,
    ) {
        let RowCandidates {
            plant,
            parameters,
            sample_time,
            ..
        } = &mut self.source;
        let plant: &'a P = plant;
        for (row, value) in parameters.iter_mut().zip(candidate.parameters) {
            row.set_lane(lane, *value);
        }
        *equations = plant.row(parameters, *sample_time);
        if let Some(exact) = self.exact.get_mut(lane / LANES) {
            let first = lane / LANES * LANES;
            let of_group = parameters.iter().map(|row| lanes_from(row, first));
            let of_group: Vec<Lanes> = of_group.collect();
            let mut of_group = plant.row(&of_group, *sample_time);
            of_group.act(&held.lanes_from(first));
            exact.replace(lane - first, of_group);
        }
        self.begin_at(lane, candidate.initial_state, equations);
        equations.act(held);
        self.failures[lane] = None;
        self.length.set_lane(lane, 0.0);
        self.derivatives.set_lane(lane, 0.0);
        self.stiff_looks[lane] = 0;
        self.stiff_looks_needed[lane] = STIFF_LOOKS;
        self.is_stiff[lane] = false;
        self.has_stiff = self.is_stiff.contains(&true);
        self.calm_steps[lane] = 0;
        if let Some(smooth) = self.smooth.as_deref_mut() {
            smooth.candidates.set_lane(lane, 0.0);
            smooth.is_used = smooth.candidates.any_above(0.0);
        }
    }

    /// Puts a candidate where its equations begin, or where it is said to begin.
    fn begin_at(&mut self, lane: usize, initial: &[Option<f64>], equations: &P::Row<'a, R>) {
        let (states, sizes) = (equations.initial_states(), equations.sizes());
        let per_tolerance = R::splat(1.0 / self.source.accuracy.tolerance());
        let rows = states.as_ref().iter().zip(sizes.as_ref());
        for (index, (state, least)) in rows.enumerate() {
            let mut state = *state;
            if let Some(given) = initial[index] {
                state.set_lane(lane, given);
            }
            let size = if <P::Row<'a, R>>::SIZES_ARE_FIXED {
                *least
            } else {
                state.abs().max(*least)
            };
            let weight = per_tolerance / size;
            let take = |to: &mut R, from: R| to.set_lane(lane, from.lane(lane));
            take(&mut self.states.as_mut()[index], state);
            take(&mut self.excess.as_mut()[index], R::splat(0.0));
            take(&mut self.least_sizes.as_mut()[index], *least);
            take(&mut self.sizes.as_mut()[index], size);
            take(&mut self.weights.as_mut()[index], weight);
        }
    }
}
