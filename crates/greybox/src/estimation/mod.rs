//! The hybrid neural-genetic estimation: search, then refinement.
//!
//! One run reads like section 3 of the paper. Generation after generation ([`search`]):
//!
//! 1. every candidate is simulated over the recorded inputs ([`objective`]), as finely as ranking
//!    needs ([`Ranking`](greybox_simulation::Accuracy::Ranking)),
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

pub mod ahead;
mod earlier;
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

use ahead::Ahead;
pub use ahead::{SearchNews, Share};
use earlier::Earlier;
use floor::Landmarks;
use greybox_numerics::rng;
use leaders::Judged;
use refine::Descent;
use search::{Search, Task};
use serde::{Deserialize, Serialize};
use settings::MethodName;
use shooting::Shooting;
use std::sync::atomic::AtomicBool;

/// Where a run is saved to go on from. Serialises to about 1 kB for each 10 candidates and leader.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    search: search::State,
    #[serde(default)]
    earlier: Earlier,
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
    /// Why the search ended.
    stop_reason: StopReason,
    /// How many generations the search took.
    generations: u32,
    /// The best distinct candidates of the search, the champion first.
    leaders: Vec<Judged>,
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
    seed: u64,
    search: Search,
    /// What the search judges, where that is not the free run ([`segments`]).
    segmented: Option<Problem>,
    landmarks: Landmarks,
    /// Totals of the searches that have finished, and what the refinement did.
    earlier: Earlier,
    /// Searches that other nodes do.
    ahead: Ahead,
    /// The search that was begun since others were told.
    newly_begun: Option<u32>,
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
        let task = task((problem, segmented.as_ref()), settings, seed, landmarks);
        let search = Search::start(&task, 0);
        let mut run = Estimation {
            settings: settings.clone(),
            seed,
            search,
            segmented,
            landmarks,
            earlier: Earlier::default(),
            ahead: Ahead::default(),
            newly_begun: None,
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
        let task = task((problem, segmented.as_ref()), settings, seed, landmarks);
        let number = match checkpoint.phase {
            Phase::Search => checkpoint.searches.len(),
            Phase::Refine | Phase::Analyse => checkpoint.searches.len().saturating_sub(1),
        };
        let search = Search::resume(&task, number as u32, checkpoint.search);
        Ok(Estimation {
            settings: settings.clone(),
            seed,
            search,
            segmented,
            landmarks,
            earlier: checkpoint.earlier,
            ahead: Ahead::default(),
            newly_begun: None,
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
        let judged = self.search.state.generation;
        let (rows, ended) = match self.ahead.take(self.search.number(), judged) {
            Some(stretch) => {
                self.search.state = stretch.state.clone();
                let ended = stretch.stop;
                (stretch.rows_after(judged).collect(), ended)
            }
            None => {
                let Some(generation) = self.search.generation(searched, stop) else {
                    return Advance::Interrupted;
                };
                (vec![generation.row], generation.stop)
            }
        };
        for row in rows {
            let values = |best: &Judged| {
                searched.named_values(&self.search.positions(searched, &best.chromosome))
            };
            observer.generation(&self.earlier.counted_on(row, values));
        }
        if let Some(reason) = ended {
            self.end_search(problem, reason);
        }
        Advance::Working
    }

    /// Begins the search that follows.
    fn begin_next_search(&mut self) {
        let number = self.searches.len() as u32;
        self.earlier = self.earlier.and(&self.search.state);
        self.search.restart(number);
        self.ahead.forget_before(number);
        self.newly_begun = Some(number);
    }

    /// Whether searches follow the one at work that do not depend on it.
    #[must_use]
    pub fn has_searches_ahead(&self) -> bool {
        self.phase == Phase::Search && self.searches.len() + 1 < self.settings.restarts as usize
    }

    /// Takes note of what another node tells of searches.
    pub fn hear(&mut self, news: SearchNews) {
        if news.search() >= self.search.number() {
            self.ahead.hear(news);
        }
    }

    /// What others should be told of the searches here since this was asked for.
    pub fn news(&mut self) -> Option<SearchNews> {
        self.newly_begun.take().map(SearchNews::Begun)
    }

    /// Does at most so many generations of a search ahead for the node that has the run; none where
    /// nothing is left to do.
    pub fn help(
        &mut self,
        problem: &Problem,
        (share, at_most): (Share, u32),
        stop: &AtomicBool,
    ) -> Option<SearchNews> {
        if !self.has_searches_ahead() {
            return None;
        }
        let searched = (problem, self.segmented.as_ref());
        let task = task(searched, &self.settings, self.seed, self.landmarks);
        let ahead = self.searches.len() as u32 + 1..self.settings.restarts;
        let stretch = self.ahead.help(&task, (share, ahead), at_most, stop);
        stretch.map(|judged| SearchNews::Judged(Box::new(judged)))
    }

    /// Another search, where more than one is asked for, or the refinement of what they found:
    /// of each its best, of one alone its best distinct candidates.
    fn end_search(&mut self, problem: &Problem, stop_reason: StopReason) {
        let state = &self.search.state;
        self.searches.push(FinishedSearch {
            stop_reason,
            generations: state.generation,
            leaders: state.leaders.clone(),
        });
        if self.searches.len() < self.settings.restarts as usize {
            self.begin_next_search();
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

    /// The best candidate of all searches.
    fn champion(&self) -> Option<&Judged> {
        self.earlier.champion(&self.search.state)
    }

    /// The lowest cost so far.
    fn best_cost(&self) -> Option<f64> {
        let best = self.best_descent().and_then(|descent| descent.cost);
        best.or(self.champion().map(|champion| champion.cost))
    }

    /// All that is needed to resume the run.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            search: self.search.state.clone(),
            earlier: self.earlier.clone(),
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
            None => self.search.positions(problem, &self.champion()?.chromosome),
        };
        Some(Report::new(problem, self, positions, stopped))
    }
}

/// What all searches of a run have in common: they judge the problem over segments where it is so given.
fn task<'a>(
    (problem, segmented): (&'a Problem, Option<&'a Problem>),
    settings: &'a Settings,
    seed: u64,
    landmarks: Landmarks,
) -> Task<'a> {
    Task {
        problem: segmented.unwrap_or(problem),
        settings,
        seed,
        landmarks: segmented.is_none().then_some(landmarks),
    }
}
