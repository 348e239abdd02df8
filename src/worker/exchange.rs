//! The parts of a job that a computation and the nodes that help with it exchange.
//!
//! The computation collects and receives parts between two units of work; the task that writes asks the store.

use std::ops::Range;
use std::time::Duration;

use parking_lot::Mutex;

use super::run::{Run, Share};
use crate::store::SharedPart;

/// How long a unit of shared work should take: other nodes are told after each unit what was done.
const UNIT: Range<Duration> = Duration::from_millis(200)..Duration::from_millis(800);

/// How many pieces of work, refits or generations, a unit has, so that a unit takes about as long as it should.
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
    /// Whether helpers can begin: a checkpoint with what helpers begin from is stored.
    can_begin: bool,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Whether the computation takes parts of other nodes.
    is_wanted: bool,
    /// The share of the work left that this node begins with.
    share: Option<Share>,
    /// Parts that wait for the computation.
    received: Vec<SharedPart>,
    /// The number of the last part that was received.
    last_received: i64,
    /// The number of the last part that the run has.
    last_delivered: i64,
    pace: Pace,
}

impl Exchange {
    /// For a run that has the parts up to a number.
    pub(super) fn new(has_others: bool, can_begin: bool, last_part: i64) -> Self {
        let state = State {
            last_received: last_part,
            last_delivered: last_part,
            ..State::default()
        };
        Self {
            has_others,
            can_begin,
            state: Mutex::new(state),
        }
    }

    /// Hands the parts that wait to the run. Says whether the slice has to end first, with a checkpoint from
    /// which other nodes can begin.
    pub(super) fn deliver(&self, run: &mut dyn Run) -> bool {
        if !self.has_others || !run.is_shareable() {
            return false;
        }
        if !self.can_begin {
            return true;
        }
        let mut state = self.state.lock();
        state.is_wanted = true;
        run.take_parts(std::mem::take(&mut state.received));
        state.last_delivered = state.last_received;
        if let Some(share) = state.share {
            run.share(share, state.pace.at_most());
        }
        false
    }

    /// The parts that the run did in a unit of a duration, for other nodes.
    pub(super) fn collect(&self, run: &mut dyn Run, took: Duration) -> Vec<SharedPart> {
        let parts = run.new_parts();
        let mut state = self.state.lock();
        if state.is_wanted {
            state.pace.note(parts.len(), took);
        }
        drop(state);
        if self.has_others { parts } else { Vec::new() }
    }

    /// The number of the last part that was received, where the computation takes parts of other nodes.
    pub(super) fn wanted_after(&self) -> Option<i64> {
        let state = self.state.lock();
        state.is_wanted.then_some(state.last_received)
    }

    /// Receives parts of other nodes up to the part with the number `last`, and the share of this node.
    pub(super) fn receive(&self, parts: Vec<SharedPart>, last: i64, share: Option<Share>) {
        let mut state = self.state.lock();
        state.received.extend(parts);
        state.last_received = last;
        state.share = share;
    }

    /// The number of the last part that the run has.
    pub(super) fn last_part(&self) -> i64 {
        self.state.lock().last_delivered
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
