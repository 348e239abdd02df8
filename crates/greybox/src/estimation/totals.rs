//! Totals of the searches that have finished: each search counts for itself, a run counts on.

use super::leaders::Judged;
use super::observer::{Counters, GenerationRow};
use super::search::State;
use serde::{Deserialize, Serialize};

/// Totals of the searches that have finished, and what the refinement did.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub(super) struct Totals {
    /// Generations of all finished searches.
    pub generations: u32,
    /// What the finished searches and the refinement have done.
    pub counters: Counters,
    /// The best candidate of the finished searches.
    pub champion: Option<Judged>,
    /// The largest credit and the generation that first had it.
    pub best_credit: Option<(f64, u32)>,
    /// The generation in which the best candidate was found.
    pub best_generation: Option<u32>,
}

impl Totals {
    /// Returns the totals with those of the search at work, after it has ended.
    pub fn and(&self, last: &State) -> Totals {
        let mut counters = self.counters.clone();
        counters.add(&last.counters);
        Totals {
            generations: self.generations + last.generation,
            counters,
            champion: self.champion(last).cloned(),
            best_credit: self.best_credit(last),
            best_generation: self.best_generation(last),
        }
    }

    /// The best candidate of the finished searches and the one at work.
    pub fn champion<'a>(&'a self, at_work: &'a State) -> Option<&'a Judged> {
        let both = self.champion.iter().chain(at_work.leaders.first());
        both.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    fn best_credit(&self, at_work: &State) -> Option<(f64, u32)> {
        let last = at_work.best_credit;
        let last = last.map(|(credit, generation)| (credit, self.generations + generation));
        match (self.best_credit, last) {
            (Some(before), Some(last)) if last.0 > before.0 => Some(last),
            (before, last) => before.or(last),
        }
    }

    fn best_generation(&self, at_work: &State) -> Option<u32> {
        let is_before = self.champion.as_ref().is_some_and(|before| {
            let champion = at_work.leaders.first();
            champion.is_none_or(|champion| before.cost <= champion.cost)
        });
        let last = at_work.best_generation;
        let last = last.map(|generation| self.generations + generation);
        if is_before {
            self.best_generation
        } else {
            last
        }
    }

    /// A generation of the search at work as the run counts; `values` are those of a candidate.
    pub fn counted_on(
        &self,
        row: GenerationRow,
        values: impl FnOnce(&Judged) -> Vec<(String, f64)>,
    ) -> GenerationRow {
        let better = self.champion.as_ref();
        let better = better.filter(|before| before.cost <= row.best_cost);
        GenerationRow {
            generation: self.generations + row.generation,
            evaluations: self.counters.evaluations + row.evaluations,
            best_cost: better.map_or(row.best_cost, |before| before.cost),
            best: better.map_or(row.best, values),
            ..row
        }
    }
}
