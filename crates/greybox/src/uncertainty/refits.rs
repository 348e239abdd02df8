//! The refits that an analysis asks for: hundreds of descents, which are saved one by one and which
//! several nodes can divide among them.
//!
//! A step of the analysis asks for sequences of refits. Within a sequence each
//! refit starts from what the one before came to; the sequences of one step do not depend on each
//! other, so they run in parallel, in any order, on any node.

mod name;

pub use name::RefitName;

use crate::estimation::problem::Problem;
use crate::estimation::{Share, refine};
use greybox_simulation::Accuracy;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

/// What a refit came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refit {
    /// Where the refit ended.
    pub positions: Vec<f64>,
    /// The cost at these positions; none where they could not be simulated.
    pub cost: Option<f64>,
    /// Where the refit is a stretch of the chains of a posterior, whose positions then stand one after the
    /// other, the logarithm of the density of each chain.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub log_densities: Vec<f64>,
}

/// What a refit fits.
pub(super) struct RefitTask<'a> {
    pub problem: Cow<'a, Problem>,
    pub start: Vec<f64>,
    pub accuracy: Accuracy,
}

impl RefitTask<'_> {
    /// Descends from the start. Answers nothing when `stop` was raised.
    pub fn run(self, stop: &AtomicBool) -> Option<Refit> {
        let descent = refine::descend(&self.problem, self.start, self.accuracy, stop)?;
        Some(Refit {
            positions: descent.positions,
            cost: descent.cost,
            log_densities: Vec::new(),
        })
    }
}

/// Refits of which each follows from the one before.
pub(super) trait RefitSequence: Send {
    /// Returns the name of the next refit; none where the sequence has ended.
    fn next(&self) -> Option<RefitName>;

    /// Returns for how many refits of a quota the next one counts.
    fn effort(&self) -> u32 {
        1
    }

    /// Runs the next refit. Answers nothing when `stop` was raised.
    fn run(&self, stop: &AtomicBool) -> Option<Refit>;

    /// Goes on from what the next refit came to. Answers nothing, with nothing changed, when `stop`
    /// was raised.
    fn follow(&mut self, refit: &Refit, stop: &AtomicBool) -> Option<()>;
}

/// How the nodes divide the refits of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Division {
    /// This node runs all refits, in the order in which the step lists them.
    Undivided,
    /// This node runs all refits, those of its share first and then those of the other shares, in
    /// the reverse of the order in which the other nodes come to them.
    StartingWith(Share),
    /// This node runs only the refits of a share, and none that all other refits wait for.
    Only(Share),
}

impl Division {
    /// Returns when a refit's turn is, the lowest first; none where another node runs it.
    fn turn(self, name: &RefitName) -> Option<u32> {
        match self {
            Division::Undivided => Some(0),
            Division::Only(share) => share.has(name.number()?).then_some(0),
            Division::StartingWith(Share { index, of }) => {
                let Some(number) = name.number() else {
                    return Some(0);
                };
                let share = (number % u64::from(of.max(1))) as u32;
                Some((index + of - share) % of.max(1))
            }
        }
    }
}

/// The refits that a node runs before it saves what has finished.
#[derive(Clone, Copy, Debug)]
pub struct Quota {
    /// Which refits the node runs, and in which order.
    pub division: Division,
    /// How many refits it runs at the most.
    pub at_most: u32,
}

impl Quota {
    /// All refits.
    pub const UNLIMITED: Quota = Quota {
        division: Division::Undivided,
        at_most: u32::MAX,
    };
}

/// The finished refits of an analysis.
#[derive(Clone, Debug, Default)]
pub struct Refits {
    finished: BTreeMap<RefitName, Refit>,
    /// The names of the refits that were run here since they were last asked for.
    new: Vec<RefitName>,
}

impl From<BTreeMap<RefitName, Refit>> for Refits {
    fn from(finished: BTreeMap<RefitName, Refit>) -> Refits {
        Refits {
            finished,
            new: Vec::new(),
        }
    }
}

impl Refits {
    /// All finished refits.
    #[must_use]
    pub fn finished(&self) -> &BTreeMap<RefitName, Refit> {
        &self.finished
    }

    /// How many stretches of the chains of a posterior have finished.
    #[must_use]
    pub fn stretches_of_chains(&self) -> u32 {
        let names = self.finished.keys();
        let stretches = names.filter(|name| matches!(name, RefitName::Posterior { .. }));
        stretches.count() as u32
    }

    /// Adds a refit that another node ran, by the text of its name. A text that names no refit adds
    /// nothing: the refit is then run here.
    pub fn add(&mut self, name: &str, refit: Refit) {
        if let Ok(name) = name.parse() {
            self.finished.insert(name, refit);
        }
    }

    /// Returns the refits that were run here since this was last called.
    pub fn take_new(&mut self) -> Vec<(RefitName, Refit)> {
        let names = std::mem::take(&mut self.new).into_iter();
        names
            .filter_map(|name| {
                let refit = self.finished.get(&name)?.clone();
                Some((name, refit))
            })
            .collect()
    }

    /// Takes the sequences as far as finished refits lead, then runs further refits up to the quota;
    /// answers how many it ran. It runs fewer where the sequences end, and when `stop` was raised.
    pub(super) fn run(
        &mut self,
        sequences: &mut [&mut dyn RefitSequence],
        quota: Quota,
        stop: &AtomicBool,
    ) -> u32 {
        self.run_all(sequences.iter_mut(), 0, stop);
        let mut by_turn: BTreeMap<u32, Vec<&mut &mut dyn RefitSequence>> = BTreeMap::new();
        for sequence in sequences.iter_mut() {
            if let Some(turn) = sequence.next().and_then(|name| quota.division.turn(&name)) {
                by_turn.entry(turn).or_default().push(sequence);
            }
        }
        let mut left = quota.at_most;
        for sequences in by_turn.into_values() {
            let first = sequences.into_iter().take(left as usize);
            left -= self.run_all(first, left, stop);
        }
        quota.at_most - left
    }

    /// Runs sequences side by side until they end or `at_most` refits were run; answers how many.
    fn run_all<'s, 'd: 's>(
        &mut self,
        sequences: impl Iterator<Item = &'s mut &'d mut dyn RefitSequence>,
        at_most: u32,
        stop: &AtomicBool,
    ) -> u32 {
        let left = AtomicU32::new(at_most);
        let sequences: Vec<_> = sequences.collect();
        let runs: Vec<Vec<(RefitName, Refit)>> = sequences
            .into_par_iter()
            .map(|sequence| self.run_one(&mut **sequence, &left, stop))
            .collect();
        let runs = runs.into_iter().flatten();
        let n_before = self.new.len();
        for (name, refit) in runs {
            self.new.push(name.clone());
            self.finished.insert(name, refit);
        }
        (self.new.len() - n_before) as u32
    }

    /// Takes a sequence from refit to refit while there are finished ones, or `left` allows to run
    /// another; answers those that were run.
    fn run_one(
        &self,
        sequence: &mut dyn RefitSequence,
        left: &AtomicU32,
        stop: &AtomicBool,
    ) -> Vec<(RefitName, Refit)> {
        let is_allowed = |effort: u32| {
            let take = |left: u32| (left > 0).then(|| left.saturating_sub(effort));
            left.fetch_update(Ordering::Relaxed, Ordering::Relaxed, take)
        };
        let mut new = Vec::new();
        while let Some(name) = sequence.next() {
            let finished = self.finished.get(&name).cloned();
            let is_new = finished.is_none();
            let allowed = || is_allowed(sequence.effort()).ok();
            let run = || allowed().and_then(|_| sequence.run(stop));
            let Some(refit) = finished.or_else(run) else {
                break;
            };
            if is_new {
                new.push((name, refit.clone()));
            }
            if sequence.follow(&refit, stop).is_none() {
                break;
            }
        }
        new
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OF: u32 = 3;

    fn share(index: u32) -> Share {
        Share { index, of: OF }
    }

    fn bootstrap() -> impl Iterator<Item = RefitName> {
        (0..1000).map(|sample| RefitName::Bootstrap { sample })
    }

    #[test]
    fn shares_divide_what_is_independent_and_nothing_else() {
        for name in bootstrap() {
            let takers =
                (0..OF).filter(|index| Division::Only(share(*index)).turn(&name).is_some());
            assert_eq!(takers.count(), 1, "{name}");
        }
        let first = Division::Only(share(0));
        let taken = bootstrap().filter(|name| first.turn(name).is_some());
        let taken = taken.count();
        assert!((250..420).contains(&taken), "{taken}");
        // One step of a profile follows from the one before.
        let profile = |position| first.turn(&RefitName::profile(2, position));
        assert_eq!(profile(0.5), profile(0.6));
        let awaited = RefitName::Reweighted { round: 1 };
        assert_eq!(first.turn(&awaited), None);
    }

    #[test]
    fn a_node_begins_with_its_share_and_comes_to_the_one_after_it_last() {
        for name in bootstrap().take(20) {
            let turn = |index| Division::StartingWith(share(index)).turn(&name);
            let of = (0..OF).find(|index| Division::Only(share(*index)).turn(&name).is_some());
            let of = of.expect("one node runs it");
            assert_eq!(turn(of), Some(0));
            assert_eq!(turn((of + 1) % OF), Some(1));
            assert_eq!(turn((of + 2) % OF), Some(2));
        }
        let awaited = RefitName::Reweighted { round: 1 };
        assert_eq!(Division::StartingWith(share(2)).turn(&awaited), Some(0));
    }
}
