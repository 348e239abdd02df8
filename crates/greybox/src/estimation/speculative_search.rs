//! Searches that run before it is their turn, so that several nodes can run them at once.
//!
//! Searches do not depend on each other. The node that has the run works through the searches in their
//! order and reports each generation in its order. Other nodes work on searches that come later, and tell
//! in stretches of generations what these looked like and where the search then was. The node that has the
//! run takes a stretch over where it has come to a stretch's search, and goes on from the end of the stretch:
//! with the same bits, whichever node judged which generation.

use super::observer::GenerationRow;
use super::search::{Search, State, Task};
use super::stop_reason::StopReason;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::atomic::AtomicBool;

/// Searches that run ahead of their turn for each node at the most: their generations wait in memory until it
/// is the search's turn.
const AHEAD_OF_EACH: u32 = 2;
/// Values of candidates in a stretch at the most, unless one generation has more.
const MOST_VALUES: usize = 200_000;

/// Generations of a search, one after the other.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Stretch {
    /// The search, counted from 0.
    search: u32,
    /// Generations of the search before the stretch.
    after: u32,
    /// What each generation looked like, as the search counts.
    pub(super) rows: Vec<GenerationRow>,
    /// Where the search was after the stretch.
    pub(super) state: State,
    /// Why the search ended with the stretch, if it did.
    pub(super) stop: Option<StopReason>,
}

impl Stretch {
    /// Returns the rows that follow the first `generations` generations of the search.
    pub(super) fn rows_after(self, generations: u32) -> impl Iterator<Item = GenerationRow> {
        let known = generations.saturating_sub(self.after) as usize;
        self.rows.into_iter().skip(known)
    }
}

/// What one node tells the others of searches.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SearchUpdate {
    /// Generations were judged.
    Judged(Box<Stretch>),
    /// The node that has the run has come to this search.
    Begun(u32),
}

impl SearchUpdate {
    /// The name of the update within its run. Of two updates with one name either will do.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            SearchUpdate::Judged(stretch) => {
                format!("search/{}/{}", stretch.search, stretch.after)
            }
            SearchUpdate::Begun(search) => format!("search/{search}/begun"),
        }
    }

    /// The search that the update is about.
    pub(super) fn search(&self) -> u32 {
        match self {
            SearchUpdate::Judged(stretch) => stretch.search,
            SearchUpdate::Begun(search) => *search,
        }
    }

    /// How many generations the update tells of.
    #[must_use]
    pub fn generations(&self) -> usize {
        match self {
            SearchUpdate::Judged(stretch) => stretch.rows.len(),
            SearchUpdate::Begun(_) => 0,
        }
    }
}

/// One of the shares into which independent work is divided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Which, from 0.
    pub index: u32,
    /// Of how many.
    pub of: u32,
}

impl Share {
    /// Whether the work with this number belongs to the share.
    #[must_use]
    pub fn has(self, number: u64) -> bool {
        number % u64::from(self.of.max(1)) == u64::from(self.index)
    }
}

/// Searches that other nodes run, and the search that this node runs for the node that has the run.
#[derive(Debug, Default)]
pub(super) struct SpeculativeSearches {
    /// Stretches by their search and the generations before them.
    stretches: BTreeMap<(u32, u32), Stretch>,
    /// The searches that the node that has the run has come to.
    begun: BTreeSet<u32>,
    /// The search that this node runs ahead of its turn.
    at_work: Option<Search>,
}

impl SpeculativeSearches {
    /// Takes note of what another node did.
    pub fn apply(&mut self, update: SearchUpdate) {
        match update {
            SearchUpdate::Judged(stretch) => {
                let key = (stretch.search, stretch.after);
                self.stretches.entry(key).or_insert(*stretch);
            }
            SearchUpdate::Begun(search) => {
                self.begun.insert(search);
            }
        }
    }

    /// Takes out a stretch that leads a search beyond so many generations.
    pub fn take_beyond(&mut self, search: u32, generations: u32) -> Option<Stretch> {
        let of_search = self.stretches.range((search, 0)..=(search, generations));
        let mut beyond = of_search.filter(|(_, stretch)| stretch.state.generation > generations);
        let key = *beyond.next()?.0;
        self.stretches.remove(&key)
    }

    /// Forgets the searches before a search.
    pub fn forget_before(&mut self, search: u32) {
        self.stretches = self.stretches.split_off(&(search, 0));
        self.begun = self.begun.split_off(&search);
    }

    /// The stretch that leads a search furthest.
    fn furthest(&self, search: u32) -> Option<&Stretch> {
        let of_search = self.stretches.range((search, 0)..=(search, u32::MAX));
        of_search
            .map(|(_, stretch)| stretch)
            .max_by_key(|stretch| stretch.state.generation)
    }

    /// Chooses which of some searches this node should work on, not too far ahead of the search that the
    /// node with the run is at; none where nothing is left to do.
    pub fn next(&self, share: Share, searches: Range<u32>) -> Option<u32> {
        self.choose(share, self.within_reach(share, searches))
    }

    /// Chooses a search: one that was begun here, one of the share that no node has begun, the last that
    /// no node has begun, one that some node may have left.
    fn choose(&self, share: Share, searches: Range<u32>) -> Option<u32> {
        let at_work = self.at_work.as_ref().map(Search::number);
        let has_ended = |search: &u32| {
            self.furthest(*search)
                .is_some_and(|last| last.stop.is_some())
        };
        let rank = |search: &u32| {
            let is_at_work = at_work == Some(*search);
            let is_begun = !is_at_work && self.furthest(*search).is_some();
            let is_of_share = share.has(u64::from(*search));
            let order = if is_of_share {
                *search
            } else {
                u32::MAX - *search
            };
            (!is_at_work, is_begun, !is_of_share, order)
        };
        let free = |search: &u32| at_work == Some(*search) || !self.begun.contains(search);
        searches
            .filter(|search| free(search) && !has_ended(search))
            .min_by_key(rank)
    }

    /// The part of the searches that is not too far ahead of the search that the node with the run is at.
    fn within_reach(&self, share: Share, searches: Range<u32>) -> Range<u32> {
        let begun = self.begun.last().map_or(0, |begun| begun + 1);
        let next = searches.start.max(begun);
        let furthest = next.saturating_add(AHEAD_OF_EACH * share.of);
        next..searches.end.min(furthest)
    }

    /// Judges at most so many generations of a search; none where `stop` was raised before the first.
    pub fn judge(
        &mut self,
        task: &Task<'_>,
        number: u32,
        at_most: u32,
        stop: &AtomicBool,
    ) -> Option<Stretch> {
        // Only the node that has the run reports generations.
        let stretches = self.stretches.values_mut();
        stretches.for_each(|stretch| stretch.rows.clear());
        let reached = self.furthest(number).map(|last| last.state.clone());
        let generations = reached.as_ref().map_or(0, |state| state.generation);
        let at_work = self
            .at_work
            .take()
            .filter(|search| search.number() == number && search.state.generation >= generations);
        let mut search = match (at_work, reached) {
            (Some(at_work), _) => at_work,
            (None, Some(state)) => Search::resume(task, number, state),
            (None, None) => Search::start(task, number),
        };
        let after = search.state.generation;
        let mut rows = Vec::new();
        let mut ended = None;
        let most = (at_most as usize).min(task.most_generations(MOST_VALUES));
        while ended.is_none() && rows.len() < most {
            let Some(generation) = search.generation(task.problem, stop) else {
                break;
            };
            rows.push(generation.row);
            ended = generation.stop;
        }
        let stretch = Stretch {
            search: number,
            after,
            rows,
            state: search.state.clone(),
            stop: ended,
        };
        self.at_work = Some(search);
        if stretch.rows.is_empty() {
            return None;
        }
        // The rows are for the other nodes.
        let without_rows = Stretch {
            rows: Vec::new(),
            ..stretch.clone()
        };
        self.stretches.insert((number, after), without_rows);
        Some(stretch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHARE: Share = Share { index: 1, of: 3 };

    fn judged(search: u32, generations: u32, stop: Option<StopReason>) -> SearchUpdate {
        SearchUpdate::Judged(Box::new(Stretch {
            search,
            after: 0,
            rows: Vec::new(),
            state: State {
                generation: generations,
                ..State::default()
            },
            stop,
        }))
    }

    #[test]
    fn a_node_runs_searches_of_its_share_then_the_last_then_searches_that_were_left() {
        let mut ahead = SpeculativeSearches::default();
        let mut order = Vec::new();
        ahead.apply(judged(5, 7, None));
        while let Some(next) = ahead.choose(SHARE, 1..8) {
            order.push(next);
            ahead.apply(SearchUpdate::Begun(next));
        }
        assert_eq!(order, [1, 4, 7, 6, 3, 2, 5]);
    }

    #[test]
    fn a_search_that_has_ended_is_run_by_no_node() {
        let mut ahead = SpeculativeSearches::default();
        ahead.apply(judged(1, 7, Some(StopReason::Stagnation)));
        assert_eq!(ahead.choose(SHARE, 1..2), None);
    }

    #[test]
    fn searches_do_not_run_far_ahead_of_the_one_at_work() {
        let mut ahead = SpeculativeSearches::default();
        assert_eq!(ahead.within_reach(SHARE, 1..32), 1..7);
        ahead.apply(SearchUpdate::Begun(9));
        assert_eq!(ahead.within_reach(SHARE, 1..32), 10..16);
        ahead.apply(SearchUpdate::Begun(31));
        assert!(ahead.within_reach(SHARE, 1..32).is_empty());
    }

    #[test]
    fn a_stretch_is_taken_where_it_leads_further() {
        let mut ahead = SpeculativeSearches::default();
        ahead.apply(judged(2, 7, None));
        assert!(ahead.take_beyond(1, 0).is_none() && ahead.take_beyond(2, 7).is_none());
        let further = ahead.take_beyond(2, 3).expect("four generations more");
        assert_eq!(further.state.generation, 7);
        assert!(ahead.take_beyond(2, 3).is_none(), "it was taken");
    }
}
