//! The refinement of a run: descents side by side, and what follows when they have ended.

use super::leaders::Judged;
use super::objective::Objective;
use super::refine::{self, Descent, Minimum};
use super::sensitivity::SensitivityError;
use super::shooting::Shooting;
use super::{Advance, Estimation, Observer, Phase, Problem, RefinementRow, StopReason, floor};
use greybox_simulation::Accuracy;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Iterations after which a rival that is finely simulated is where it is going, or none.
const RIVAL_ITERATIONS: u32 = 10;

impl Estimation {
    /// Goes over to the refinement.
    pub(super) fn refine(&mut self, reason: StopReason) {
        self.stop_reason = Some(reason);
        self.phase = Phase::Refine;
    }

    /// Begins a descent, with the search that found where.
    pub(super) fn descend(&mut self, search: Option<u32>, start: Vec<f64>) {
        let mut descent = Descent::from(start);
        descent.search = search;
        self.descents.push(descent);
    }

    pub(super) fn advance_refinement(
        &mut self,
        problem: &Problem,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Advance {
        if !self.settings.refine {
            self.phase = Phase::Analyse;
            return Advance::Finished;
        }
        if !self.shootings.is_empty() {
            return self.advance_shootings(problem, stop);
        }
        if self.descents.iter().all(|descent| descent.end.is_some()) {
            match self.after_descents(problem, stop) {
                None => return Advance::Interrupted,
                Some(Phase::Search) => return Advance::Working,
                Some(Phase::Analyse) => return Advance::Finished,
                Some(Phase::Refine) => {}
            }
        }
        // Side by side, because one alone does not fill the cores. All or none, so that a unit
        // that was interrupted leaves no trace.
        let found = self.descents.iter().filter_map(Descent::minimum);
        let found: Vec<Minimum> = found.collect();
        let iterate = |descent: &Descent| {
            let mut next = descent.clone();
            let done = next.end.is_some() || next.iterate(problem, &found, stop);
            done.then_some(next)
        };
        let Some(next) = self
            .descents
            .par_iter()
            .map(iterate)
            .collect::<Option<Vec<_>>>()
        else {
            return Advance::Interrupted;
        };
        let totals = |descents: &[Descent]| {
            let iterations: u32 = descents.iter().map(|descent| descent.iterations).sum();
            let evaluations: u64 = descents.iter().map(|descent| descent.evaluations).sum();
            (iterations, evaluations)
        };
        let (before, after) = (totals(&self.descents), totals(&next));
        self.descents = next;
        self.earlier.counters.evaluations += after.1 - before.1;
        self.earlier.counters.distinct_evaluations += after.1 - before.1;
        if let (true, Some(cost)) = (after.0 > before.0, self.best_cost()) {
            let iteration = after.0;
            observer.refinement(&RefinementRow { iteration, cost });
        }
        Advance::Working
    }

    /// Lets the best of a search go over segments, side by side; when all have ended, descents of the
    /// free run go on from where they came to.
    fn advance_shootings(&mut self, problem: &Problem, stop: &AtomicBool) -> Advance {
        let iterate = |shooting: &Shooting| {
            let mut next = shooting.clone();
            let done = next.has_ended || next.iterate(problem, stop);
            done.then_some(next)
        };
        let next: Option<Vec<Shooting>> = self.shootings.par_iter().map(iterate).collect();
        let Some(next) = next else {
            return Advance::Interrupted;
        };
        let total =
            |shootings: &[Shooting]| -> u64 { shootings.iter().map(|own| own.evaluations).sum() };
        let done = total(&next) - total(&self.shootings);
        self.earlier.counters.evaluations += done;
        self.earlier.counters.distinct_evaluations += done;
        self.shootings = next;
        if self.shootings.iter().all(|own| own.has_ended) {
            for ended in std::mem::take(&mut self.shootings) {
                self.descend(ended.search, ended.positions);
            }
        }
        Advance::Working
    }

    /// Lets the best of the last search go over segments, once for each search; whether there is
    /// something to be hoped for. A search over segments whose starts were measured needs it not.
    fn shoot(&mut self, problem: &Problem) -> bool {
        let number = self.searches.len();
        if self.segmented.is_some() || self.shot_searches == number {
            return false;
        }
        self.shot_searches = number;
        if !Shooting::is_possible(problem) {
            return false;
        }
        let leaders = self.searches.last().map(|search| &search.leaders);
        let begin = |leader: &Judged| {
            let positions = self.positions(problem, &leader.chromosome);
            Shooting::from(Some(number as u32 - 1), positions)
        };
        self.shootings = leaders.into_iter().flatten().map(begin).collect();
        !self.shootings.is_empty()
    }

    /// What follows when all descents have ended: segments and then another search where the floor is
    /// in doubt, then
    /// descents from where a twin would be, then the lowest descent again, simulated finely; then
    /// it is compared with those that came as low. Nothing when `stop` was raised.
    fn after_descents(&mut self, problem: &Problem, stop: &AtomicBool) -> Option<Phase> {
        if !self.descents.iter().any(Descent::is_polished) {
            let is_doubtful = floor::is_doubtful(&self.landmarks, &self.descents);
            let is_poor = floor::is_poor(&self.landmarks, &self.descents);
            if is_doubtful && is_poor && self.shoot(problem) {
                return Some(Phase::Refine);
            }
            if self.searches_further() && is_doubtful {
                self.begin_next_search();
                self.phase = Phase::Search;
                return Some(Phase::Search);
            }
            if !self.exchanged {
                let starts = self.exchanges(problem, stop)?;
                self.exchanged = true;
                starts
                    .into_iter()
                    .for_each(|positions| self.descend(None, positions));
            }
            if self.descents.iter().any(|descent| descent.end.is_none()) {
                return Some(Phase::Refine);
            }
        }
        if self.polish_best() {
            return Some(Phase::Refine);
        }
        self.twins = self.find_twins(problem, stop)?;
        self.phase = Phase::Analyse;
        Some(Phase::Analyse)
    }

    /// Whether another search may begin by itself.
    fn searches_further(&self) -> bool {
        let most = self.settings.restarts + self.settings.further_searches;
        !self.searches.is_empty() && self.searches.len() < most as usize
    }

    /// Where to descend from to find what the exchange of two parameters leads to.
    fn exchanges(&self, problem: &Problem, stop: &AtomicBool) -> Option<Vec<Vec<f64>>> {
        let Some(best) = self.best_descent() else {
            return Some(Vec::new());
        };
        let exchanges = floor::exchanged(problem, &best.positions);
        if exchanges.is_empty() {
            return Some(Vec::new());
        }
        let objective = Objective::new(problem, self.settings.block_samples as usize);
        let candidates = exchanges.iter().map(|exchange| exchange.positions.clone());
        let candidates: Vec<Vec<f64>> = candidates.collect();
        let judged = objective.evaluate(problem, &candidates, Accuracy::Ranking, stop)?;
        let costs: Vec<f64> = judged.iter().map(|judged| judged.cost).collect();
        floor::promising(exchanges, &costs)
            .into_par_iter()
            .map(|exchange| exchange.adapted(problem, stop))
            .collect()
    }

    /// Other minima as low as the lowest.
    fn find_twins(&self, problem: &Problem, stop: &AtomicBool) -> Option<Vec<Vec<f64>>> {
        let Some(best) = self.best_descent() else {
            return Some(Vec::new());
        };
        let rivals = floor::rivals(&self.landmarks, best, &self.descents);
        if rivals.is_empty() {
            return Some(Vec::new());
        }
        let here = match refine::linearise(problem, &best.positions, Accuracy::Screening, stop) {
            Ok(here) => here,
            Err(SensitivityError::Interrupted) => return None,
            Err(SensitivityError::Failed(_)) => return Some(Vec::new()),
        };
        let rivals = rivals.into_iter().map(|rival| &rival.positions[..]);
        let apart = floor::twins(&best.positions, &here, rivals);
        // Where simulation is coarse one minimum has dents of its own: what is left of a rival when
        // it is finely simulated counts.
        let polished: Option<Vec<Descent>> = apart
            .into_par_iter()
            .map(|positions| {
                let polished = (Accuracy::Full, RIVAL_ITERATIONS);
                refine::descend_at_most(problem, positions, polished, stop)
            })
            .collect();
        let polished = polished?;
        let lowest = best.cost.unwrap_or(f64::INFINITY);
        let as_low = polished.iter().filter_map(|rival| {
            let cost = rival.cost.filter(|_| best.is_polished());
            let is_as_low = cost.is_none_or(|cost| self.landmarks.is_same_fine(lowest, cost));
            is_as_low.then_some(&rival.positions[..])
        });
        Some(floor::twins(&best.positions, &here, as_low))
    }

    /// Takes the lowest descent up again, simulated finely; false where that is done, or none is
    /// left that could be.
    fn polish_best(&mut self) -> bool {
        let is_done = |descent: &Descent| descent.is_polished() && descent.cost.is_some();
        if self.descents.iter().any(is_done) {
            return false;
        }
        let lowest = self.lowest(|descent| !descent.is_polished());
        if let Some(index) = lowest {
            self.descents[index].polish();
        }
        lowest.is_some()
    }

    /// The descent that stands for the estimate.
    pub(super) fn best_descent(&self) -> Option<&Descent> {
        self.lowest(|_| true).map(|index| &self.descents[index])
    }

    /// The descent with the lowest cost. One that began from exchanged parameters is taken only
    /// where it is lower by more than noise: rounding does not decide between twins.
    fn lowest(&self, is_asked_for: impl Fn(&Descent) -> bool) -> Option<usize> {
        let lowest_of = |searched: bool| {
            let descents = self.descents.iter().enumerate();
            let asked_for = descents.filter(|(_, descent)| {
                descent.cost.is_some()
                    && descent.search.is_some() == searched
                    && is_asked_for(descent)
            });
            asked_for.min_by(|(_, a), (_, b)| lowest_first(a, b))
        };
        let cost = |descent: &Descent| descent.cost.unwrap_or(f64::INFINITY);
        let chosen = match (lowest_of(true), lowest_of(false)) {
            (Some(own), Some(other)) => {
                let (before, after) = (cost(own.1), cost(other.1));
                let is_lower = after < before && !self.landmarks.is_same(after, before);
                Some(if is_lower { other } else { own })
            }
            (own, other) => own.or(other),
        };
        chosen.map(|(index, _)| index)
    }
}

/// A descent that is polished stands before those that are not, whose costs are less accurate.
fn lowest_first(a: &Descent, b: &Descent) -> std::cmp::Ordering {
    let cost = |descent: &Descent| descent.cost.unwrap_or(f64::INFINITY);
    let polished = b.is_polished().cmp(&a.is_polished());
    polished.then(cost(a).total_cmp(&cost(b)))
}
