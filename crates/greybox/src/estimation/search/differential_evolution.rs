//! A generation of differential evolution on the objective of the hybrid search: to compare the two, and
//! to look for what the hybrid search has not found
//! ([`Settings::of_search`](crate::estimation::Settings::of_search)).

mod learnt;

pub use learnt::{Learnt, Parent};

use super::proposer::{Judgement, Proposer, ProposerContext};
use crate::estimation::objective::Evaluation;
use crate::estimation::settings::Settings;
use crate::genetic::{Chromosome, operators};
use greybox_numerics::rng::Purpose;
use std::sync::Arc;

/// Parents in the last generation. Each generation has as many as the one before, or fewer.
const FEWEST_PARENTS: u32 = 4;

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
        let most = parents_after(search.settings, search.state.generation);
        let state = &mut *search.state;
        let pairs = judged.population.iter().zip(judged.evaluations);
        let challengers = pairs.map(|(chromosome, evaluation)| challenger(chromosome, evaluation));
        let challengers = challengers.collect();
        state.learnt.challenge(&mut state.parents, challengers);
        state.parents.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        state.parents.truncate(most);
        state.learnt.forget_beyond(state.parents.len(), &mut rng);
        state
            .learnt
            .challengers(&state.parents, search.encoding, &mut rng)
    }
}

/// How many parents there are after a generation.
fn parents_after(settings: &Settings, generation: u32) -> usize {
    let fewest = FEWEST_PARENTS.min(settings.population);
    let share = f64::from(generation) / f64::from(settings.generations.max(1));
    let gone = f64::from(settings.population - fewest) * share.min(1.0);
    (settings.population - gone as u32) as usize
}

fn challenger(chromosome: &Chromosome, evaluation: &Arc<Evaluation>) -> Parent {
    Parent {
        chromosome: chromosome.clone(),
        cost: evaluation.failure.is_none().then_some(evaluation.cost),
    }
}
