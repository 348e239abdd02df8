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

/// Generations of a search, one after the other.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Stretch {
    /// Which search, from 0.
    search: u32,
    /// Generations of the search before.
    after: u32,
    /// What each looked like, as the search counts.
    pub(super) rows: Vec<GenerationRow>,
    /// Where the search then was.
    pub(super) state: State,
    /// Why the search ended with it, if it did.
    pub(super) stop: Option<StopReason>,
}

impl Stretch {
    /// Its rows that follow so many generations of the search.
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

    /// Does at most so many generations of one of some searches; none where nothing is left to do.
    pub fn help(
        &mut self,
        task: &Task<'_>,
        (share, searches): (Share, Range<u32>),
        at_most: u32,
        stop: &AtomicBool,
    ) -> Option<Stretch> {
        let number = self.choose(share, searches)?;
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
        while ended.is_none() && rows.len() < at_most as usize {
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
