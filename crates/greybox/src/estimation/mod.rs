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

pub mod evaluation_cache;
pub mod feasible;
pub mod floor;
pub mod hill_climb;
pub mod leaders;
pub mod log_posterior;
pub mod loss;
pub mod noise_ladder;
mod noise_scan;
pub mod objective;
pub mod observer;
pub mod prior;
pub mod problem;
pub mod process_noise;
mod progress;
pub mod refine;
mod refinement;
pub mod report;
pub mod search;
pub mod segments;
pub mod sensitivity;
pub mod settings;
pub mod shooting;
pub mod smoothing;
pub mod sought_noise;
pub mod speculative_search;
mod stage;
mod standing;
pub mod stop_reason;
mod totals;
pub mod trajectory;

pub use observer::{Finding, GenerationRow, Observer, PosteriorRow, RefinementRow, Simulated};
pub use problem::Problem;
pub use progress::{Advance, Phase, Progress};
pub use report::Report;
pub use settings::Settings;
pub use stop_reason::StopReason;

pub use speculative_search::{SearchUpdate, Share};

use floor::Landmarks;
use greybox_numerics::rng;
use leaders::Judged;
use refine::Descent;
use search::{Search, Task};
use serde::{Deserialize, Serialize};
use settings::MethodName;
use speculative_search::SpeculativeSearches;
use stage::{EstimationStage, RefinementStage};
use std::sync::atomic::AtomicBool;
use totals::Totals;

/// Where a run is saved to go on from. Serialises to about 1 kB for each 10 candidates and leader.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct EstimationCheckpoint {
    search: search::State,
    #[serde(flatten)]
    state: EstimationState,
}

/// All that the next unit of a run depends on, beside the state of the search.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
struct EstimationState {
    /// Totals of the searches that have finished, and what the refinement did.
    #[serde(default, rename = "earlier")]
    totals: Totals,
    /// The searches that have finished.
    #[serde(default)]
    searches: Vec<FinishedSearch>,
    descents: Vec<Descent>,
    /// The searches whose best candidates have gone over segments.
    #[serde(default)]
    shot_searches: usize,
    /// Whether parameters that could change their places have.
    #[serde(default)]
    exchanged: bool,
    /// Why the last search before a refinement ended.
    stop_reason: Option<StopReason>,
    #[serde(flatten)]
    stage: EstimationStage,
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
#[error("the checkpoint has {unknowns} unknowns where the problem has {expected}")]
pub struct CheckpointError {
    unknowns: usize,
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
    /// Searches that other nodes run before it is their turn.
    speculative: SpeculativeSearches,
    /// The search that was begun since other nodes were told.
    newly_begun: Option<u32>,
    state: EstimationState,
}

impl Estimation {
    /// Begins a run.
    #[must_use]
    pub fn start(problem: &Problem, settings: &Settings, seed: u64) -> Estimation {
        let mut run = Estimation::at(problem, settings, seed, EstimationCheckpoint::default());
        let segmented = run.segmented.as_ref();
        let task = task(problem, segmented, settings, seed, run.landmarks);
        run.search = Search::start(&task, 0);
        let n = problem.coordinates.len();
        if settings.name == MethodName::MultistartLm {
            let mut rng = rng::stream(seed, 0, rng::Purpose::Population);
            let inside = feasible::inside_of_constraints(problem);
            for start in 0..settings.refine_candidates * settings.restarts {
                let positions = (0..n).map(|_| rng::unit(&mut rng)).collect();
                let positions = feasible::mirrored(problem, inside.as_deref(), positions);
                run.descend(Some(start), positions);
            }
            run.descend_from_stated_start(problem);
            run.refine(StopReason::GenerationLimit);
        } else if settings.generations == 0 {
            // Nothing to search: the middle of the box is refined.
            run.descend(Some(0), vec![0.5; n]);
            run.descend_from_stated_start(problem);
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
        checkpoint: EstimationCheckpoint,
    ) -> Result<Estimation, CheckpointError> {
        let expected = problem.coordinates.len();
        let unknowns = checkpoint
            .search
            .population
            .first()
            .map_or(0, |first| first.0.len());
        if unknowns != expected {
            return Err(CheckpointError { unknowns, expected });
        }
        Ok(Estimation::at(problem, settings, seed, checkpoint))
    }

    /// A run that stands where a checkpoint was saved.
    fn at(
        problem: &Problem,
        settings: &Settings,
        seed: u64,
        checkpoint: EstimationCheckpoint,
    ) -> Estimation {
        let EstimationCheckpoint { search, state } = checkpoint;
        let segmented = segments::segmented(problem);
        let landmarks = Landmarks::of(problem);
        let task = task(problem, segmented.as_ref(), settings, seed, landmarks);
        let number = match state.stage {
            EstimationStage::Search => state.searches.len(),
            EstimationStage::Refine(_) | EstimationStage::Analyse { .. } => {
                state.searches.len().saturating_sub(1)
            }
        };
        Estimation {
            settings: settings.clone(),
            seed,
            search: Search::resume(&task, number as u32, search),
            segmented,
            landmarks,
            speculative: SpeculativeSearches::default(),
            newly_begun: None,
            state,
        }
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
        match &self.state.stage {
            EstimationStage::Search => self.advance_search(problem, stop, observer),
            EstimationStage::Refine(_) if !self.settings.refine => self.finish(Vec::new()),
            EstimationStage::Refine(RefinementStage::OverSegments(_)) => {
                self.advance_segments(problem, stop)
            }
            EstimationStage::Refine(RefinementStage::FreeRun) => {
                self.advance_descents(problem, stop, observer)
            }
            EstimationStage::Analyse { .. } => Advance::Finished,
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
        let (rows, ended) = match self.speculative.take_beyond(self.search.number(), judged) {
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
            observer.generation(&self.state.totals.counted_on(row, values));
        }
        if let Some(reason) = ended {
            self.end_search(problem, reason);
        }
        Advance::Working
    }

    /// Begins the next search.
    fn begin_next_search(&mut self, problem: &Problem) {
        let number = self.state.searches.len() as u32;
        self.state.totals = self.state.totals.and(&self.search.state);
        let (segmented, settings) = (self.segmented.as_ref(), &self.settings);
        let task = task(problem, segmented, settings, self.seed, self.landmarks);
        self.search = Search::start(&task, number);
        self.speculative.forget_before(number);
        self.newly_begun = Some(number);
    }

    /// Whether searches follow the one at work that do not depend on it.
    #[must_use]
    pub fn has_searches_ahead(&self) -> bool {
        let (finished, asked) = (self.state.searches.len(), self.settings.restarts as usize);
        self.phase() == Phase::Search && finished + 1 < asked
    }

    /// Takes note of what another node did of a search.
    pub fn apply(&mut self, update: SearchUpdate) {
        if update.search() >= self.search.number() {
            self.speculative.apply(update);
        }
    }

    /// What other nodes should be told of the searches here since this was last called.
    pub fn take_update(&mut self) -> Option<SearchUpdate> {
        self.newly_begun.take().map(SearchUpdate::Begun)
    }

    /// Judges at most so many generations of a search ahead for the node that has the run; none
    /// where nothing is left to do.
    pub fn help(
        &mut self,
        problem: &Problem,
        share: Share,
        at_most: u32,
        stop: &AtomicBool,
    ) -> Option<SearchUpdate> {
        if !self.has_searches_ahead() {
            return None;
        }
        let (segmented, settings) = (self.segmented.as_ref(), &self.settings);
        let task = task(problem, segmented, settings, self.seed, self.landmarks);
        let ahead = self.state.searches.len() as u32 + 1..self.settings.restarts;
        let number = self.speculative.next(share, ahead)?;
        let stretch = self.speculative.judge(&task, number, at_most, stop)?;
        Some(SearchUpdate::Judged(Box::new(stretch)))
    }

    /// Begins another search, where more than one is asked for, or the refinement of what they found:
    /// of each search its best candidate, of a single search its best distinct candidates.
    fn end_search(&mut self, problem: &Problem, stop_reason: StopReason) {
        let search = &self.search.state;
        self.state.searches.push(FinishedSearch {
            stop_reason,
            generations: search.generation,
            leaders: search.leaders.clone(),
        });
        let (finished, asked) = (self.state.searches.len(), self.settings.restarts as usize);
        if finished < asked {
            self.begin_next_search(problem);
            return;
        }
        // A single search gives its best distinct candidates, each of several searches its best.
        let (from, each) = match finished {
            1 => (0, usize::MAX),
            number if number == asked => (0, 1),
            further => (further - 1, usize::MAX),
        };
        let mut starts = Vec::new();
        for (number, search) in self.state.searches.iter().enumerate().skip(from) {
            for leader in search.leaders.iter().take(each) {
                starts.push((number as u32, self.positions(problem, &leader.chromosome)));
            }
        }
        for (search, positions) in starts {
            self.descend(Some(search), positions);
        }
        if finished == asked {
            self.descend_from_stated_start(problem);
        }
        self.refine(stop_reason);
    }

    /// The positions of a candidate of the search. What a segmented search cannot judge, the
    /// initial states, stands in the middle of its range: at what was measured.
    fn positions(&self, problem: &Problem, chromosome: &crate::genetic::Chromosome) -> Vec<f64> {
        let decoded = self
            .search
            .positions(problem, chromosome)
            .into_iter()
            .zip(&problem.coordinates);
        let unjudged = |coordinate: &problem::Coordinate| {
            let is_state = matches!(coordinate.target, problem::Target::InitialState { .. });
            is_state && self.segmented.is_some()
        };
        decoded
            .map(|(position, coordinate)| if unjudged(coordinate) { 0.5 } else { position })
            .collect()
    }

    /// What the run is doing.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.state.stage.phase()
    }

    /// The best candidate of all searches.
    fn champion(&self) -> Option<&Judged> {
        self.state.totals.champion(&self.search.state)
    }

    /// The lowest cost so far.
    fn best_cost(&self) -> Option<f64> {
        let best = self.best_descent().and_then(|descent| descent.cost);
        best.or(self.champion().map(|champion| champion.cost))
    }

    /// All that is needed to resume the run.
    #[must_use]
    pub fn checkpoint(&self) -> EstimationCheckpoint {
        EstimationCheckpoint {
            search: self.search.state.clone(),
            state: self.state.clone(),
        }
    }
}

/// What all searches of a run have in common: they judge the problem over segments where it is so given.
fn task<'a>(
    problem: &'a Problem,
    segmented: Option<&'a Problem>,
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
