//! The refits that an analysis takes, hundreds of them, as pieces of work that are kept.
//!
//! An analysis that was interrupted is done again from the beginning, but takes over the refits
//! that were done; so it goes on where it was, with the same bits.
//!
//! Most of them are independent of each other. So that several nodes can do them at once, each goes through
//! the same analysis and does the refits of one share; what the analysis then comes to is of no use, the
//! refits are, for whoever does it in earnest.

use crate::estimation::problem::Problem;
use crate::estimation::{Share, refine};
use greybox_simulation::Accuracy;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::borrow::Borrow;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What a refit came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refit {
    /// Where the refit ended.
    pub positions: Vec<f64>,
    /// The cost at these positions; none where they could not be simulated.
    pub cost: Option<f64>,
}

/// Refits by their names, which say what is fitted.
pub type Done = BTreeMap<String, Refit>;

/// Name prefixes of the refits that do not depend on each other. The next part of a name says which
/// refits belong together.
const INDEPENDENT: [&str; 4] = ["bootstrap", "effects", "monte_carlo", "profile"];
/// Name prefix of the independent refits that have to be known, all that belong together, before
/// the analysis goes on.
const AWAITED: &str = "effects/";

/// Whether a refit belongs to a share; nothing where it is not independent of others.
fn is_of(share: Share, name: &str) -> Option<bool> {
    let mut parts = name.split('/');
    let (kind, which) = (parts.next()?, parts.next()?);
    INDEPENDENT
        .contains(&kind)
        .then(|| share.has(number_of(&format!("{kind}/{which}"))))
}

/// A number by which all nodes cut the refits into the same shares, whatever build each of them runs:
/// the first eight bytes of the SHA-256 of a name.
fn number_of(name: &str) -> u64 {
    let digest = Sha256::digest(name);
    digest[..8]
        .iter()
        .fold(0, |number, byte| number << 8 | u64::from(*byte))
}

/// The refits of one analysis.
#[derive(Debug)]
pub struct Refits {
    done: Mutex<Done>,
    /// The names of the refits that were done here.
    new: Mutex<Vec<String>>,
    /// The share of the independent refits that is done, where not all are, and whether refits that
    /// others follow from are done.
    share: Option<(Share, bool)>,
    /// How many refits may still be done before the analysis is interrupted to save them.
    left: AtomicU32,
    is_cut: AtomicBool,
}

impl Refits {
    /// Begins with no refit done, and with no limit to their number.
    #[must_use]
    pub fn unlimited() -> Refits {
        Refits::from(Done::new(), u32::MAX)
    }

    /// Goes on from the refits that are `done`, and interrupts the analysis after `at_most` more.
    #[must_use]
    pub fn from(done: Done, at_most: u32) -> Refits {
        Refits {
            done: Mutex::new(done),
            new: Mutex::default(),
            share: None,
            left: AtomicU32::new(at_most),
            is_cut: AtomicBool::new(false),
        }
    }

    /// Runs only the independent refits assigned to `share`; other independent refits are taken for
    /// refits that could not be fitted, or end the analysis where it needs them to go on. Refits
    /// that others follow from are done where `alone` says so, else they have to be known: without
    /// them the analysis ends.
    #[must_use]
    pub fn of(self, share: Share, alone: bool) -> Refits {
        Refits {
            share: Some((share, alone)),
            ..self
        }
    }

    /// Whether the analysis was interrupted because enough refits were done.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        self.is_cut.load(Ordering::Relaxed)
    }

    /// Returns all refits that are done, and the names of the refits that were done here.
    #[must_use]
    pub fn into_done(self) -> (Done, Vec<String>) {
        (opened(self.done), opened(self.new))
    }

    /// Descends from the start in a problem that `make` answers, or takes over the refit of that
    /// name. Answers nothing when `stop` was raised, when enough refits were done, or when the
    /// share leaves out a refit that the analysis needs.
    pub fn descend<P: Borrow<Problem>>(
        &self,
        name: String,
        make: impl FnOnce() -> (P, Vec<f64>),
        accuracy: Accuracy,
        stop: &AtomicBool,
    ) -> Option<Refit> {
        if let Some(known) = locked(&self.done).get(&name) {
            return Some(known.clone());
        }
        if let Some((share, alone)) = self.share
            && !is_of(share, &name).or(alone.then_some(true))?
        {
            let missing = Refit {
                positions: Vec::new(),
                cost: None,
            };
            return (!name.starts_with(AWAITED)).then_some(missing);
        }
        let take_one = |left: u32| left.checked_sub(1);
        let one = self
            .left
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, take_one);
        if one.is_err() {
            self.is_cut.store(true, Ordering::Relaxed);
            return None;
        }
        let (problem, start) = make();
        let descent = refine::descend(problem.borrow(), start, accuracy, stop)?;
        let refit = Refit {
            positions: descent.positions,
            cost: descent.cost,
        };
        locked(&self.new).push(name.clone());
        locked(&self.done).insert(name, refit.clone());
        Some(refit)
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn opened<T>(mutex: Mutex<T>) -> T {
    mutex.into_inner().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `printf profile/mass | sha256sum` begins with 18d4c88a0ce4da7c.
    #[test]
    fn every_build_cuts_the_same_shares() {
        assert_eq!(number_of("profile/mass"), 1_789_275_447_220_296_316);
    }

    #[test]
    fn shares_divide_what_is_independent_and_nothing_else() {
        let names: Vec<String> = (0..1000).map(|k| format!("bootstrap/{k}")).collect();
        for name in &names {
            let have = (0..3).filter(|index| {
                let share = Share {
                    index: *index,
                    of: 3,
                };
                is_of(share, name) == Some(true)
            });
            assert_eq!(have.count(), 1, "{name}");
        }
        let first = Share { index: 0, of: 3 };
        let own = names
            .iter()
            .filter(|name| is_of(first, name) == Some(true))
            .count();
        assert!((250..420).contains(&own), "{own}");
        // One step of a profile follows from the one before.
        assert_eq!(
            is_of(first, "profile/2/5e-1"),
            is_of(first, "profile/2/6e-1")
        );
        assert_eq!(is_of(first, "reweighted/1"), None);
    }
}
