//! What a computation and the other nodes that help with it have for each other.
//!
//! The computation asks between two units of work; the side that writes asks the store.

use std::ops::Range;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use super::run::{Run, Share};
use crate::store::SharedPart;

/// What a unit of work should take that is shared: others are told after each what was done.
const UNIT: Range<Duration> = Duration::from_millis(200)..Duration::from_millis(800);

/// How many pieces of work, refits or generations, a unit has, so that it takes about as long as it should.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace(u32);

impl Default for Pace {
    fn default() -> Self {
        Self(4)
    }
}

impl Pace {
    /// Pieces of the next unit at the most.
    pub(super) fn at_most(self) -> u32 {
        self.0
    }

    /// Notes how many pieces a unit had and how long it took.
    pub(super) fn note(&mut self, pieces: usize, took: Duration) {
        let was_full = pieces >= self.0 as usize;
        if took > UNIT.end {
            self.0 = (self.0 / 2).max(1);
        } else if was_full && took < UNIT.start {
            self.0 = self.0.saturating_mul(2);
        }
    }
}

/// The exchange of one slice.
#[derive(Debug, Default)]
pub(super) struct Exchange {
    /// Whether there are other nodes.
    has_others: bool,
    /// Whether they can begin: a checkpoint with what they begin from is stored.
    can_begin: bool,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Whether the computation takes what others did.
    is_wanted: bool,
    /// Which share of what is left is this node's.
    own: Option<Share>,
    came: Vec<SharedPart>,
    /// The number of the last part that came, and of the last that the run has.
    last: i64,
    heard: i64,
    pace: Pace,
}

impl Exchange {
    /// For a run that has the parts up to a number.
    pub(super) fn new(has_others: bool, can_begin: bool, heard: i64) -> Self {
        let state = State {
            last: heard,
            heard,
            ..State::default()
        };
        Self {
            has_others,
            can_begin,
            state: Mutex::new(state),
        }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the run what others did. Says whether the slice has to end first, with a checkpoint, so that
    /// they can begin.
    pub(super) fn give(&self, run: &mut dyn Run) -> bool {
        if !self.has_others || !run.is_shareable() {
            return false;
        }
        if !self.can_begin {
            return true;
        }
        let mut state = self.state();
        state.is_wanted = true;
        run.take_parts(std::mem::take(&mut state.came));
        state.heard = state.last;
        if let Some(own) = state.own {
            run.share(own, state.pace.at_most());
        }
        false
    }

    /// What the run did in a unit that took so long, for others.
    pub(super) fn take(&self, run: &mut dyn Run, took: Duration) -> Vec<SharedPart> {
        let parts = run.new_parts();
        let mut state = self.state();
        if state.is_wanted {
            state.pace.note(parts.len(), took);
        }
        drop(state);
        if self.has_others { parts } else { Vec::new() }
    }

    /// The number of the last part that came, where the computation takes what others did.
    pub(super) fn wanted_after(&self) -> Option<i64> {
        let state = self.state();
        state.is_wanted.then_some(state.last)
    }

    /// Brings what others did, up to the part with a number, and which share is this node's.
    pub(super) fn bring(&self, (parts, last): (Vec<SharedPart>, i64), own: Option<Share>) {
        let mut state = self.state();
        state.came.extend(parts);
        state.last = last;
        state.own = own;
    }

    /// The number of the last part that the run has.
    pub(super) fn heard(&self) -> i64 {
        self.state().heard
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_quick_pieces_have_many_and_of_slow_ones_few() {
        let settled = |of_one: Duration| {
            let mut pace = Pace::default();
            for _ in 0..40 {
                pace.note(pace.at_most() as usize, of_one * pace.at_most());
            }
            of_one * pace.at_most()
        };
        for of_one in [10, 1000, 30_000].map(Duration::from_micros) {
            let took = settled(of_one);
            assert!(UNIT.contains(&took), "{of_one:?}: {took:?}");
        }
        assert_eq!(settled(Duration::from_secs(5)), Duration::from_secs(5));
    }

    #[test]
    fn a_unit_that_found_little_left_to_do_says_nothing_of_the_next() {
        let mut pace = Pace::default();
        pace.note(0, Duration::from_millis(1));
        assert_eq!(pace.at_most(), Pace::default().at_most());
    }
}
