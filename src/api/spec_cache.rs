//! Which specifications were found to assemble, so that many jobs of one kind are checked once.
//!
//! Whether a problem can be assembled follows from the model, the recordings and what the
//! specification says of them, and from nothing else. Models and recordings never change under
//! their name, so what held once holds as long as they are there, which the store looks at in the
//! transaction that takes the job in.

use quick_cache::sync::Cache;
use serde::Serialize;
use sha2::{Digest, Sha256};

use greybox::identification::JobSpec;

/// Specifications that are remembered at the most.
const LIMIT: usize = 1024;

/// What a check came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SpecKey([u8; 32]);

/// What one candidate of each specification that passed lately takes, in derivatives.
pub struct SpecCache(Cache<SpecKey, u64>);

impl Default for SpecCache {
    fn default() -> Self {
        Self(Cache::new(LIMIT))
    }
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
            tolerances,
            constraints,
            priors,
            validation,
            process_noise,
            // How the parameters are looked for, what is said of them, and how the job is called.
            method: _,
            model_search: _,
            uncertainty: _,
            limits: _,
            seed: _,
            name: _,
            labels: _,
            note: _,
        } = spec;
        let data = (experiments, outputs, clock_tolerance, validation);
        let together = (constraints, priors, process_noise, tolerances);
        Self::digest(&(model, (parameters, together), data))
    }

    fn digest(what: &impl Serialize) -> Self {
        let text = serde_json::to_vec(what).expect("a specification has only text keys");
        Self(Sha256::digest(text).into())
    }
}

impl SpecCache {
    /// What one candidate of such a specification takes, in derivatives, if it has passed.
    pub fn get(&self, checked: SpecKey) -> Option<u64> {
        self.0.get(&checked)
    }

    /// Remembers one that has passed, with what one candidate of it takes.
    pub fn insert(&self, checked: SpecKey, derivatives: u64) {
        self.0.insert(checked, derivatives);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_specifications_that_are_remembered_are_bounded() {
        let specs = SpecCache::default();
        let passed: Vec<SpecKey> = (0..8 * LIMIT).map(|n| SpecKey::digest(&n)).collect();
        for checked in &passed {
            specs.insert(*checked, 7);
        }
        let known = passed.iter().filter_map(|checked| specs.get(*checked));
        let known: Vec<u64> = known.collect();
        assert!((1..=LIMIT).contains(&known.len()), "{}", known.len());
        assert!(known.iter().all(|derivatives| *derivatives == 7));
    }
}
