//! The hybrid neural-genetic estimation: search, then refinement.
//!
//! One run reads like section 3 of the paper. Generation after generation ([`search`]):
//!
//! 1. every candidate is simulated over the recorded inputs ([`objective`]), as finely as ranking
//!    needs ([`Ranking`](crate::simulation::Accuracy::Ranking)),
//! 2. the ICRA network turns the errors in block after block of data into credits, until the
//!    entropy criterion stops it (section 3.1, [`crate::credit`]),
//! 3. the credits are the selection probabilities from which the genetic algorithm breeds the
//!    next generation (section 3.2, [`crate::genetic`]), and the best candidate survives,
//!
//! until a [`StopReason`] holds. Then Levenberg–Marquardt descends from the best distinct
//! candidates ([`refine`]), and the lowest cost of all is the estimate.
//!
//! Promises: the same problem, settings and seed give the same bits, for any number of threads
//! and however often the run is laid down ([`Estimation::checkpoint`]) and taken up again; no
//! clock, no I/O; a candidate that fails is a value.

pub mod cma_es;
pub mod differential;
pub mod evaluation_cache;
pub mod hill_climb;
pub mod leaders;
pub mod loss;
pub mod objective;
pub mod observer;
pub mod problem;
pub mod refine;
pub mod report;
pub mod search;
pub mod segments;
pub mod sensitivity;
pub mod settings;
pub mod stop_reason;
pub mod trajectory;

pub use observer::{GenerationRow, Observer, RefinementRow, Simulated};
pub use problem::Problem;
pub use report::Report;
pub use settings::Settings;
pub use stop_reason::StopReason;

use crate::numerics::rng;
use rayon::prelude::*;
use refine::{Descent, Minimum};
use search::Search;
use serde::{Deserialize, Serialize};
use settings::MethodName;
use std::sync::atomic::AtomicBool;

/// What a run is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Searching, a generation at a time.
    Search,
    /// Refining, an iteration at a time.
    Refine,
    /// The estimate stands; its uncertainty can be analysed.
    Analyse,
}

/// What a unit of work came to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// There is more to do.
    Working,
    /// The stop flag was raised; nothing has changed.
    Interrupted,
    /// The estimate stands.
    Finished,
}

/// How far a run has come.
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// What it is doing.
    pub phase: Phase,
    /// Generations judged.
    pub generation: u32,
    /// Generations at the most.
    pub generations: u32,
    /// Candidates judged.
    pub evaluations: u64,
    /// The lowest cost so far.
    pub best_cost: Option<f64>,
    /// The largest credit so far.
    pub best_credit: Option<f64>,
    /// The share of the work that is done, 0 to 1, if the search uses all its generations.
    pub fraction: f64,
}

/// A run laid down. Serialises to about 1 kB for each 10 candidates and leader.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    search: search::State,
    #[serde(default)]
    searches: Vec<FinishedSearch>,
    descents: Vec<Descent>,
    phase: Phase,
    stop_reason: Option<StopReason>,
}

/// A search of a run that has ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct FinishedSearch {
    /// Why.
    stop_reason: StopReason,
    /// How many generations it took.
    generations: u32,
    /// Its best distinct candidates, the champion first.
    leaders: Vec<leaders::Judged>,
}

/// A checkpoint that does not belong to the problem and the settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the checkpoint has {found} unknowns where the problem has {expected}")]
pub struct CheckpointError {
    found: usize,
    expected: usize,
}

/// The share of the work that the search is taken for, where a refinement follows.
const SEARCH_SHARE: f64 = 0.9;

/// One run.
#[derive(Debug)]
pub struct Estimation {
    settings: Settings,
    search: Search,
    /// What the search judges, where that is not the free run ([`segments`]).
    segmented: Option<Problem>,
    searches: Vec<FinishedSearch>,
    descents: Vec<Descent>,
    phase: Phase,
    stop_reason: Option<StopReason>,
}

impl Estimation {
    /// Begins a run.
    #[must_use]
    pub fn start(problem: &Problem, settings: &Settings, seed: u64) -> Estimation {
        let segmented = segments::segmented(problem);
        let mut run = Estimation {
            settings: settings.clone(),
            search: Search::start(segmented.as_ref().unwrap_or(problem), settings, seed),
            segmented,
            searches: Vec::new(),
            descents: Vec::new(),
            phase: Phase::Search,
            stop_reason: None,
        };
        let n = problem.coordinates.len();
        if settings.name == MethodName::MultistartLm {
            let mut rng = rng::stream(seed, 0, rng::Purpose::Population);
            let starts = 0..settings.refine_candidates * settings.restarts;
            let starts = starts.map(|_| (0..n).map(|_| rng::unit(&mut rng)).collect());
            run.refine_from(starts.collect(), StopReason::GenerationLimit);
        } else if settings.generations == 0 {
            // Nothing to search: the middle of the box is refined.
            run.refine_from(vec![vec![0.5; n]], StopReason::GenerationLimit);
        }
        run
    }

    /// Goes over to the refinement.
    fn refine_from(&mut self, starts: Vec<Vec<f64>>, reason: StopReason) {
        self.stop_reason = Some(reason);
        self.descents = starts.into_iter().map(Descent::from).collect();
        self.phase = Phase::Refine;
    }

    /// Takes a run up where it was laid down.
    ///
    /// # Errors
    /// When the checkpoint is that of another problem.
    pub fn resume(
        problem: &Problem,
        settings: &Settings,
        seed: u64,
        checkpoint: Checkpoint,
    ) -> Result<Estimation, CheckpointError> {
        let expected = problem.coordinates.len();
        let found = checkpoint
            .search
            .population
            .first()
            .map_or(0, |first| first.0.len());
        if found != expected {
            return Err(CheckpointError { found, expected });
        }
        let segmented = segments::segmented(problem);
        let searched = segmented.as_ref().unwrap_or(problem);
        Ok(Estimation {
            settings: settings.clone(),
            search: Search::resume(searched, settings, seed, checkpoint.search),
            segmented,
            searches: checkpoint.searches,
            descents: checkpoint.descents,
            phase: checkpoint.phase,
            stop_reason: checkpoint.stop_reason,
        })
    }

    /// One unit of work: a generation of the search or an iteration of the refinement. When
    /// `stop` is raised inside a long simulation, nothing has changed and the unit is done again
    /// later, with the same bits.
    pub fn advance(
        &mut self,
        problem: &Problem,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Advance {
        match self.phase {
            Phase::Search => self.advance_search(problem, stop, observer),
            Phase::Refine => self.advance_refinement(problem, stop, observer),
            Phase::Analyse => Advance::Finished,
        }
    }

    fn advance_search(
        &mut self,
        problem: &Problem,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Advance {
        let searched = self.segmented.as_ref().unwrap_or(problem);
        let Some(generation) = self.search.generation(searched, stop) else {
            return Advance::Interrupted;
        };
        observer.generation(&generation.row);
        if let Some(reason) = generation.stop {
            self.end_search(problem, reason);
        }
        Advance::Working
    }

    /// Another search, where more than one is asked for, or the refinement of what they found:
    /// of each its best, of one alone its best distinct candidates.
    fn end_search(&mut self, problem: &Problem, stop_reason: StopReason) {
        let state = &self.search.state;
        self.searches.push(FinishedSearch {
            stop_reason,
            generations: state.generation - state.began,
            leaders: state.leaders.clone(),
        });
        if self.searches.len() < self.settings.restarts as usize {
            self.search.restart();
            return;
        }
        let each = match self.searches.len() {
            1 => usize::MAX,
            _ => 1,
        };
        let leaders = self
            .searches
            .iter()
            .flat_map(|search| search.leaders.iter().take(each));
        let starts = leaders.map(|leader| self.positions(problem, &leader.chromosome));
        self.refine_from(starts.collect(), stop_reason);
    }

    /// The positions of a candidate of the search. What a segmented search cannot judge, the
    /// initial states, stands in the middle of its range: at what was measured.
    fn positions(&self, problem: &Problem, chromosome: &crate::genetic::Chromosome) -> Vec<f64> {
        let found = self
            .search
            .positions(chromosome)
            .into_iter()
            .zip(&problem.coordinates);
        let unjudged = |coordinate: &problem::Coordinate| {
            let is_state = matches!(coordinate.target, problem::Target::InitialState { .. });
            is_state && self.segmented.is_some()
        };
        found
            .map(|(position, coordinate)| if unjudged(coordinate) { 0.5 } else { position })
            .collect()
    }

    fn advance_refinement(
        &mut self,
        problem: &Problem,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Advance {
        if !self.settings.refine {
            self.phase = Phase::Analyse;
            return Advance::Finished;
        }
        if self.descents.iter().all(|descent| descent.end.is_some()) && !self.polish_best() {
            self.phase = Phase::Analyse;
            return Advance::Finished;
        }
        // Side by side, because one alone does not fill the cores. All or none, so that a unit
        // that was interrupted leaves no trace.
        let found = self.descents.iter().filter_map(Descent::minimum);
        let found: Vec<Minimum> = found.collect();
        let iterate = |descent: &Descent| {
            let mut next = descent.clone();
            let done = next.end.is_some() || next.iterate(problem, &found, stop);
            done.then_some(next)
        };
        let Some(next) = self
            .descents
            .par_iter()
            .map(iterate)
            .collect::<Option<Vec<_>>>()
        else {
            return Advance::Interrupted;
        };
        let totals = |descents: &[Descent]| {
            let iterations: u32 = descents.iter().map(|descent| descent.iterations).sum();
            let evaluations: u64 = descents.iter().map(|descent| descent.evaluations).sum();
            (iterations, evaluations)
        };
        let (before, after) = (totals(&self.descents), totals(&next));
        self.descents = next;
        self.search.state.counters.evaluations += after.1 - before.1;
        self.search.state.counters.distinct_evaluations += after.1 - before.1;
        if let (true, Some(cost)) = (after.0 > before.0, self.best_cost()) {
            let iteration = after.0;
            observer.refinement(&RefinementRow { iteration, cost });
        }
        Advance::Working
    }

    /// Takes the lowest descent up again, simulated finely; false where that is done, or none is
    /// left that could be.
    fn polish_best(&mut self) -> bool {
        let is_done = |descent: &Descent| descent.is_polished() && descent.cost.is_some();
        if self.descents.iter().any(is_done) {
            return false;
        }
        let coarse = self
            .descents
            .iter_mut()
            .filter(|descent| !descent.is_polished());
        let lowest = coarse
            .filter(|descent| descent.cost.is_some())
            .min_by(|a, b| lowest_first(a, b));
        lowest.map(Descent::polish).is_some()
    }

    /// What the run is doing.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// How far it has come.
    #[must_use]
    pub fn progress(&self) -> Progress {
        let state = &self.search.state;
        let all = self
            .settings
            .generations
            .saturating_mul(self.settings.restarts);
        let own = f64::from(state.generation - state.began);
        let searched =
            self.searches.len() as f64 + own / f64::from(self.settings.generations.max(1));
        let searched = searched / f64::from(self.settings.restarts.max(1));
        let finished = self
            .descents
            .iter()
            .filter(|descent| descent.end.is_some())
            .count();
        let refined = finished as f64 / self.descents.len().max(1) as f64;
        Progress {
            phase: self.phase,
            generation: state.generation,
            generations: all,
            evaluations: state.counters.evaluations,
            best_cost: self.best_cost(),
            best_credit: state.best_credit.map(|(credit, _)| credit),
            fraction: match self.phase {
                Phase::Search => SEARCH_SHARE * searched.min(1.0),
                Phase::Refine => SEARCH_SHARE + (1.0 - SEARCH_SHARE) * refined,
                Phase::Analyse => 1.0,
            },
        }
    }

    /// The lowest cost so far.
    fn best_cost(&self) -> Option<f64> {
        let best = self.best_descent().and_then(|descent| descent.cost);
        best.or(self.search.champion().map(|champion| champion.cost))
    }

    /// The descent that stands for the estimate.
    fn best_descent(&self) -> Option<&Descent> {
        let refined = self
            .descents
            .iter()
            .filter(|descent| descent.cost.is_some());
        refined.min_by(|a, b| lowest_first(a, b))
    }

    /// Lays the run down.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            search: self.search.state.clone(),
            searches: self.searches.clone(),
            descents: self.descents.clone(),
            phase: self.phase,
            stop_reason: self.stop_reason,
        }
    }

    /// The estimate: the best so far, with `stopped` as its reason where the run was ended before
    /// it had finished. None before any candidate could be simulated.
    #[must_use]
    pub fn report(&self, problem: &Problem, stopped: Option<StopReason>) -> Option<Report> {
        let positions = match self.best_descent() {
            Some(descent) => descent.positions.clone(),
            None => self.search.positions(&self.search.champion()?.chromosome),
        };
        Some(Report::new(problem, self, positions, stopped))
    }
}

/// A descent that is polished stands before those that are not, whose costs are less accurate.
fn lowest_first(a: &Descent, b: &Descent) -> std::cmp::Ordering {
    let cost = |descent: &Descent| descent.cost.unwrap_or(f64::INFINITY);
    let polished = b.is_polished().cmp(&a.is_polished());
    polished.then(cost(a).total_cmp(&cost(b)))
}
