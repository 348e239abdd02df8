//! An identification as a run: look ahead, search and refine, analyse.
//!
//! A run goes on in units ([`Run::advance`]) and can be saved after any of them and resumed with
//! the same bits. The look ahead belongs to the first unit. The analysis takes as many units as its
//! refits ask for; those that are done are part of the checkpoint. Other nodes may do some of them, and searches
//! ahead of the one at work ([`Run::help`]); whoever has the run takes them over ([`Run::take_parts`]), with
//! the same bits.

use super::IdentificationError;
use crate::estimation::{
    self, Advance, Estimation, Finding, Observer, Phase, Problem, Progress, SearchNews, Share,
    StopReason,
};
use crate::identification::assemble::{self, Assembly, Origin};
use crate::identification::{JobSpec, Outcome};
use crate::uncertainty::identifiability::FlatDirection;
use crate::uncertainty::refits::{Done, Refit};
use crate::uncertainty::{self, Conclusion, Refits};
use greybox_recording::Recording;
use greybox_simulation::model::Model;
use serde::{Deserialize, Serialize};
use std::borrow::Borrow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A run of an identification.
///
/// ```
/// use greybox::estimation::{Advance, GenerationRow, Observer};
/// use greybox::{Identification, Model, Recording, Run};
/// use std::sync::atomic::AtomicBool;
///
/// struct Costs(Vec<f64>);
///
/// impl Observer for Costs {
///     fn generation(&mut self, row: &GenerationRow) {
///         self.0.push(row.best_cost);
///     }
/// }
///
/// # let force: Vec<f64> = (0..200).map(|k| if k / 17 % 2 == 0 { 20.0 } else { -20.0 }).collect();
/// # let (mut x, mut v) = (0.0, 0.0);
/// # let positions = force.iter().map(|force| {
/// #     let now = x;
/// #     for _ in 0..20 {
/// #         v += 1e-3 * (force - 3.0 * v) / 2.0;
/// #         x += 1e-3 * v;
/// #     }
/// #     now
/// # }).collect();
/// # let recording =
/// #     Recording::from_samples(0.02, [("force", "N", force.clone()), ("position", "m", positions)]);
/// let drive = Model::named("positioning_drive").expect("it is in the catalogue");
/// let mut run = Identification::new(&drive, recording)
///     .fix("coulomb_friction", 0.0)
///     .fix("offset", 0.0)
///     .noise("position", 1e-3)
///     .seed(1)
///     .begin()?;
/// let stop = AtomicBool::new(false);
/// let mut costs = Costs(Vec::new());
/// while run.advance(&stop, &mut costs) == Advance::Working {
///     let checkpoint = run.checkpoint(); // serialises; `Run::resume` goes on from it
/// }
/// assert!(costs.0.len() > 1);
/// assert!(run.outcome(None, &stop)?.is_some());
/// # Ok::<(), greybox::IdentificationError>(())
/// ```
#[derive(Debug)]
pub struct Run {
    origin: Origin,
    /// What is asked about the estimate's uncertainty.
    request: uncertainty::Request,
    problem: Problem,
    /// What is known before anything is simulated; taken by the look ahead with which a new run
    /// begins.
    findings: Option<Vec<Finding>>,
    /// Why the run goes no further than its look ahead.
    refusal: Option<Vec<Finding>>,
    estimation: Estimation,
    /// Refits of the analysis that are done.
    refits: Done,
    /// The names of those that were done here since they were asked for.
    new_refits: Vec<String>,
    /// Which refits come first, where other nodes do some.
    sharing: Option<Sharing>,
    /// Of the estimate that stands; nothing while the run goes on.
    conclusion: Option<Conclusion>,
}

/// All that is needed to resume a run.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint {
    #[serde(flatten)]
    estimation: estimation::Checkpoint,
    /// Refits of the analysis that are done.
    #[serde(default, skip_serializing_if = "Done::is_empty")]
    refits: Done,
}

/// What one node did of a run and another takes over.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// A refit of the analysis.
    Refit(Refit),
    /// Something of a search.
    Search(SearchNews),
}

impl Part {
    fn of_search(news: SearchNews) -> (String, Part) {
        (news.name(), Part::Search(news))
    }

    /// Whether it is a refit.
    #[must_use]
    pub fn is_refit(&self) -> bool {
        matches!(self, Part::Refit(_))
    }

    /// The generations that it has.
    #[must_use]
    pub fn generations(&self) -> usize {
        match self {
            Part::Refit(_) => 0,
            Part::Search(news) => news.generations(),
        }
    }
}

/// Refits of one unit of the analysis at the most.
const REFITS_OF_UNIT: u32 = 64;

/// Refits of an analysis as they come where other nodes do some: first the own share, then those that
/// others come to last, then all that are left.
#[derive(Clone, Copy, Debug)]
struct Sharing {
    own: Share,
    /// Shares that are done.
    done: u32,
    /// Refits of a unit at the most: after each, others are told which are done.
    at_most: u32,
}

impl Sharing {
    /// The share that is next.
    fn next(&self) -> Option<Share> {
        let Share { index, of } = self.own;
        let next = Share {
            index: (index + of - self.done % of) % of,
            of,
        };
        (self.done < of).then_some(next)
    }
}

impl Run {
    /// Begins a run of a specification, with one recording for each of its experiments.
    ///
    /// # Errors
    /// When the experiments cannot be cut out of the recordings.
    pub fn begin(
        spec: &JobSpec,
        model: &Arc<Model>,
        recordings: &[impl Borrow<Recording>],
    ) -> Result<Run, IdentificationError> {
        let assembly = assembled(spec, model, recordings)?;
        let findings = assemble::findings(&assembly);
        let estimation = Estimation::start(&assembly.problem, &spec.method, spec.seed);
        let run = Run::of(spec, assembly.problem, estimation);
        Ok(Run {
            findings: Some(findings),
            ..run
        })
    }

    /// Resumes a run where it was saved.
    ///
    /// # Errors
    /// When the experiments cannot be cut out of the recordings, or the checkpoint is that of
    /// another problem.
    pub fn resume(
        spec: &JobSpec,
        model: &Arc<Model>,
        recordings: &[impl Borrow<Recording>],
        checkpoint: Checkpoint,
    ) -> Result<Run, IdentificationError> {
        let problem = assembled(spec, model, recordings)?.problem;
        let Checkpoint { estimation, refits } = checkpoint;
        let estimation = Estimation::resume(&problem, &spec.method, spec.seed, estimation)?;
        let run = Run::of(spec, problem, estimation);
        Ok(Run { refits, ..run })
    }

    fn of(spec: &JobSpec, problem: Problem, estimation: Estimation) -> Run {
        Run {
            origin: Origin {
                job: spec.name.clone().unwrap_or_default(),
                spec: spec.clone(),
                dataset_digests: Vec::new(),
            },
            request: spec.request(),
            problem,
            findings: None,
            refusal: None,
            estimation,
            refits: Done::new(),
            new_refits: Vec::new(),
            sharing: None,
            conclusion: None,
        }
    }

    /// Returns the run with an outcome that says which job it was and which recordings it read.
    #[must_use]
    pub fn named(mut self, job: String, dataset_digests: Vec<String>) -> Run {
        self.origin.job = job;
        self.origin.dataset_digests = dataset_digests;
        self
    }

    /// The problem that is solved.
    #[must_use]
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// How far the run came.
    #[must_use]
    pub fn progress(&self) -> Progress {
        self.estimation.progress()
    }

    /// All that is needed to resume the run.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            estimation: self.estimation.checkpoint(),
            refits: self.refits.clone(),
        }
    }

    /// One unit of work: a generation of the search, an iteration of the refinement or a part of
    /// the analysis. When `stop` is raised it may return early, with nothing changed; the unit is then
    /// done again later, with the same bits.
    pub fn advance(&mut self, stop: &AtomicBool, observer: &mut dyn Observer) -> Advance {
        if let Some(ended) = self.look_ahead(stop, observer) {
            return ended;
        }
        if self.estimation.phase() == Phase::Analyse {
            return self.analyse(stop);
        }
        match self.estimation.advance(&self.problem, stop, observer) {
            Advance::Interrupted => Advance::Interrupted,
            Advance::Working | Advance::Finished => Advance::Working,
        }
    }

    /// What the data do not see, before a new run searches for it. Answers what the unit comes to
    /// where it ends with that.
    fn look_ahead(&mut self, stop: &AtomicBool, observer: &mut dyn Observer) -> Option<Advance> {
        let findings = self.findings.as_ref()?;
        let Some(flat) = assemble::flat_directions(&self.problem, stop) else {
            return Some(Advance::Interrupted);
        };
        let reported = |flat: &FlatDirection| assemble::unseen(&self.problem, flat);
        let flat_directions = self.request.settings.flat_directions;
        let refuses = |flat: &&FlatDirection| flat_directions.refuses(flat);
        let grounds: Vec<Finding> = flat.iter().filter(refuses).map(reported).collect();
        if grounds.is_empty() {
            let unseen = flat.iter().map(reported);
            for finding in findings.iter().cloned().chain(unseen) {
                observer.finding(&finding);
            }
        } else {
            self.refusal = Some(grounds);
        }
        self.findings = None;
        self.refusal.is_some().then_some(Advance::Finished)
    }

    fn analyse(&mut self, stop: &AtomicBool) -> Advance {
        if let Some(mut sharing) = self.sharing
            && let Some(share) = sharing.next()
        {
            let did_some = self.refit((share, true), sharing.at_most, stop);
            if stop.load(Ordering::Relaxed) {
                return Advance::Interrupted;
            }
            if !did_some {
                sharing.done += 1;
                self.sharing = Some(sharing);
            }
            return Advance::Working;
        }
        let Some(report) = self.estimation.report(&self.problem, None) else {
            return Advance::Finished;
        };
        let at_most = self
            .sharing
            .map_or(REFITS_OF_UNIT, |sharing| sharing.at_most);
        let refits = Refits::from(std::mem::take(&mut self.refits), at_most);
        self.conclusion =
            uncertainty::conclude(&self.problem, &report, &self.request, &refits, stop);
        let is_cut = refits.is_cut();
        self.keep(refits);
        if let Some(sharing) = &mut self.sharing {
            // What follows from the refits may ask for others.
            sharing.done = 0;
        }
        match self.conclusion {
            Some(_) => Advance::Finished,
            None if is_cut => Advance::Working,
            None => Advance::Interrupted,
        }
    }

    /// Does refits of a share; says whether there were any to do.
    fn refit(&mut self, (share, alone): (Share, bool), at_most: u32, stop: &AtomicBool) -> bool {
        let Some(report) = self.estimation.report(&self.problem, None) else {
            return false;
        };
        let refits = Refits::from(std::mem::take(&mut self.refits), at_most).of(share, alone);
        // What it comes to is of no use: most refits are missing.
        let _ = uncertainty::conclude(&self.problem, &report, &self.request, &refits, stop);
        self.keep(refits) > 0
    }

    /// Keeps the refits that are done; answers how many are new.
    fn keep(&mut self, refits: Refits) -> usize {
        let (done, new) = refits.into_done();
        self.refits = done;
        let n_new = new.len();
        self.new_refits.extend(new);
        n_new
    }

    /// Whether other nodes may do some of what is left: searches follow the one at work, or the analysis has
    /// many refits that do not depend on each other.
    #[must_use]
    pub fn is_shareable(&self) -> bool {
        self.has_refits_to_share()
            || self.findings.is_none() && self.estimation.has_searches_ahead()
    }

    fn has_refits_to_share(&self) -> bool {
        let asked = &self.request;
        let has_many = asked.settings.has_independent_refits() || !asked.effects.is_empty();
        let is_at_them = self.refusal.is_none() && self.conclusion.is_none();
        has_many && is_at_them && self.estimation.phase() == Phase::Analyse
    }

    /// Has refits of a share come first, because other nodes begin with the other shares, and so many in a
    /// unit at the most.
    pub fn share(&mut self, own: Share, at_most: u32) {
        let before = self.sharing.filter(|sharing| sharing.own == own);
        self.sharing = Some(Sharing {
            own,
            done: before.map_or(0, |sharing| sharing.done),
            at_most,
        });
    }

    /// Takes over what another node did.
    pub fn take_parts(&mut self, parts: impl IntoIterator<Item = (String, Part)>) {
        for (name, part) in parts {
            match part {
                Part::Refit(refit) => {
                    self.refits.insert(name, refit);
                }
                Part::Search(news) => self.estimation.hear(news),
            }
        }
    }

    /// What others are to know of that was done here since this was asked for.
    pub fn new_parts(&mut self) -> Vec<(String, Part)> {
        let names = std::mem::take(&mut self.new_refits);
        let refit = |name: String| {
            let refit = self.refits.get(&name).cloned()?;
            Some((name, Part::Refit(refit)))
        };
        let refits: Vec<_> = names.into_iter().filter_map(refit).collect();
        let news = self.estimation.news().map(Part::of_search);
        refits.into_iter().chain(news).collect()
    }

    /// Does so many refits or generations of a share at the most for the node that has the run. Nothing is
    /// left of it, or can be done yet, where it answers none.
    pub fn help(&mut self, share: Share, at_most: u32, stop: &AtomicBool) -> Vec<(String, Part)> {
        if self.has_refits_to_share() {
            self.refit((share, false), at_most, stop);
            return self.new_parts();
        }
        let problem = &self.problem;
        let news = self.estimation.help(problem, (share, at_most), stop);
        news.map(Part::of_search).into_iter().collect()
    }

    /// The outcome: final when the run has finished, else, with why it was `stopped`, the best so
    /// far, which is nothing before the first candidate was judged. When `hurry` is raised it
    /// answers soon, without what takes long to be found out about the estimate.
    ///
    /// # Errors
    /// When the data do not fix the unknowns.
    pub fn outcome(
        &mut self,
        stopped: Option<StopReason>,
        hurry: &AtomicBool,
    ) -> Result<Option<Outcome>, IdentificationError> {
        if let Some(grounds) = self.refusal.take() {
            return Err(IdentificationError::NotIdentifiable(grounds));
        }
        let finished = self.conclusion.take().filter(|_| stopped.is_none());
        let conclusion = match finished {
            Some(finished) => finished,
            None => {
                let Some(report) = self.estimation.report(&self.problem, stopped) else {
                    return Ok(None);
                };
                // A run that was stopped is not kept waiting for the more thorough answers.
                let request = match stopped {
                    Some(_) => &uncertainty::Request::default(),
                    None => &self.request,
                };
                let refits = Refits::from(self.refits.clone(), u32::MAX);
                uncertainty::conclude(&self.problem, &report, request, &refits, hurry)
                    .unwrap_or_else(|| uncertainty::unanalysed(&self.problem, &report))
            }
        };
        Ok(Some(assemble::outcome(&self.origin, &conclusion)))
    }

    /// Goes on to the end, or until `stop` is raised; then the outcome is the best so far, and
    /// nothing that takes long is found out about it.
    ///
    /// # Errors
    /// When the data do not fix the unknowns, and when no candidate could be simulated.
    pub fn finish(
        mut self,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Result<Outcome, IdentificationError> {
        let stopped = loop {
            match self.advance(stop, observer) {
                Advance::Working => {}
                Advance::Finished => break None,
                Advance::Interrupted => break Some(StopReason::Cancelled),
            }
        };
        self.outcome(stopped, stop)?
            .ok_or(IdentificationError::NoEstimate)
    }
}

fn assembled(
    spec: &JobSpec,
    model: &Arc<Model>,
    recordings: &[impl Borrow<Recording>],
) -> Result<Assembly, IdentificationError> {
    assemble::problem(spec, model, recordings).map_err(IdentificationError::Invalid)
}
