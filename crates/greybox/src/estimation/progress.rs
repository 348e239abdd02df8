//! How far a run came.

use super::Estimation;
use super::refine::Descent;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The part of the method that a job is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// The genetic search, generation after generation.
    Search,
    /// Local least squares from the best candidates.
    Refine,
    /// Standard errors, intervals and the verdict.
    Analyse,
}

/// What a unit of work came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// There is more to do.
    Working,
    /// The stop flag was raised; nothing has changed.
    Interrupted,
    /// The estimate stands.
    Finished,
}

/// How far a job came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Progress {
    /// The part of the method that it is in.
    pub phase: Phase,
    /// Generations finished.
    pub generation: u32,
    /// The most generations that there can be.
    pub generations: u32,
    /// Candidates judged.
    pub evaluations: u64,
    /// The lowest cost so far.
    pub best_cost: Option<f64>,
    /// The largest credit of the last generation.
    pub best_credit: Option<f64>,
    /// How much of the most work there can be is done, 0 to 1.
    pub fraction: f64,
    /// Working time until the end if all generations are needed `[s]`.
    pub eta_s: Option<f64>,
}

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
        let rounds = f64::from(1 + self.settings.further_searches);
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
}
