//! The refinement of a run: descents side by side, and what follows when they have ended.

use super::leaders::Judged;
use super::objective::Objective;
use super::refine::{self, Descent, Minimum};
use super::sensitivity::SensitivityError;
use super::shooting::Shooting;
use super::stage::{EstimationStage, RefinementStage};
use super::{Advance, Estimation, Observer, Problem, RefinementRow, StopReason, feasible, floor};
use greybox_simulation::Accuracy;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// Iterations after which a rival that is finely simulated is where it is going, or none.
const RIVAL_ITERATIONS: u32 = 10;

impl Estimation {
    /// Goes over to the refinement.
    pub(super) fn refine(&mut self, reason: StopReason) {
        self.state.stop_reason = Some(reason);
        self.state.stage = EstimationStage::Refine(RefinementStage::FreeRun);
    }

    /// Ends with an estimate, and with other minima as low.
    pub(super) fn finish(&mut self, twins: Vec<Vec<f64>>) -> Advance {
        self.state.stage = EstimationStage::Analyse { twins };
        Advance::Finished
    }

    /// Begins a descent, with the search that found where.
    pub(super) fn descend(&mut self, search: Option<u32>, start: Vec<f64>) {
        let mut descent = Descent::from(start);
        descent.search = search;
        self.state.descents.push(descent);
    }

    /// Begins a descent where the job has one begin. Unknowns of which it says nothing stand where the first
    /// descent has them.
    pub(super) fn descend_from_stated_start(&mut self, problem: &Problem) {
        let coordinates = &problem.coordinates;
        let Some(first) = self.state.descents.first() else {
            return;
        };
        if coordinates.iter().all(|unknown| unknown.start.is_none()) {
            return;
        }
        let positions = coordinates.iter().zip(&first.positions);
        let positions =
            positions.map(|(unknown, position)| unknown.start_position().unwrap_or(*position));
        let inside = feasible::inside_of_constraints(problem);
        let start = feasible::mirrored(problem, inside.as_deref(), positions.collect());
        self.descend(Some(0), start);
    }

    /// Counts candidates that the refinement has simulated.
    fn count(&mut self, simulated: u64) {
        let counters = &mut self.state.totals.counters;
        counters.evaluations += simulated;
        counters.distinct_evaluations += simulated;
    }

    /// One iteration of all descents over segments that have not ended. When all have ended, descents of
    /// the free run go on from where they came to.
    pub(super) fn advance_segments(&mut self, problem: &Problem, stop: &AtomicBool) -> Advance {
        let EstimationStage::Refine(RefinementStage::OverSegments(shootings)) = &self.state.stage
        else {
            return Advance::Working;
        };
        let iterate = |shooting: &Shooting| {
            let mut next = shooting.clone();
            let done = next.has_ended || next.iterate(problem, stop);
            done.then_some(next)
        };
        let next: Option<Vec<Shooting>> = shootings.par_iter().map(iterate).collect();
        let Some(next) = next else {
            return Advance::Interrupted;
        };
        let total = |shootings: &[Shooting]| -> u64 {
            shootings.iter().map(|shooting| shooting.evaluations).sum()
        };
        self.count(total(&next) - total(shootings));
        let has_ended = next.iter().all(|shooting| shooting.has_ended);
        self.state.stage = EstimationStage::Refine(if has_ended {
            for ended in next {
                self.descend(ended.search, ended.positions);
            }
            RefinementStage::FreeRun
        } else {
            RefinementStage::OverSegments(next)
        });
        Advance::Working
    }

    /// One iteration of all descents of the free run that have not ended.
    pub(super) fn advance_descents(
        &mut self,
        problem: &Problem,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Advance {
        let descents = &self.state.descents;
        if descents.iter().all(|descent| descent.end.is_some()) {
            match self.after_descents(problem, stop) {
                None => return Advance::Interrupted,
                Some(EstimationStage::Refine(RefinementStage::FreeRun)) => {}
                Some(EstimationStage::Analyse { twins }) => return self.finish(twins),
                Some(stage) => {
                    self.state.stage = stage;
                    return Advance::Working;
                }
            }
        }
        // Side by side, because one alone does not fill the cores. All or none, so that a unit
        // that was interrupted leaves no trace.
        let descents = &self.state.descents;
        let minima: Vec<Minimum> = descents.iter().filter_map(Descent::minimum).collect();
        let iterate = |descent: &Descent| {
            let mut next = descent.clone();
            let done = next.end.is_some() || next.iterate(problem, &minima, stop);
            done.then_some(next)
        };
        let next: Option<Vec<Descent>> = descents.par_iter().map(iterate).collect();
        let Some(next) = next else {
            return Advance::Interrupted;
        };
        let totals = |descents: &[Descent]| {
            let iterations: u32 = descents.iter().map(|descent| descent.iterations).sum();
            let evaluations: u64 = descents.iter().map(|descent| descent.evaluations).sum();
            (iterations, evaluations)
        };
        let (before, after) = (totals(descents), totals(&next));
        self.state.descents = next;
        self.count(after.1 - before.1);
        if let (true, Some(cost)) = (after.0 > before.0, self.best_cost()) {
            let iteration = after.0;
            observer.refinement(&RefinementRow { iteration, cost });
        }
        Advance::Working
    }

    /// Has the best of the last search descend over segments, once for each search; none where
    /// nothing is to be hoped for. A search over segments whose starts were measured needs it not, and those
    /// that follow the searches which a job allows look in another way.
    fn shoot(&mut self, problem: &Problem) -> Option<Vec<Shooting>> {
        let number = self.state.searches.len();
        let asked = (self.settings.restarts + self.settings.further_searches) as usize;
        let was_done = self.state.shot_searches == number;
        if self.segmented.is_some() || was_done || number > asked {
            return None;
        }
        self.state.shot_searches = number;
        if !Shooting::is_possible(problem) {
            return None;
        }
        let leaders = self.state.searches.last().map(|search| &search.leaders);
        let begin = |leader: &Judged| {
            let positions = self.positions(problem, &leader.chromosome);
            Shooting::from(Some(number as u32 - 1), positions)
        };
        let shootings: Vec<Shooting> = leaders.into_iter().flatten().map(begin).collect();
        (!shootings.is_empty()).then_some(shootings)
    }

    /// The stage that follows when all descents have ended: segments and then another search where
    /// the floor is in doubt, then descents from where a twin would be, then the lowest descent again,
    /// simulated finely; then the estimate stands, compared with those that came as low. Nothing when
    /// `stop` was raised.
    fn after_descents(&mut self, problem: &Problem, stop: &AtomicBool) -> Option<EstimationStage> {
        let free_run = EstimationStage::Refine(RefinementStage::FreeRun);
        if !self.state.descents.iter().any(Descent::is_polished) {
            let is_doubtful = floor::is_doubtful(&self.landmarks, &self.state.descents);
            let is_poor = floor::is_poor(&self.landmarks, &self.state.descents);
            if is_doubtful
                && is_poor
                && let Some(shootings) = self.shoot(problem)
            {
                return Some(EstimationStage::Refine(RefinementStage::OverSegments(
                    shootings,
                )));
            }
            if self.searches_further() && is_doubtful {
                self.begin_next_search(problem);
                return Some(EstimationStage::Search);
            }
            if !self.state.exchanged {
                let starts = self.exchanges(problem, stop)?;
                self.state.exchanged = true;
                starts
                    .into_iter()
                    .for_each(|positions| self.descend(None, positions));
            }
            let descents = &self.state.descents;
            if descents.iter().any(|descent| descent.end.is_none()) {
                return Some(free_run);
            }
        }
        if self.polish_best() {
            return Some(free_run);
        }
        let twins = self.find_twins(problem, stop)?;
        Some(EstimationStage::Analyse { twins })
    }

    /// Whether another search may begin by itself.
    fn searches_further(&self) -> bool {
        let most = self.landmarks.most_searches(&self.settings);
        !self.state.searches.is_empty() && self.state.searches.len() < most as usize
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
        let rivals = floor::rivals(&self.landmarks, best, &self.state.descents);
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
                let iterations = RIVAL_ITERATIONS;
                refine::descend_at_most(problem, positions, Accuracy::Full, iterations, stop)
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
        if self.state.descents.iter().any(is_done) {
            return false;
        }
        let lowest = self.lowest(|descent| !descent.is_polished());
        if let Some(index) = lowest {
            self.state.descents[index].polish();
        }
        lowest.is_some()
    }

    /// The descent that stands for the estimate.
    pub(super) fn best_descent(&self) -> Option<&Descent> {
        self.lowest(|_| true)
            .map(|index| &self.state.descents[index])
    }

    /// The descent with the lowest cost. One that began from exchanged parameters is taken only
    /// where it is the likelier one: rounding does not decide between twins.
    fn lowest(&self, is_asked_for: impl Fn(&Descent) -> bool) -> Option<usize> {
        let lowest_of = |searched: bool| {
            let descents = self.state.descents.iter().enumerate();
            let asked_for = descents.filter(|(_, descent)| {
                descent.cost.is_some()
                    && descent.search.is_some() == searched
                    && is_asked_for(descent)
            });
            asked_for.min_by(|(_, a), (_, b)| lowest_first(a, b))
        };
        let cost = |descent: &Descent| descent.cost.unwrap_or(f64::INFINITY);
        let chosen = match (lowest_of(true), lowest_of(false)) {
            (Some(searched), Some(exchanged)) => {
                let (before, after) = (cost(searched.1), cost(exchanged.1));
                let is_lower = self.landmarks.is_likelier(after, before);
                Some(if is_lower { exchanged } else { searched })
            }
            (searched, exchanged) => searched.or(exchanged),
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
