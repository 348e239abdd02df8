//! The hybrid neural-genetic search: the paper's section 3, a generation at a time.
//!
//! A generation is simulated, judged by the ICRA network and bred into the next one. Everything
//! that the next generation depends on stands in [`State`], and every random number comes from a
//! stream named by seed, generation and purpose: a search that is laid down after any generation
//! goes on with the same bits.

use super::cma_es::{self, Strategy};
use super::differential;
use super::evaluation_cache::EvaluationCache;
use super::hill_climb::HillClimb;
use super::leaders::{self, Judged};
use super::objective::{Evaluation, Objective};
use super::observer::{Counters, GenerationRow, Simulated};
use super::problem::Problem;
use super::settings::{BlockOrder, CreditForm, ErrorSpread, MethodName, Settings};
use super::stop_reason::{Stagnation, StopReason};
use crate::credit::{self, Credits, icra::Network, spread};
use crate::genetic::{Chromosome, Encoding, operators};
use crate::numerics::rng::{self, Purpose, stream};
use crate::numerics::statistics;
use crate::simulation::Accuracy;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A candidate that challengers are measured against.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Parent {
    /// Its string.
    pub chromosome: Chromosome,
    /// Its cost; none where it failed.
    pub cost: Option<f64>,
}

/// Everything that the next generation depends on.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct State {
    /// Generations judged.
    pub generation: u32,
    /// The candidates of the next generation.
    pub population: Vec<Chromosome>,
    /// The parents that the candidates challenge, in differential evolution.
    #[serde(default)]
    pub parents: Vec<Parent>,
    /// What the candidates are drawn from, in covariance matrix adaptation.
    #[serde(default)]
    pub strategy: Option<Strategy>,
    /// The generation after which this search began; those before belong to earlier ones.
    #[serde(default)]
    pub began: u32,
    /// The champion of the searches before.
    #[serde(default)]
    pub earlier: Option<Judged>,
    /// The best distinct candidates so far, the champion first.
    pub leaders: Vec<Judged>,
    /// The largest credit so far, and the generation that first had it.
    pub best_credit: Option<(f64, u32)>,
    /// The generation in which the champion was found.
    pub best_generation: Option<u32>,
    /// What has been done.
    pub counters: Counters,
    /// The champion that climbed last.
    #[serde(default)]
    pub climbed: Option<Chromosome>,
    /// How long nothing has been gained.
    pub stagnation: Stagnation,
}

/// The search of one run.
#[derive(Debug)]
pub struct Search {
    settings: Settings,
    seed: u64,
    encoding: Encoding,
    objective: Objective,
    memory: EvaluationCache,
    /// What no row has told of yet.
    simulated: Vec<Simulated>,
    /// What is laid down at a checkpoint.
    pub state: State,
}

/// A generation that has been judged.
#[derive(Debug)]
pub struct Generation {
    /// What it looked like.
    pub row: GenerationRow,
    /// Why the search ends with it, if it does.
    pub stop: Option<StopReason>,
}

impl Search {
    /// Begins a search.
    #[must_use]
    pub fn start(problem: &Problem, settings: &Settings, seed: u64) -> Search {
        let (population, strategy) = beginning(encoding(problem, settings), settings, seed, 0);
        let state = State {
            generation: 0,
            population,
            parents: Vec::new(),
            strategy,
            began: 0,
            earlier: None,
            leaders: Vec::new(),
            best_credit: None,
            best_generation: None,
            counters: Counters::default(),
            climbed: None,
            stagnation: Stagnation::default(),
        };
        Search::resume(problem, settings, seed, state)
    }

    /// Takes a search up where it was laid down.
    #[must_use]
    pub fn resume(problem: &Problem, settings: &Settings, seed: u64, state: State) -> Search {
        Search {
            settings: settings.clone(),
            seed,
            encoding: encoding(problem, settings),
            objective: Objective::new(problem, settings.block_samples as usize),
            memory: EvaluationCache::default(),
            simulated: Vec::new(),
            state,
        }
    }

    /// Begins another search after the last one, with another first population. What has been
    /// done goes on counting.
    pub fn restart(&mut self) {
        let state = &mut self.state;
        (state.population, state.strategy) =
            beginning(self.encoding, &self.settings, self.seed, state.generation);
        state.parents.clear();
        state.began = state.generation;
        let last = state.leaders.drain(..).next();
        let both = state.earlier.take().into_iter().chain(last);
        state.earlier = both.min_by(|a, b| a.cost.total_cmp(&b.cost));
        state.stagnation = Stagnation::default();
        state.climbed = None;
    }

    /// The best candidate of this search and those before.
    #[must_use]
    pub fn champion(&self) -> Option<&Judged> {
        let both = self.state.earlier.iter().chain(self.state.leaders.first());
        both.min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The positions of a candidate.
    #[must_use]
    pub fn positions(&self, chromosome: &Chromosome) -> Vec<f64> {
        self.encoding.decode(chromosome)
    }

    /// Judges one generation and breeds the next. Answers nothing, with nothing changed, when
    /// `stop` was raised.
    pub fn generation(&mut self, problem: &Problem, stop: &AtomicBool) -> Option<Generation> {
        let population = self.state.population.clone();
        if self.settings.name != MethodName::IcraGenetic {
            let evaluations = self.evaluate(problem, &population, stop)?;
            return Some(self.without_credits(problem, &population, &evaluations));
        }
        let elite = self.climber();
        let encoding = self.encoding;
        let (evaluations, climb) = rayon::join(
            || self.evaluate(problem, &population, stop),
            || match &elite {
                Some(elite) => HillClimb::from(problem, &encoding.decode(elite), stop),
                None => Some(HillClimb::default()),
            },
        );
        let (evaluations, climb) = (evaluations?, climb?);

        let credits = self.judge(&evaluations);
        let state = &mut self.state;
        state.generation += 1;
        state.counters.evaluations += population.len() as u64 + climb.evaluations;
        state.counters.distinct_evaluations += climb.evaluations;
        state.climbed = elite.or(state.climbed.take());
        self.remember_leaders(&population, &evaluations);
        self.remember_credit(&credits);
        let row = self.row(problem, &evaluations, Some(&credits));
        let stop = self.stop_reason();
        let at_floor = self.settings.noise_floor && climb.at_floor;
        let stop = at_floor.then_some(StopReason::NoiseFloor).or(stop);
        self.state.population = self.breed(&population, &evaluations, &credits, &climb.to);
        Some(Generation { row, stop })
    }

    /// A generation of one of the methods to compare with.
    fn without_credits(
        &mut self,
        problem: &Problem,
        population: &[Chromosome],
        evaluations: &[Arc<Evaluation>],
    ) -> Generation {
        self.state.generation += 1;
        self.state.counters.evaluations += population.len() as u64;
        self.remember_leaders(population, evaluations);
        let row = self.row(problem, evaluations, None);
        let stop = self.stop_reason();
        let mut rng = self.stream(Purpose::Mutation);
        let (state, encoding) = (&mut self.state, self.encoding);
        state.population = match &mut state.strategy {
            Some(strategy) => cma_es::next(strategy, evaluations, encoding, &mut rng),
            None => {
                let parents = &mut state.parents;
                *parents = differential::survivors(parents, population, evaluations);
                differential::challengers(parents, encoding, &mut rng)
            }
        };
        Generation { row, stop }
    }

    /// Simulates the candidates that have not been simulated before, as finely as ranking needs.
    fn evaluate(
        &mut self,
        problem: &Problem,
        population: &[Chromosome],
        stop: &AtomicBool,
    ) -> Option<Vec<Arc<Evaluation>>> {
        let mut known: HashSet<&Chromosome> = HashSet::new();
        let (places, fresh): (Vec<usize>, Vec<&Chromosome>) = population
            .iter()
            .enumerate()
            .filter(|(_, one)| self.memory.recall(one).is_none() && known.insert(one))
            .unzip();
        let positions: Vec<Vec<f64>> = fresh.iter().map(|c| self.encoding.decode(c)).collect();
        let evaluations = self
            .objective
            .evaluate(problem, &positions, Accuracy::Ranking, stop)?;
        let simulated = Simulated::of(problem, &places, &positions, &evaluations);
        self.simulated.extend(simulated);
        let counters = &mut self.state.counters;
        counters.distinct_evaluations += evaluations.len() as u64;
        let fresh: Vec<(Chromosome, Arc<Evaluation>)> = fresh
            .into_iter()
            .cloned()
            .zip(evaluations.into_iter().map(Arc::new))
            .collect();
        for failure in fresh
            .iter()
            .filter_map(|(_, evaluation)| evaluation.failure)
        {
            *counters.failed_evaluations.entry(failure).or_default() += 1;
        }
        let all = population
            .iter()
            .map(|candidate| {
                let just_now = fresh.iter().find(|(chromosome, _)| chromosome == candidate);
                just_now
                    .map(|(_, evaluation)| evaluation.clone())
                    .or_else(|| self.memory.recall(candidate))
                    .expect("every candidate was either remembered or just simulated")
            })
            .collect();
        for (chromosome, evaluation) in fresh {
            self.memory.remember(chromosome, evaluation);
        }
        Some(all)
    }

    /// Section 3.1: the ICRA network distributes credit over the generation, block after block,
    /// until the entropy criterion stops it.
    fn judge(&self, evaluations: &[Arc<Evaluation>]) -> Credits {
        let mut order: Vec<usize> = (0..self.objective.n_blocks()).collect();
        if self.settings.block_order == BlockOrder::Shuffled {
            rng::shuffle(&mut self.stream(Purpose::BlockOrder), &mut order);
        }
        let errors: Vec<Vec<f64>> = order
            .iter()
            .map(|&block| evaluations.iter().map(|e| e.block_errors[block]).collect())
            .collect();
        let updates = self
            .settings
            .credit_updates
            .map_or(order.len(), |limit| limit as usize);
        let updates = updates.min(order.len());
        let mean_errors: Vec<f64> = evaluations
            .iter()
            .map(|e| e.block_errors.iter().sum::<f64>() / e.block_errors.len() as f64)
            .collect();
        let growth = self.settings.credit_gain * updates as f64;
        let network = Network {
            form: match self.settings.credit_form {
                CreditForm::Paper => credit::Form::Paper,
                CreditForm::Hedge => credit::Form::Hedge,
            },
            gain: self.settings.credit_gain,
            spread: spread::error_spread(self.spread_rule(), &mean_errors, growth),
            updates,
        };
        credit::assign(&network, evaluations.len(), |block| &errors[block])
    }

    fn spread_rule(&self) -> spread::Rule {
        match self.settings.error_spread {
            ErrorSpread::Concentration => spread::Rule::Concentration(self.settings.entropy_target),
            ErrorSpread::MeanError => spread::Rule::MeanError,
            ErrorSpread::BestError => spread::Rule::BestError,
        }
    }

    /// Section 3.2: roulette by credit, crossover, mutation; then elitism.
    fn breed(
        &self,
        population: &[Chromosome],
        evaluations: &[Arc<Evaluation>],
        credits: &Credits,
        climbed: &[Vec<f64>],
    ) -> Vec<Chromosome> {
        let settings = &self.settings;
        let mut selection = self.stream(Purpose::Selection);
        let mut crossover = self.stream(Purpose::Crossover);
        let mut mutation = self.stream(Purpose::Mutation);
        let mut parent = || &population[operators::roulette(&credits.credit, &mut selection)];
        let mut next = Vec::with_capacity(population.len() + 1);
        while next.len() < population.len() {
            let parents = (parent(), parent());
            let cross = rng::unit(&mut crossover) < settings.crossover_probability;
            let parts = settings.crossover_parts as usize;
            let children = if cross {
                operators::cross(self.encoding, parents, parts, &mut crossover)
            } else {
                (parents.0.clone(), parents.1.clone())
            };
            for mut child in [children.0, children.1] {
                let probability = settings.mutation_probability;
                operators::mutate(self.encoding, &mut child, probability, &mut mutation);
                next.push(child);
            }
        }
        next.truncate(population.len());
        if settings.elitism {
            next[0] = self.elite(population, evaluations);
        }
        let places = next.iter_mut().skip(usize::from(settings.elitism));
        for (place, positions) in places.take(population.len() / 4).zip(climbed) {
            *place = self.encoding.encode(positions);
        }
        next
    }

    /// The candidate with the lowest cost over all the data, of this generation or before.
    fn elite(&self, population: &[Chromosome], evaluations: &[Arc<Evaluation>]) -> Chromosome {
        match self.state.leaders.first() {
            Some(champion) => champion.chromosome.clone(),
            None => population[index_of_best(evaluations)].clone(),
        }
    }

    /// Hill-climbing: now and then the champion takes least-squares steps, if it has not before.
    /// Where they lead, candidates of the next generation stand.
    fn climber(&self) -> Option<Chromosome> {
        let interval = self.settings.hill_climbing_interval;
        let due = interval > 0 && (self.state.generation + 1).is_multiple_of(interval);
        let champion = &self.state.leaders.first()?.chromosome;
        let is_new = self.state.climbed.as_ref() != Some(champion);
        (due && is_new).then(|| champion.clone())
    }

    fn remember_leaders(&mut self, population: &[Chromosome], evaluations: &[Arc<Evaluation>]) {
        for (chromosome, evaluation) in population.iter().zip(evaluations) {
            if evaluation.failure.is_none() {
                self.lead(Judged {
                    chromosome: chromosome.clone(),
                    cost: evaluation.cost,
                });
            }
        }
    }

    /// Enters a candidate among the leaders, where it belongs there.
    fn lead(&mut self, candidate: Judged) {
        let places = self.settings.refine_candidates.max(1) as usize;
        let cost = candidate.cost;
        let best_before = self.champion().map(|champion| champion.cost);
        let state = &mut self.state;
        leaders::enter(&mut state.leaders, candidate, places, self.encoding);
        if best_before.is_none_or(|before| cost < before) {
            state.best_generation = Some(state.generation);
        }
    }

    fn remember_credit(&mut self, credits: &Credits) {
        let best = largest(&credits.credit);
        if self
            .state
            .best_credit
            .is_none_or(|(credit, _)| best > credit)
        {
            self.state.best_credit = Some((best, self.state.generation));
        }
    }

    fn row(
        &mut self,
        problem: &Problem,
        evaluations: &[Arc<Evaluation>],
        credits: Option<&Credits>,
    ) -> GenerationRow {
        let simulated = std::mem::take(&mut self.simulated);
        let champion = self.champion();
        let costs = || {
            evaluations
                .iter()
                .map(|e| e.cost)
                .filter(|cost| cost.is_finite())
        };
        GenerationRow {
            generation: self.state.generation,
            evaluations: self.state.counters.evaluations,
            best_cost: champion.map_or(f64::INFINITY, |champion| champion.cost),
            generation_best_cost: costs().fold(f64::INFINITY, f64::min),
            mean_cost: statistics::mean(costs()),
            best_credit: credits.map_or(f64::NAN, |credits| largest(&credits.credit)),
            entropy: credits.map_or(f64::NAN, |credits| credits.entropy),
            credit_updates: credits.map_or(0, |credits| credits.updates as u32),
            best: champion.map_or_else(Vec::new, |champion| {
                problem.named_values(&self.encoding.decode(&champion.chromosome))
            }),
            simulated,
        }
    }

    fn stop_reason(&mut self) -> Option<StopReason> {
        let cost = self
            .state
            .leaders
            .first()
            .map_or(f64::INFINITY, |champion| champion.cost);
        let patience = self.settings.stagnation_generations;
        let stagnated = self.state.stagnation.observe(cost, patience);
        if self
            .settings
            .cost_target
            .is_some_and(|target| cost <= target)
        {
            Some(StopReason::CostTarget)
        } else if self.state.generation - self.state.began >= self.settings.generations {
            Some(StopReason::GenerationLimit)
        } else {
            stagnated.then_some(StopReason::Stagnation)
        }
    }

    fn stream(&self, purpose: Purpose) -> impl rng::Rng + use<> {
        stream(self.seed, u64::from(self.state.generation), purpose)
    }
}

fn encoding(problem: &Problem, settings: &Settings) -> Encoding {
    Encoding {
        bits: match settings.name {
            MethodName::CmaEs => cma_es::BITS,
            _ => settings.bits_per_parameter,
        },
        genes: problem.coordinates.len(),
    }
}

/// The first population of a search that begins after a generation, and what it was drawn from.
fn beginning(
    encoding: Encoding,
    settings: &Settings,
    seed: u64,
    generation: u32,
) -> (Vec<Chromosome>, Option<Strategy>) {
    let mut rng = stream(seed, u64::from(generation), Purpose::Population);
    let candidates = settings.population as usize;
    if settings.name == MethodName::CmaEs {
        let (population, strategy) = cma_es::beginning(encoding, candidates, &mut rng);
        return (population, Some(strategy));
    }
    let drawn = operators::random_population(encoding, candidates, &mut rng);
    (drawn, None)
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

fn largest(credits: &[f64]) -> f64 {
    credits.iter().copied().fold(0.0, f64::max)
}
