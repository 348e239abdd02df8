//! The parents of differential evolution, and what it has learnt from those that challenged them.

use crate::genetic::differential::{Breeding, Mixture, Success, SuccessHistory};
use crate::genetic::{Chromosome, Encoding};
use greybox_numerics::rng::{self, Rng};
use serde::{Deserialize, Serialize};

/// A candidate that challengers are measured against.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Parent {
    /// The string of the candidate.
    pub chromosome: Chromosome,
    /// The cost of the candidate; none where it failed.
    pub cost: Option<f64>,
}

impl Parent {
    /// The cost of the candidate; infinite where it failed.
    pub(super) fn cost(&self) -> f64 {
        self.cost.unwrap_or(f64::INFINITY)
    }
}

/// What differential evolution has learnt.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Learnt {
    /// How the candidates of the next generation were mixed.
    mixtures: Vec<Mixture>,
    /// Parents of before that a challenger has replaced.
    replaced: Vec<Chromosome>,
    history: SuccessHistory,
}

impl Learnt {
    /// Lets challengers, one for each parent, take the places of those that cost no less. Those of the first
    /// generation have no parents.
    pub(super) fn challenge(&mut self, parents: &mut Vec<Parent>, challengers: Vec<Parent>) {
        if parents.len() != challengers.len() {
            *parents = challengers;
            return;
        }
        let mut successes = Vec::new();
        for (place, challenger) in challengers.into_iter().enumerate() {
            let parent = &mut parents[place];
            if challenger.cost() > parent.cost() {
                continue;
            }
            if challenger.cost() < parent.cost() {
                let gain = parent.cost() - challenger.cost();
                let mixture = self.mixtures.get(place).filter(|_| gain.is_finite());
                successes.extend(mixture.map(|&mixture| Success { gain, mixture }));
                self.replaced.push(parent.chromosome.clone());
            }
            *parent = challenger;
        }
        self.history.learn(&successes);
    }

    /// Forgets replaced parents, drawn at random, until so many are left.
    pub(super) fn forget_beyond(&mut self, most: usize, rng: &mut impl Rng) {
        while self.replaced.len() > most {
            let place = rng::below(rng, self.replaced.len());
            self.replaced.swap_remove(place);
        }
    }

    /// The next challengers of parents, of which the best stands first.
    pub(super) fn challengers(
        &mut self,
        parents: &[Parent],
        encoding: Encoding,
        rng: &mut impl Rng,
    ) -> Vec<Chromosome> {
        let decoded = |parent: &Parent| encoding.decode(&parent.chromosome);
        let parents: Vec<Vec<f64>> = parents.iter().map(decoded).collect();
        let replaced = self.replaced.iter().map(|parent| encoding.decode(parent));
        let breeding = Breeding {
            parents: &parents,
            replaced: &replaced.collect::<Vec<_>>(),
            history: &self.history,
        };
        let trials = breeding.trials(rng);
        self.mixtures = trials.iter().map(|trial| trial.mixture).collect();
        let strings = trials.iter().map(|trial| encoding.encode(&trial.positions));
        strings.collect()
    }
}
