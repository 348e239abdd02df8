//! Total intervals that cover every explanation of the record that stands.
//!
//! Where a disturbance moves the plant, no single noise model is certain. Another noise model, another window
//! of the record, a change within the record or an effect that the residuals ask for may put an unknown
//! elsewhere. None of them is known to be right, so that the total interval goes as far as each of them.

use super::Analysis;
use super::budget::{Line, SLIGHT_SHARE};
use super::covariance::NORMAL_95;
use super::noise_analysis::{FreeRunEstimate, Rival};
use crate::estimation::problem::Problem;

/// The estimate whose total intervals are widened.
pub(super) struct Hull<'a> {
    pub problem: &'a Problem,
    /// The positions of the estimate.
    pub positions: &'a [f64],
}

impl Hull<'_> {
    /// Widens each total interval by how far windows of the record scatter about the estimate, where they
    /// disagree about the unknown.
    pub fn cover_windows(&self, analysis: &mut Analysis) {
        let Some(windows) = &analysis.windows else {
            return;
        };
        let described = analysis.coordinates.iter_mut().enumerate();
        let described = described.filter(|(index, _)| windows.disagree_about(*index));
        for (index, described) in described {
            let total = analysis.budget.totals[index].zip(windows.scatters[index]);
            let total = total.map(|(total, scatter)| total.hypot(scatter));
            let deviations = total.zip(analysis.deviations[index]);
            let coordinate = &self.problem.coordinates[index];
            described.widen(coordinate, self.positions[index], deviations);
        }
    }

    /// Widens each total interval to those of other noise models: to the other's whole interval where the data
    /// leave it standing beside the one taken, else to its estimate with the error of the one taken.
    pub fn cover_rivals<'b>(
        &self,
        analysis: &mut Analysis,
        rivals: impl Iterator<Item = Rival<'b>>,
    ) {
        for rival in rivals {
            for (index, described) in analysis.coordinates.iter_mut().enumerate() {
                let coordinate = &self.problem.coordinates[index];
                let ends = rival.ends(index, analysis.deviations[index]);
                let position = self.positions[index];
                let ends = ends.into_iter();
                ends.for_each(|ends| described.cover(coordinate, position, ends));
            }
        }
    }

    /// Widens each total interval to where the free run puts the unknown, where the two do not agree.
    pub fn cover_free_run(&self, analysis: &mut Analysis, free_run: &[FreeRunEstimate]) {
        let described = analysis.coordinates.iter_mut().zip(free_run).enumerate();
        for (index, (described, free)) in described {
            let (coordinate, position) = (&self.problem.coordinates[index], self.positions[index]);
            let deviation = analysis.deviations[index].unwrap_or_default();
            let half = NORMAL_95 * deviation;
            let by = free
                .disagreement(coordinate, position, deviation)
                .into_iter();
            let ends = by.map(|by| [position + by - half, position + by + half]);
            ends.for_each(|ends| described.cover(coordinate, position, ends));
        }
    }

    /// Widens each total interval to where the unknown would be, were what the residuals ask for true: an
    /// effect that the model leaves out, another value of what is taken as known, or a change within the
    /// record. An effect that would explain little of the residuals bends the model without another answer.
    pub fn cover_moves(&self, analysis: &mut Analysis) {
        let lines = analysis.budget.lines.iter();
        let n_residuals = self.problem.n_residuals();
        let is_large = |line: &&Line| line.explained_share(n_residuals) > SLIGHT_SHARE;
        let contradicted: Vec<_> = lines
            .filter(|line| line.is_contradicted())
            .filter(is_large)
            .collect();
        for (index, described) in analysis.coordinates.iter_mut().enumerate() {
            let Some(deviation) = analysis.deviations[index] else {
                continue;
            };
            let suggested = contradicted
                .iter()
                .filter_map(|line| line.suggested_move(index));
            // What windows say of an unknown is measured; what a change would do is extrapolated.
            let windows = analysis.windows.as_ref();
            let is_measured = windows.is_some_and(|windows| windows.scatters[index].is_some());
            let drifts = analysis.drifts.iter().filter(|_| !is_measured);
            let drifted = drifts.flat_map(|drift| {
                let by = drift.move_of(index);
                [-by, by]
            });
            let (position, half) = (self.positions[index], NORMAL_95 * deviation);
            for by in suggested.chain(drifted) {
                let ends = [position + by - half, position + by + half];
                described.cover(&self.problem.coordinates[index], position, ends);
            }
        }
    }
}
