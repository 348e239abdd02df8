//! Which specifications were found to assemble, so that many jobs of one kind are checked once.
//!
//! Whether a problem can be assembled follows from the model, the recordings and what the
//! specification says of them, and from nothing else. Models and recordings never change under
//! their name, so what held once holds as long as they are there, which the store looks at in the
//! transaction that takes the job in.

use std::collections::{HashMap, VecDeque};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use sha2::{Digest, Sha256};

use greybox::identification::JobSpec;

/// Specifications that are remembered at the most.
const LIMIT: usize = 1024;

/// What a check came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SpecKey([u8; 32]);

/// The specifications that passed lately.
#[derive(Default)]
pub struct SpecCache(Mutex<Passed>);

#[derive(Default)]
struct Passed {
    /// What one candidate of each takes, in derivatives.
    known: HashMap<SpecKey, u64>,
    /// The oldest first.
    order: VecDeque<SpecKey>,
}

impl SpecKey {
    /// All that the check of a specification depends on.
    pub fn of(spec: &JobSpec) -> Self {
        let JobSpec {
            model,
            experiments,
            parameters,
            outputs,
            clock_tolerance,
            constraints,
            priors,
            validation,
            // How the parameters are looked for, what is said of them, and how the job is called.
            method: _,
            model_search: _,
            uncertainty: _,
            limits: _,
            seed: _,
            name: _,
            labels: _,
        } = spec;
        let data = (experiments, outputs, clock_tolerance, validation);
        Self::digest(&(model, (parameters, constraints, priors), data))
    }

    fn digest(what: &impl Serialize) -> Self {
        let text = serde_json::to_vec(what).expect("a specification has only text keys");
        Self(Sha256::digest(text).into())
    }
}

impl SpecCache {
    /// What one candidate of such a specification takes, in derivatives, if it has passed.
    pub fn get(&self, checked: SpecKey) -> Option<u64> {
        let passed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        passed.known.get(&checked).copied()
    }

    /// Remembers one that has passed, with what one candidate of it takes.
    pub fn insert(&self, checked: SpecKey, derivatives: u64) {
        let mut passed = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if passed.known.insert(checked, derivatives).is_some() {
            return;
        }
        passed.order.push_back(checked);
        if passed.order.len() > LIMIT
            && let Some(oldest) = passed.order.pop_front()
        {
            passed.known.remove(&oldest);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specifications_that_are_remembered_are_bounded() {
        let specs = SpecCache::default();
        let passed: Vec<SpecKey> = (0..=LIMIT).map(|n| SpecKey::digest(&n)).collect();
        for checked in passed.iter().chain(&passed[1..]) {
            specs.insert(*checked, 7);
        }
        assert_eq!(specs.get(passed[0]), None, "the oldest makes room");
        assert!(
            passed[1..]
                .iter()
                .all(|checked| specs.get(*checked) == Some(7))
        );
    }
}
