//! The paper's method (section 3): the ICRA network assigns credits, from which a genetic
//! algorithm breeds; now and then the best candidate takes least-squares steps.

use super::proposer::{Judgement, Proposer, ProposerContext};
use crate::credit::{self, Credits, icra::Network, spread};
use crate::estimation::objective::Evaluation;
use crate::estimation::settings::{BlockOrder, CreditForm, ErrorSpread, Settings};
use crate::genetic::{Chromosome, operators};
use greybox_numerics::rng::{self, Purpose};
use std::sync::Arc;

/// ICRA credits and a genetic search.
#[derive(Debug)]
pub(super) struct IcraGenetic;

impl Proposer for IcraGenetic {
    fn begin(&self, search: &mut ProposerContext<'_>) -> Vec<Chromosome> {
        let candidates = search.settings.population as usize;
        let mut rng = search.stream(Purpose::Population);
        operators::random_population(search.encoding, candidates, &mut rng)
    }

    /// Hill-climbing: now and then the champion takes least-squares steps, if it has not before.
    /// Where they lead, candidates of the next generation stand.
    fn climber(&self, search: &ProposerContext<'_>) -> Option<Chromosome> {
        let interval = search.settings.hill_climbing_interval;
        let due = interval > 0 && (search.state.generation + 1).is_multiple_of(interval);
        let champion = &search.state.leaders.first()?.chromosome;
        let is_new = search.state.climbed.as_ref() != Some(champion);
        (due && is_new).then(|| champion.clone())
    }

    /// Section 3.1: the ICRA network distributes credit over the generation, block after block,
    /// until the entropy criterion stops it.
    fn credits(
        &self,
        search: &ProposerContext<'_>,
        evaluations: &[Arc<Evaluation>],
    ) -> Option<Credits> {
        let settings = &search.settings;
        let mut order: Vec<usize> = (0..search.objective.n_blocks()).collect();
        if settings.block_order == BlockOrder::Shuffled {
            rng::shuffle(&mut search.stream(Purpose::BlockOrder), &mut order);
        }
        let errors: Vec<Vec<f64>> = order
            .iter()
            .map(|&block| evaluations.iter().map(|e| e.block_errors[block]).collect())
            .collect();
        let updates = settings
            .credit_updates
            .map_or(order.len(), |limit| limit as usize);
        let updates = updates.min(order.len());
        let mean_errors: Vec<f64> = evaluations
            .iter()
            .map(|e| e.block_errors.iter().sum::<f64>() / e.block_errors.len() as f64)
            .collect();
        let growth = settings.credit_gain * updates as f64;
        let network = Network {
            form: match settings.credit_form {
                CreditForm::Paper => credit::Form::Paper,
                CreditForm::Hedge => credit::Form::Hedge,
            },
            gain: settings.credit_gain,
            spread: spread::error_spread(spread_rule(settings), &mean_errors, growth),
            updates,
        };
        Some(credit::assign(&network, evaluations.len(), |block| {
            &errors[block]
        }))
    }

    /// Section 3.2: roulette by credit, crossover, mutation; then elitism.
    fn next(&self, search: &mut ProposerContext<'_>, judged: &Judgement<'_>) -> Vec<Chromosome> {
        let (settings, encoding) = (&search.settings, search.encoding);
        let population = judged.population;
        let credits = judged.credits.expect("this method assigns credits");
        let mut selection = search.stream(Purpose::Selection);
        let mut crossover = search.stream(Purpose::Crossover);
        let mut mutation = search.stream(Purpose::Mutation);
        let mut parent = || &population[operators::roulette(&credits.credit, &mut selection)];
        let mut next = Vec::with_capacity(population.len() + 1);
        while next.len() < population.len() {
            let parents = (parent(), parent());
            let cross = rng::unit(&mut crossover) < settings.crossover_probability;
            let parts = settings.crossover_parts as usize;
            let children = if cross {
                operators::cross(encoding, parents, parts, &mut crossover)
            } else {
                (parents.0.clone(), parents.1.clone())
            };
            for mut child in [children.0, children.1] {
                let probability = settings.mutation_probability;
                operators::mutate(encoding, &mut child, probability, &mut mutation);
                next.push(child);
            }
        }
        next.truncate(population.len());
        if settings.elitism {
            next[0] = elite(search, judged);
        }
        let places = next.iter_mut().skip(usize::from(settings.elitism));
        for (place, positions) in places.take(population.len() / 4).zip(judged.climbed) {
            *place = encoding.encode(positions);
        }
        next
    }
}

fn spread_rule(settings: &Settings) -> spread::Rule {
    match settings.error_spread {
        ErrorSpread::Concentration => spread::Rule::Concentration(settings.entropy_target),
        ErrorSpread::MeanError => spread::Rule::MeanError,
        ErrorSpread::BestError => spread::Rule::BestError,
    }
}

/// The candidate with the lowest cost over all the data, of this generation or before.
fn elite(search: &ProposerContext<'_>, judged: &Judgement<'_>) -> Chromosome {
    match search.state.leaders.first() {
        Some(champion) => champion.chromosome.clone(),
        None => judged.population[index_of_best(judged.evaluations)].clone(),
    }
}

fn index_of_best(evaluations: &[Arc<Evaluation>]) -> usize {
    let costs = evaluations
        .iter()
        .map(|evaluation| evaluation.cost)
        .enumerate();
    costs
        .min_by(|(_, a), (_, b)| a.total_cmp(b))
        .map_or(0, |(index, _)| index)
}
