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
//! candidates ([`refine`]). Where it is in doubt whether the lowest minimum is the floor, another
//! search follows ([`floor`]); the lowest cost of all is the estimate.
//!
//! Promises: the same problem, settings and seed give the same bits, for any number of threads
//! and however often the run is saved ([`Estimation::checkpoint`]) and resumed; no
//! clock, no I/O; a candidate that fails is a value.

pub mod evaluation_cache;
pub mod feasible;
pub mod floor;
pub mod hill_climb;
pub mod leaders;
pub mod loss;
pub mod objective;
pub mod observer;
pub mod prior;
pub mod problem;
mod progress;
pub mod refine;
mod refinement;
pub mod report;
pub mod search;
pub mod segments;
pub mod sensitivity;
pub mod settings;
pub mod shooting;
pub mod stop_reason;
pub mod trajectory;

pub use observer::{Finding, GenerationRow, Observer, RefinementRow, Simulated};
pub use problem::Problem;
pub use progress::{Advance, Phase, Progress};
pub use report::Report;
pub use settings::Settings;
pub use stop_reason::StopReason;

use crate::numerics::rng;
use floor::Landmarks;
use refine::Descent;
use search::Search;
use serde::{Deserialize, Serialize};
use settings::MethodName;
use shooting::Shooting;
use std::sync::atomic::AtomicBool;

/// Where a run is saved to go on from. Serialises to about 1 kB for each 10 candidates and leader.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    search: search::State,
    #[serde(default)]
    searches: Vec<FinishedSearch>,
    descents: Vec<Descent>,
    #[serde(default)]
    shootings: Vec<Shooting>,
    /// Of how many searches the best have gone over segments.
    #[serde(default)]
    shot_searches: usize,
    /// Whether parameters that could change their places have.
    #[serde(default)]
    exchanged: bool,
    /// Other minima as low as the estimate.
    #[serde(default)]
    twins: Vec<Vec<f64>>,
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

/// One run.
#[derive(Debug)]
pub struct Estimation {
    settings: Settings,
    search: Search,
    /// What the search judges, where that is not the free run ([`segments`]).
    segmented: Option<Problem>,
    landmarks: Landmarks,
    searches: Vec<FinishedSearch>,
    descents: Vec<Descent>,
    shootings: Vec<Shooting>,
    shot_searches: usize,
    exchanged: bool,
    twins: Vec<Vec<f64>>,
    phase: Phase,
    stop_reason: Option<StopReason>,
}

impl Estimation {
    /// Begins a run.
    #[must_use]
    pub fn start(problem: &Problem, settings: &Settings, seed: u64) -> Estimation {
        let segmented = segments::segmented(problem);
        let landmarks = Landmarks::of(problem);
        let mut search = Search::start(segmented.as_ref().unwrap_or(problem), settings, seed);
        search.landmarks = segmented.is_none().then_some(landmarks);
        let mut run = Estimation {
            settings: settings.clone(),
            search,
            segmented,
            landmarks,
            searches: Vec::new(),
            descents: Vec::new(),
            shootings: Vec::new(),
            shot_searches: 0,
            exchanged: false,
            twins: Vec::new(),
            phase: Phase::Search,
            stop_reason: None,
        };
        let n = problem.coordinates.len();
        if settings.name == MethodName::MultistartLm {
            let mut rng = rng::stream(seed, 0, rng::Purpose::Population);
            let inside = feasible::inside_of_constraints(problem);
            for start in 0..settings.refine_candidates * settings.restarts {
                let positions = (0..n).map(|_| rng::unit(&mut rng)).collect();
                let positions = feasible::mirrored(problem, inside.as_deref(), positions);
                run.descend(Some(start), positions);
            }
            run.refine(StopReason::GenerationLimit);
        } else if settings.generations == 0 {
            // Nothing to search: the middle of the box is refined.
            run.descend(Some(0), vec![0.5; n]);
            run.refine(StopReason::GenerationLimit);
        }
        run
    }

    /// Resumes a run where it was saved.
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
        let landmarks = Landmarks::of(problem);
        let searched = segmented.as_ref().unwrap_or(problem);
        let mut search = Search::resume(searched, settings, seed, checkpoint.search);
        search.landmarks = segmented.is_none().then_some(landmarks);
        Ok(Estimation {
            settings: settings.clone(),
            search,
            segmented,
            landmarks,
            searches: checkpoint.searches,
            descents: checkpoint.descents,
            shootings: checkpoint.shootings,
            shot_searches: checkpoint.shot_searches,
            exchanged: checkpoint.exchanged,
            twins: checkpoint.twins,
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

    /// Goes on to the end, or until `stop` is raised: the estimate, or the best so far. None where
    /// no candidate could be simulated.
    pub fn run(
        &mut self,
        problem: &Problem,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Option<Report> {
        let stopped = loop {
            match self.advance(problem, stop, observer) {
                Advance::Working => {}
                Advance::Finished => break None,
                Advance::Interrupted => break Some(StopReason::Cancelled),
            }
        };
        self.report(problem, stopped)
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
        let asked = self.settings.restarts as usize;
        // Of one search its best distinct candidates, of each of several its best.
        let (from, each) = match self.searches.len() {
            1 => (0, usize::MAX),
            number if number == asked => (0, 1),
            further => (further - 1, usize::MAX),
        };
        let mut starts = Vec::new();
        for (number, search) in self.searches.iter().enumerate().skip(from) {
            for leader in search.leaders.iter().take(each) {
                starts.push((number as u32, self.positions(problem, &leader.chromosome)));
            }
        }
        for (search, positions) in starts {
            self.descend(Some(search), positions);
        }
        self.refine(stop_reason);
    }

    /// The positions of a candidate of the search. What a segmented search cannot judge, the
    /// initial states, stands in the middle of its range: at what was measured.
    fn positions(&self, problem: &Problem, chromosome: &crate::genetic::Chromosome) -> Vec<f64> {
        let found = self
            .search
            .positions(problem, chromosome)
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

    /// What the run is doing.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The lowest cost so far.
    fn best_cost(&self) -> Option<f64> {
        let best = self.best_descent().and_then(|descent| descent.cost);
        best.or(self.search.champion().map(|champion| champion.cost))
    }

    /// All that is needed to resume the run.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            search: self.search.state.clone(),
            searches: self.searches.clone(),
            descents: self.descents.clone(),
            shootings: self.shootings.clone(),
            shot_searches: self.shot_searches,
            exchanged: self.exchanged,
            twins: self.twins.clone(),
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
            None => self
                .search
                .positions(problem, &self.search.champion()?.chromosome),
        };
        Some(Report::new(problem, self, positions, stopped))
    }
}
