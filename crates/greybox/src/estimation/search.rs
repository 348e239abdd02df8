//! The search, a generation at a time: simulated, judged, and bred into the next one.
//!
//! How a generation is judged and what follows it is the method's (`proposer`).
//! Everything that the next generation depends on stands in [`State`], and every random number
//! comes from a stream named by seed, search, generation and purpose: a search that is saved after any
//! generation goes on with the same bits, and of several none depends on another.

pub mod cma_es;
pub mod differential_evolution;
pub(super) mod icra_genetic;
pub(super) mod proposer;
mod state;

pub use state::State;

use super::evaluation_cache::EvaluationCache;
use super::feasible;
use super::floor::Landmarks;
use super::hill_climb::HillClimb;
use super::leaders::{self, Judged};
use super::objective::{Evaluation, Objective};
use super::observer::{GenerationRow, Simulated};
use super::problem::Problem;
use super::settings::{MethodName, Settings};
use super::stop_reason::StopReason;
use crate::credit::Credits;
use crate::genetic::{Chromosome, Encoding};
use cma_es::CmaEs;
use differential_evolution::DifferentialEvolution;
use greybox_numerics::statistics;
use greybox_simulation::Accuracy;
use icra_genetic::IcraGenetic;
use proposer::{Judgement, Proposer, ProposerContext};
use std::collections::HashSet;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// On a plateau nothing may be gained for so many times as many generations.
const PLATEAU_PATIENCE: u32 = 5;

/// What all searches of a run have in common.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// What is searched.
    pub problem: &'a Problem,
    /// How.
    pub settings: &'a Settings,
    /// The seed of the run's random numbers.
    pub seed: u64,
    /// What is known of the cost beforehand, where the search judges the free run.
    pub landmarks: Option<Landmarks>,
}

impl Task<'_> {
    /// Generations whose candidates have so many values at the most; one at the least.
    pub(super) fn most_generations(&self, values: usize) -> usize {
        let of_candidate = self.problem.coordinates.len() + 3;
        let of_generation = of_candidate * self.settings.population as usize;
        (values / of_generation.max(1)).max(1)
    }
}

/// A search of a run.
#[derive(Debug)]
pub struct Search {
    settings: Settings,
    seed: u64,
    /// Which of the run's searches it is, from 0.
    number: u32,
    proposer: &'static dyn Proposer,
    encoding: Encoding,
    objective: Objective,
    cache: EvaluationCache,
    landmarks: Option<Landmarks>,
    /// Where all constraints hold, if there are any.
    inside: Option<Vec<f64>>,
    /// Simulated candidates that are in no row yet.
    simulated: Vec<Simulated>,
    /// What a checkpoint saves.
    pub state: State,
}

/// A generation that has been judged.
#[derive(Debug)]
pub struct Generation {
    /// The row that tells of the generation.
    pub row: GenerationRow,
    /// Why the search ends with it, if it does.
    pub stop: Option<StopReason>,
}

impl Search {
    /// Begins the search with a number.
    #[must_use]
    pub fn start(task: &Task<'_>, number: u32) -> Search {
        let mut search = Search::resume(task, number, State::default());
        search.state.population = search.proposer.begin(&mut search.context());
        search
    }

    /// What the proposer sees.
    fn context(&mut self) -> ProposerContext<'_> {
        ProposerContext {
            settings: &self.settings,
            encoding: self.encoding,
            objective: &self.objective,
            seed: self.seed,
            number: self.number,
            state: &mut self.state,
        }
    }

    /// Resumes a search where it was saved.
    #[must_use]
    pub fn resume(task: &Task<'_>, number: u32, state: State) -> Search {
        let Task {
            problem,
            settings,
            seed,
            landmarks,
        } = *task;
        let settings = settings.of_search(number, problem.coordinates.len());
        let proposer = proposer_of(settings.name);
        Search {
            seed,
            number,
            proposer,
            encoding: encoding(problem, &settings, proposer),
            objective: Objective::new(problem, settings.block_samples as usize),
            cache: EvaluationCache::default(),
            landmarks,
            inside: feasible::inside_of_constraints(problem),
            simulated: Vec::new(),
            state,
            settings,
        }
    }

    /// Which of the run's searches it is, from 0.
    #[must_use]
    pub fn number(&self) -> u32 {
        self.number
    }

    /// The best candidate.
    #[must_use]
    pub fn champion(&self) -> Option<&Judged> {
        self.state.leaders.first()
    }

    /// The positions of a candidate: where its string breaks a constraint, those of its mirror
    /// image on the other side.
    #[must_use]
    pub fn positions(&self, problem: &Problem, chromosome: &Chromosome) -> Vec<f64> {
        let decoded = self.encoding.decode(chromosome);
        feasible::mirrored(problem, self.inside.as_deref(), decoded)
    }

    /// Judges one generation and breeds the next. Answers nothing, with nothing changed, when
    /// `stop` was raised.
    pub fn generation(&mut self, problem: &Problem, stop: &AtomicBool) -> Option<Generation> {
        let population = self.state.population.clone();
        let proposer = self.proposer;
        let climber = proposer.climber(&self.context());
        let climber_at = climber.as_ref().map(|from| self.positions(problem, from));
        let (evaluations, climb) = rayon::join(
            || self.evaluate(problem, &population, stop),
            || match &climber_at {
                Some(from) => HillClimb::from(problem, from, stop),
                None => Some(HillClimb::default()),
            },
        );
        let (evaluations, climb) = (evaluations?, climb?);

        let credits = proposer.credits(&self.context(), &evaluations);
        let state = &mut self.state;
        state.generation += 1;
        state.counters.evaluations += population.len() as u64 + climb.evaluations;
        state.counters.distinct_evaluations += climb.evaluations;
        state.climbed = climber.or(state.climbed.take());
        self.remember_leaders(&population, &evaluations);
        if let Some(credits) = &credits {
            self.remember_credit(credits);
        }
        let row = self.row(problem, &evaluations, credits.as_ref());
        let stop = self.stop_reason();
        let at_floor = self.settings.noise_floor && climb.at_floor;
        let stop = at_floor.then_some(StopReason::NoiseFloor).or(stop);
        let judged = Judgement {
            population: &population,
            evaluations: &evaluations,
            credits: credits.as_ref(),
            climbed: &climb.to,
        };
        self.state.population = proposer.next(&mut self.context(), &judged);
        Some(Generation { row, stop })
    }

    /// Simulates the candidates that have not been simulated before, as finely as ranking needs.
    fn evaluate(
        &mut self,
        problem: &Problem,
        population: &[Chromosome],
        stop: &AtomicBool,
    ) -> Option<Vec<Arc<Evaluation>>> {
        let mut listed: HashSet<&Chromosome> = HashSet::new();
        let (places, fresh): (Vec<usize>, Vec<&Chromosome>) = population
            .iter()
            .enumerate()
            .filter(|(_, candidate)| {
                self.cache.recall(candidate).is_none() && listed.insert(candidate)
            })
            .unzip();
        let positions: Vec<Vec<f64>> = fresh.iter().map(|c| self.positions(problem, c)).collect();
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
                    .or_else(|| self.cache.recall(candidate))
                    .expect("every candidate was either remembered or just simulated")
            })
            .collect();
        for (chromosome, evaluation) in fresh {
            self.cache.remember(chromosome, evaluation);
        }
        Some(all)
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
                problem.named_values(&self.positions(problem, &champion.chromosome))
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
        // A plateau is crossed by chance, which takes longer than to lose a valley.
        let on_plateau = self
            .landmarks
            .is_some_and(|landmarks| landmarks.is_plateau(cost));
        let patience = match self.settings.stagnation_generations {
            patience if on_plateau => patience.saturating_mul(PLATEAU_PATIENCE),
            patience => patience,
        };
        let stagnated = self.state.stagnation.observe(cost, patience);
        if self
            .settings
            .cost_target
            .is_some_and(|target| cost <= target)
        {
            Some(StopReason::CostTarget)
        } else if self.state.generation >= self.settings.generations {
            Some(StopReason::GenerationLimit)
        } else {
            stagnated.then_some(StopReason::Stagnation)
        }
    }
}

fn encoding(problem: &Problem, settings: &Settings, proposer: &dyn Proposer) -> Encoding {
    Encoding {
        bits: proposer.bits(settings),
        genes: problem.coordinates.len(),
    }
}

fn largest(credits: &[f64]) -> f64 {
    credits.iter().copied().fold(0.0, f64::max)
}

/// The proposer of a method.
fn proposer_of(name: MethodName) -> &'static dyn Proposer {
    match name {
        // Multistart refines from random points and never asks for a generation.
        MethodName::IcraGenetic | MethodName::MultistartLm => &IcraGenetic,
        MethodName::DifferentialEvolution => &DifferentialEvolution,
        MethodName::CmaEs => &CmaEs,
    }
}
