//! The refits that an analysis takes, hundreds of them, as pieces of work that are kept.
//!
//! An analysis that was interrupted is done again from the beginning, but takes over the refits
//! that were done; so it goes on where it was, with the same bits.

use crate::estimation::problem::Problem;
use crate::estimation::refine;
use crate::simulation::Accuracy;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};

/// What a refit came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refit {
    /// Where it ended.
    pub positions: Vec<f64>,
    /// The cost there; none where it could not be simulated.
    pub cost: Option<f64>,
}

/// Refits by their names, which say what is fitted.
pub type Done = BTreeMap<String, Refit>;

/// The refits of one analysis.
#[derive(Debug)]
pub struct Refits {
    done: Mutex<Done>,
    /// How many may still be done before the analysis is interrupted, so that they can be saved.
    left: AtomicU32,
    is_cut: AtomicBool,
}

impl Refits {
    /// None done, and no end to them.
    #[must_use]
    pub fn unlimited() -> Refits {
        Refits::from(Done::new(), u32::MAX)
    }

    /// Goes on from those that are done, and interrupts the analysis after so many more.
    #[must_use]
    pub fn from(done: Done, at_most: u32) -> Refits {
        Refits {
            done: Mutex::new(done),
            left: AtomicU32::new(at_most),
            is_cut: AtomicBool::new(false),
        }
    }

    /// Whether the analysis was interrupted because there were enough of them.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
    }

    /// Those that are done.
    #[must_use]
    pub fn into_done(self) -> Done {
        self.done
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Descends from a start, or takes over what came of that. Answers nothing when `stop` was
    /// raised, or when there were enough.
    pub fn descend(
        &self,
        name: String,
        (problem, start): (&Problem, Vec<f64>),
        accuracy: Accuracy,
        stop: &AtomicBool,
    ) -> Option<Refit> {
        let lock = || self.done.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = lock().get(&name) {
            return Some(known.clone());
        }
        let take_one = |left: u32| left.checked_sub(1);
        let one = self
            .left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, take_one);
        if one.is_err() {
            self.is_cut.store(true, Ordering::Relaxed);
            return None;
        }
        let descent = refine::descend(problem, start, accuracy, stop)?;
        let refit = Refit {
            positions: descent.positions,
            cost: descent.cost,
        };
        lock().insert(name, refit.clone());
        Some(refit)
    }
}
