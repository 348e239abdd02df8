//! Searches that are done before it is their turn, so that several nodes can do them at once.
//!
//! Searches do not depend on each other. Whoever has the run does them in their order, and reports each
//! generation in its order; others do some of those that follow, and tell in stretches of generations what
//! those looked like and where the search then was. Where a stretch is known it is taken over, and the
//! search goes on from its end: with the same bits, whoever did which part of it.

use super::observer::GenerationRow;
use super::search::{Search, State, Task};
use super::stop_reason::StopReason;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::sync::atomic::AtomicBool;

/// So many searches ahead for each node are done at the most: what they looked like waits in memory until it
/// is their turn.
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
pub enum SearchNews {
    /// Generations were judged.
    Judged(Box<Stretch>),
    /// Whoever has the run has come to this search.
    Begun(u32),
}

impl SearchNews {
    /// What tells it from other news of the same run. Of two with one name either will do.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            SearchNews::Judged(stretch) => {
                format!("search/{}/{}", stretch.search, stretch.after)
            }
            SearchNews::Begun(search) => format!("search/{search}/begun"),
        }
    }

    /// Which search it is about.
    pub(super) fn search(&self) -> u32 {
        match self {
            SearchNews::Judged(stretch) => stretch.search,
            SearchNews::Begun(search) => *search,
        }
    }

    /// The generations that it tells of.
    #[must_use]
    pub fn generations(&self) -> usize {
        match self {
            SearchNews::Judged(stretch) => stretch.rows.len(),
            SearchNews::Begun(_) => 0,
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
    /// Whether it has what has this number.
    #[must_use]
    pub fn has(self, number: u64) -> bool {
        number % u64::from(self.of.max(1)) == u64::from(self.index)
    }
}

/// Searches that others do, and the one that is done here for whoever has the run.
#[derive(Debug, Default)]
pub(super) struct Ahead {
    stretches: BTreeMap<(u32, u32), Stretch>,
    begun: BTreeSet<u32>,
    /// The search that is done here for others.
    own: Option<Search>,
}

impl Ahead {
    /// Takes note of what another node tells.
    pub fn hear(&mut self, news: SearchNews) {
        match news {
            SearchNews::Judged(stretch) => {
                let place = (stretch.search, stretch.after);
                self.stretches.entry(place).or_insert(*stretch);
            }
            SearchNews::Begun(search) => {
                self.begun.insert(search);
            }
        }
    }

    /// What is known of a search beyond so many of its generations.
    pub fn take(&mut self, search: u32, generations: u32) -> Option<Stretch> {
        let of_search = self.stretches.range((search, 0)..=(search, generations));
        let mut beyond = of_search.filter(|(_, one)| one.state.generation > generations);
        let place = *beyond.next()?.0;
        self.stretches.remove(&place)
    }

    /// Forgets the searches before one.
    pub fn forget_before(&mut self, search: u32) {
        self.stretches = self.stretches.split_off(&(search, 0));
        self.begun = self.begun.split_off(&search);
    }

    /// The furthest that is known of a search.
    fn furthest(&self, search: u32) -> Option<&Stretch> {
        let of_search = self.stretches.range((search, 0)..=(search, u32::MAX));
        of_search
            .map(|(_, one)| one)
            .max_by_key(|one| one.state.generation)
    }

    /// Which of some searches should be done here: one that was begun here, one of the share that nobody
    /// has begun, the last that nobody has begun, one that somebody may have left.
    fn choose(&self, share: Share, searches: Range<u32>) -> Option<u32> {
        let own = self.own.as_ref().map(Search::number);
        let has_ended = |search: &u32| {
            self.furthest(*search)
                .is_some_and(|last| last.stop.is_some())
        };
        let rank = |search: &u32| {
            let is_own = own == Some(*search);
            let is_begun = !is_own && self.furthest(*search).is_some();
            let is_of_share = share.has(u64::from(*search));
            let order = if is_of_share {
                *search
            } else {
                u32::MAX - *search
            };
            (!is_own, is_begun, !is_of_share, order)
        };
        let free = |search: &u32| own == Some(*search) || !self.begun.contains(search);
        searches
            .filter(|search| free(search) && !has_ended(search))
            .min_by_key(rank)
    }

    /// The searches of which some are done here: not too far ahead of the one that whoever has the run is at.
    fn within_reach(&self, share: Share, searches: Range<u32>) -> Range<u32> {
        let begun = self.begun.last().map_or(0, |begun| begun + 1);
        let next = searches.start.max(begun);
        let furthest = next.saturating_add(AHEAD_OF_EACH * share.of);
        next..searches.end.min(furthest)
    }

    /// Does at most so many generations of one of some searches; none where nothing is left to do.
    pub fn help(
        &mut self,
        task: &Task<'_>,
        (share, searches): (Share, Range<u32>),
        at_most: u32,
        stop: &AtomicBool,
    ) -> Option<Stretch> {
        // Only whoever has the run reports of them.
        self.stretches.values_mut().for_each(|one| one.rows.clear());
        let number = self.choose(share, self.within_reach(share, searches))?;
        let known = self.furthest(number).map(|last| last.state.clone());
        let reached = known.as_ref().map_or(0, |state| state.generation);
        let own = self.own.take().filter(|own| {
            let is_it = own.number() == number;
            is_it && own.state.generation >= reached
        });
        let mut search = match (own, known) {
            (Some(own), _) => own,
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
        self.own = Some(search);
        if stretch.rows.is_empty() {
            return None;
        }
        // What it looked like is for the others.
        let place = (number, after);
        let own = Stretch {
            rows: Vec::new(),
            ..stretch.clone()
        };
        self.stretches.insert(place, own);
        Some(stretch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHARE: Share = Share { index: 1, of: 3 };

    fn judged(search: u32, generations: u32, stop: Option<StopReason>) -> SearchNews {
        SearchNews::Judged(Box::new(Stretch {
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
    fn a_node_does_searches_of_its_share_then_those_that_come_last_then_those_that_were_left() {
        let mut ahead = Ahead::default();
        let mut order = Vec::new();
        ahead.hear(judged(5, 7, None));
        while let Some(next) = ahead.choose(SHARE, 1..8) {
            order.push(next);
            ahead.hear(SearchNews::Begun(next));
        }
        assert_eq!(order, [1, 4, 7, 6, 3, 2, 5]);
    }

    #[test]
    fn a_search_that_has_ended_is_done_by_nobody() {
        let mut ahead = Ahead::default();
        ahead.hear(judged(1, 7, Some(StopReason::Stagnation)));
        assert_eq!(ahead.choose(SHARE, 1..2), None);
    }

    #[test]
    fn searches_are_not_done_far_ahead_of_the_one_at_work() {
        let mut ahead = Ahead::default();
        assert_eq!(ahead.within_reach(SHARE, 1..32), 1..7);
        ahead.hear(SearchNews::Begun(9));
        assert_eq!(ahead.within_reach(SHARE, 1..32), 10..16);
        ahead.hear(SearchNews::Begun(31));
        assert!(ahead.within_reach(SHARE, 1..32).is_empty());
    }

    #[test]
    fn what_is_known_of_a_search_is_taken_from_where_it_is() {
        let mut ahead = Ahead::default();
        ahead.hear(judged(2, 7, None));
        assert!(ahead.take(1, 0).is_none() && ahead.take(2, 7).is_none());
        let known = ahead.take(2, 3).expect("four generations more");
        assert_eq!(known.state.generation, 7);
        assert!(ahead.take(2, 3).is_none(), "it was taken");
    }
}
