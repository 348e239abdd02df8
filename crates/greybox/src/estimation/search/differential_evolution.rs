//! A generation of differential evolution on the objective of the hybrid search, so that the two
//! can be compared.

use super::proposer::{Judgement, Proposer, ProposerContext};
use super::state::Parent;
use crate::estimation::objective::Evaluation;
use crate::genetic::{Chromosome, Encoding, differential, operators};
use greybox_numerics::rng::{Purpose, Rng};
use std::sync::Arc;

/// Differential evolution.
#[derive(Debug)]
pub(super) struct DifferentialEvolution;

impl Proposer for DifferentialEvolution {
    fn begin(&self, search: &mut ProposerContext<'_>) -> Vec<Chromosome> {
        let candidates = search.settings.population as usize;
        let mut rng = search.stream(Purpose::Population);
        operators::random_population(search.encoding, candidates, &mut rng)
    }

    fn next(&self, search: &mut ProposerContext<'_>, judged: &Judgement<'_>) -> Vec<Chromosome> {
        let mut rng = search.stream(Purpose::Mutation);
        let parents = &mut search.state.parents;
        *parents = survivors(parents, judged.population, judged.evaluations);
        challengers(parents, search.encoding, &mut rng)
    }
}

/// Lets the candidates challenge their parents: who costs less stays.
fn survivors(
    parents: &[Parent],
    population: &[Chromosome],
    evaluations: &[Arc<Evaluation>],
) -> Vec<Parent> {
    let challengers = population
        .iter()
        .zip(evaluations)
        .map(|(chromosome, evaluation)| Parent {
            chromosome: chromosome.clone(),
            cost: evaluation.failure.is_none().then_some(evaluation.cost),
        });
    if parents.len() != population.len() {
        return challengers.collect();
    }
    let pairs = parents.iter().zip(challengers);
    pairs
        .map(|(parent, challenger)| {
            if cost(&challenger) <= cost(parent) {
                challenger
            } else {
                parent.clone()
            }
        })
        .collect()
}

/// The next challengers.
fn challengers(parents: &[Parent], encoding: Encoding, rng: &mut impl Rng) -> Vec<Chromosome> {
    let positions: Vec<Vec<f64>> = parents
        .iter()
        .map(|parent| encoding.decode(&parent.chromosome))
        .collect();
    let best = (0..parents.len()).min_by(|a, b| cost(&parents[*a]).total_cmp(&cost(&parents[*b])));
    let trials = differential::trials(&positions, best.unwrap_or(0), rng);
    trials.iter().map(|trial| encoding.encode(trial)).collect()
}

fn cost(parent: &Parent) -> f64 {
    parent.cost.unwrap_or(f64::INFINITY)
}
