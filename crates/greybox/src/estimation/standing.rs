//! Where a run stands: how far it has come, and what its estimate is so far.

use super::Estimation;
use super::floor::FloorReport;
use super::problem::Problem;
use super::progress::{Phase, Progress};
use super::refine::Descent;
use super::report::{Report, SearchEnd, StartReport};
use super::stage::EstimationStage;
use super::stop_reason::StopReason;

/// The share of the work that the search is taken for, where a refinement follows.
const SEARCH_SHARE: f64 = 0.9;

impl Estimation {
    /// How far it has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let total = self.state.totals.and(&self.search.state);
        let searches = self.state.searches.len() + usize::from(self.phase() == Phase::Search);
        let asked = self.settings.restarts.max(1) as usize;
        let at_work = f64::from(self.search.state.generation);
        let at_work = at_work / f64::from(self.settings.generations.max(1));
        let searched = self.state.searches.len() as f64 + at_work;
        let ended = |descent: &&Descent| descent.end.is_some();
        let refined = self.state.descents.iter().filter(ended).count() as f64;
        let refined = refined / self.state.descents.len().max(1) as f64;
        // Further searches may follow the refinement, and each counts as much as the last one.
        let rounds = f64::from(1 + self.landmarks.most_searches(&self.settings)) - asked as f64;
        let round = (self.state.searches.len() as f64 - asked as f64).max(0.0);
        let after = |share: f64| SEARCH_SHARE + (1.0 - SEARCH_SHARE) * share / rounds;
        Progress {
            phase: self.phase(),
            generation: total.generations,
            generations: self
                .settings
                .generations
                .saturating_mul(searches.max(asked) as u32),
            evaluations: total.counters.evaluations,
            best_cost: self.best_cost(),
            best_credit: total.best_credit.map(|(credit, _)| credit),
            fraction: match self.phase() {
                Phase::Search if searches > asked => after(round + 1.0),
                Phase::Search => SEARCH_SHARE * (searched / asked as f64).min(1.0),
                Phase::Refine => after(round + refined),
                Phase::Analyse => 1.0,
            },
            // The method has no clock; whoever works the run fills it in.
            eta_s: None,
        }
    }

    /// The estimate: the best so far, with `stopped` as its reason where the run was ended before
    /// it had finished. None before any candidate could be simulated.
    #[must_use]
    pub fn report(&self, problem: &Problem, stopped: Option<StopReason>) -> Option<Report> {
        let positions = match self.best_descent() {
            Some(descent) => descent.positions.clone(),
            None => self.search.positions(problem, &self.champion()?.chromosome),
        };
        let total = self.state.totals.and(&self.search.state);
        let twins = match &self.state.stage {
            EstimationStage::Analyse { twins } => &twins[..],
            EstimationStage::Search | EstimationStage::Refine(_) => &[],
        };
        let named = |positions: &Vec<f64>| problem.named_values(positions);
        let twins: Vec<Vec<(String, f64)>> = twins.iter().map(named).collect();
        let floor = FloorReport::of(&self.landmarks, &self.state.descents);
        let reason = stopped
            .or(self.state.stop_reason)
            .unwrap_or(StopReason::GenerationLimit);
        Some(Report {
            stop_reason: reason,
            values: problem.values(&positions),
            positions,
            cost: self.best_cost(),
            generations: total.generations,
            counters: total.counters,
            best_credit: total.best_credit.map(|(credit, _)| credit),
            best_generation: total.best_generation,
            declared_positions: None,
            searches: self
                .state
                .searches
                .iter()
                .map(|search| SearchEnd {
                    stop_reason: search.stop_reason,
                    generations: search.generations,
                    cost: search
                        .leaders
                        .first()
                        .map(|champion| champion.cost)
                        .filter(|cost| cost.is_finite()),
                })
                .collect(),
            starts: self
                .state
                .descents
                .iter()
                .map(|descent| StartReport {
                    initial_cost: descent.start_cost,
                    cost: descent.coarse_cost.or(descent.cost),
                    parameters: named(&descent.positions).into_iter().collect(),
                    end: descent.end,
                })
                .collect(),
            floor: floor.map(|floor| FloorReport {
                twins: twins
                    .iter()
                    .map(|twin| twin.iter().cloned().collect())
                    .collect(),
                ..floor
            }),
            twins,
        })
    }
}
