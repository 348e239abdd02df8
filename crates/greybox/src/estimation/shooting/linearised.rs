//! The residuals and jumps of all segments linearised, with the starts eliminated.

use super::segment::{Joins, STATE_SHIFT, Simulated, Starts, jumps, visit};
use crate::estimation::problem::Problem;
use greybox_numerics::chain::{Chains, Member};

/// The linearised problem: the starts are the own unknowns of a chain for each experiment.
pub(super) struct Linearised {
    pub chains: Chains,
    /// The sum of the squared residuals, those of priors among them.
    pub residuals: f64,
    /// The sum of the squared jumps, and how many they are.
    pub jumps: f64,
    pub n_jumps: usize,
}

impl Linearised {
    /// Jumps count by their weight. Nothing where the candidate or a neighbour cannot be simulated.
    pub(super) fn of(
        problem: &Problem,
        positions: &[f64],
        joins: Joins<'_>,
        simulated: &Simulated,
    ) -> Option<Linearised> {
        if !simulated.is_whole() {
            return None;
        }
        let n = positions.len();
        let mut linearised = Linearised {
            chains: Chains::new(n),
            residuals: 0.0,
            jumps: 0.0,
            n_jumps: 0,
        };
        for prior in problem.prior_rows(positions) {
            let row = (0..n).map(|column| prior.slope(column));
            let row: Vec<f64> = row.chain([prior.residual]).collect();
            linearised.chains.add_shared(&row);
            linearised.residuals += prior.residual * prior.residual;
        }
        for place in 0..simulated.segments.len() {
            let member = linearised.member(problem, joins, simulated, place);
            linearised.chains.add(&member);
        }
        let sums = linearised.residuals + linearised.jumps;
        let is_usable = sums.is_finite() && linearised.chains.triangle().is_usable();
        is_usable.then_some(linearised)
    }

    /// The rows of a segment.
    fn member(
        &mut self,
        problem: &Problem,
        Joins { starts, weight }: Joins<'_>,
        simulated: &Simulated,
        place: usize,
    ) -> Member {
        let (segment, columns) = (&simulated.segments[place], &simulated.columns[place]);
        let n = simulated.shifts.len();
        // The first segment starts where the problem says.
        let starting = match segment.place {
            0 => 0,
            _ => starts.scales.len(),
        };
        let mut rows = Vec::new();
        let mut sum = 0.0;
        visit(problem, segment, |sample, output, measured, scale| {
            let value = |member: usize| columns.value(member, sample, output);
            let here = value(0);
            let residual = (measured - here) / scale;
            let slope = problem.loss.slope(residual);
            let by = |member: usize| (here - value(member)) / scale * slope;
            rows.extend((0..starting).map(|state| by(1 + n + state) / STATE_SHIFT));
            let by_step = simulated.shifts.iter().enumerate();
            rows.extend(by_step.map(|(k, shift)| by(1 + k) / shift));
            let bent = problem.loss.bent(residual);
            rows.push(bent);
            sum += bent * bent;
        });
        self.residuals += sum;
        let root = weight.sqrt();
        let mut joins = Vec::new();
        for (state, jump) in jumps(segment, columns, 0, starts).into_iter().enumerate() {
            let end = |member: usize| columns.last_state(member, state);
            let by = |member: usize| root * (end(member) - end(0)) / starts.scales[state];
            joins.extend((0..starting).map(|start| by(1 + n + start) / STATE_SHIFT));
            let by_step = simulated.shifts.iter().enumerate();
            joins.extend(by_step.map(|(k, shift)| by(1 + k) / shift));
            joins.push(root * jump);
            self.jumps += jump * jump;
            self.n_jumps += 1;
        }
        Member {
            n_own: starting,
            rows,
            joins,
            weight: root,
        }
    }

    /// The starts after a share of a step and of what it makes best for them.
    pub(super) fn moved(&self, starts: &Starts, step: &[f64], share: f64) -> Option<Starts> {
        let mut moved = starts.clone();
        let steps = self.chains.own_steps(step)?;
        for (start, step) in moved.of.iter_mut().flatten().zip(steps.iter().flatten()) {
            let parts = start.iter_mut().zip(step).zip(&moved.scales);
            parts.for_each(|((value, by), scale)| *value += share * by * scale);
        }
        Some(moved)
    }
}
