//! What a computation and the other nodes that help with it have for each other.
//!
//! The computation asks between two units of work; the side that writes asks the store.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::run::{Run, Share};
use crate::store::SharedRefit;

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
    came: Vec<SharedRefit>,
}

impl Exchange {
    pub(super) fn new(has_others: bool, can_begin: bool) -> Self {
        Self {
            has_others,
            can_begin,
            state: Mutex::default(),
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
        run.take_refits(std::mem::take(&mut state.came));
        if let Some(own) = state.own {
            run.share(own);
        }
        false
    }

    /// What the run did since this was asked for, for others.
    pub(super) fn take(&self, run: &mut dyn Run) -> Vec<SharedRefit> {
        let refits = run.new_refits();
        if self.has_others { refits } else { Vec::new() }
    }

    /// Whether the computation takes what others did.
    pub(super) fn is_wanted(&self) -> bool {
        self.state().is_wanted
    }

    /// Brings what others did, and which share is this node's.
    pub(super) fn bring(&self, refits: Vec<SharedRefit>, own: Option<Share>) {
        let mut state = self.state();
        state.came.extend(refits);
        state.own = own;
    }
}
