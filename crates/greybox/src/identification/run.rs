//! An identification as a run: look ahead, search and refine, analyse.
//!
//! A run goes on in units ([`Run::advance`]) and can be saved after any of them and resumed with
//! the same bits. The look ahead belongs to the first unit. The analysis takes as many units as its
//! refits ask for; refits that have finished are part of the checkpoint. Other nodes may run some of
//! the refits, and searches ahead of the one at work ([`Run::help`]); the node that has the run adds
//! their parts ([`Run::take_parts`]), with the same bits.

use super::IdentificationError;
use super::advice::Advised;
use super::checkpoint::{Checkpoint, Part};
use super::next_steps::{Finished, OpenStep};
use super::tried::Tries;
use crate::estimation::{
    Advance, Estimation, Finding, Observer, Phase, Problem, Progress, Share, StopReason,
};
use crate::identification::assemble::{self, Assembly, Origin};
use crate::identification::{JobSpec, Outcome};
use crate::uncertainty::identifiability::FlatDirection;
use crate::uncertainty::refits::Division;
use crate::uncertainty::{self, Analyser, Conclusion, Quota, Refits};
use greybox_recording::Recording;
use greybox_simulation::model::Model;
use std::borrow::Borrow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

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
    stage: RunStage,
    estimation: Estimation,
    /// Finished refits of the analysis.
    refits: Refits,
    /// The next steps that were tried.
    tries: Tries,
    /// The refits that a unit of the analysis runs.
    quota: Quota,
}

/// Where a run stands.
#[derive(Debug)]
enum RunStage {
    /// A new run is about to find out what the data do not see. Its findings are those that were
    /// made before anything is simulated.
    LookAhead(Vec<Finding>),
    /// The data do not fix the unknowns: the run goes no further.
    Refused(Vec<Finding>),
    /// The estimation searches and refines.
    Estimate,
    /// The estimate stands and is analysed.
    Analyse(Box<Analyser>),
    /// The estimate is analysed, and the next steps of its verdict are tried.
    Advise(Box<Advising>),
    /// The run has ended with an estimate.
    Concluded(Box<Conclusion>),
    /// The run has ended, and no candidate could be simulated.
    WithoutEstimate,
}

/// A conclusion with the next step that is about to be tried.
#[derive(Debug)]
struct Advising {
    conclusion: Conclusion,
    step: OpenStep,
}

/// The refits of a unit of the analysis, where no other node runs any.
const QUOTA_ALONE: Quota = Quota {
    division: Division::Undivided,
    at_most: 64,
};

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
            stage: RunStage::LookAhead(findings),
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
        let Checkpoint {
            estimation,
            refits,
            tries,
        } = checkpoint;
        let estimation = Estimation::resume(&problem, &spec.method, spec.seed, estimation)?;
        let mut run = Run::of(spec, problem, estimation);
        run.refits = Refits::from(refits);
        run.tries = tries;
        if run.estimation.phase() == Phase::Analyse {
            run.stage = run.analysis();
        }
        Ok(run)
    }

    fn of(spec: &JobSpec, problem: Problem, estimation: Estimation) -> Run {
        Run {
            origin: Origin {
                job: spec.name.clone().unwrap_or_default(),
                spec: spec.clone(),
                dataset_digests: Vec::new(),
            },
            request: spec.request(problem.model.description()),
            problem,
            stage: RunStage::Estimate,
            estimation,
            refits: Refits::default(),
            tries: Tries::new(),
            quota: QUOTA_ALONE,
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
            refits: self.refits.finished().clone(),
            tries: self.tries.clone(),
        }
    }

    /// One unit of work: a generation of the search, an iteration of the refinement or a part of
    /// the analysis. When `stop` is raised it may return early, with nothing changed; the unit is then
    /// done again later, with the same bits.
    pub fn advance(&mut self, stop: &AtomicBool, observer: &mut dyn Observer) -> Advance {
        match &mut self.stage {
            RunStage::LookAhead(findings) => {
                let findings = findings.clone();
                let Some(stage) = self.look_ahead(findings, stop, observer) else {
                    return Advance::Interrupted;
                };
                self.stage = stage;
                self.advance(stop, observer)
            }
            RunStage::Estimate => match self.estimation.advance(&self.problem, stop, observer) {
                Advance::Finished => {
                    self.stage = self.analysis();
                    Advance::Working
                }
                advance => advance,
            },
            RunStage::Analyse(analyser) => {
                let stretches = self.refits.stretches_of_chains();
                let advance = analyser.advance(&mut self.refits, self.quota, stop);
                let looks = analyser.posterior_looks().iter();
                looks
                    .filter(|look| look.stretch > stretches)
                    .for_each(|look| observer.posterior(look));
                let (Advance::Finished, Some(conclusion)) = (advance, analyser.conclusion()) else {
                    return advance;
                };
                // A run that is resumed after each unit comes to a step in the unit that ends its analysis.
                match self.advise(conclusion) {
                    Advance::Working => self.advance(stop, observer),
                    advance => advance,
                }
            }
            RunStage::Advise(advising) => {
                let Advising { conclusion, step } = &**advising;
                let advised = Advised {
                    spec: &self.origin.spec,
                    problem: &self.problem,
                    conclusion,
                };
                let Some(tried) = advised.tried(&step.spec, stop) else {
                    return Advance::Interrupted;
                };
                self.tries.insert(step.patch.clone(), tried);
                let conclusion = conclusion.clone();
                self.advise(conclusion)
            }
            RunStage::Refused(_) | RunStage::Concluded(_) | RunStage::WithoutEstimate => {
                Advance::Finished
            }
        }
    }

    /// Finds out what the data do not see, before a new run searches for it, and answers the stage that
    /// follows; nothing when `stop` was raised.
    fn look_ahead(
        &self,
        findings: Vec<Finding>,
        stop: &AtomicBool,
        observer: &mut dyn Observer,
    ) -> Option<RunStage> {
        let flat = assemble::flat_directions(&self.problem, stop)?;
        let reported = |flat: &FlatDirection| assemble::unseen(&self.problem, flat);
        let flat_directions = self.request.settings.flat_directions;
        let refuses = |flat: &&FlatDirection| flat_directions.refuses(flat);
        let grounds: Vec<Finding> = flat.iter().filter(refuses).map(reported).collect();
        if !grounds.is_empty() {
            return Some(RunStage::Refused(grounds));
        }
        for finding in findings.into_iter().chain(flat.iter().map(reported)) {
            observer.finding(&finding);
        }
        Some(RunStage::Estimate)
    }

    /// Tries the next steps of a conclusion, or ends where enough of them have been tried.
    fn advise(&mut self, conclusion: Conclusion) -> Advance {
        let finished = Finished {
            spec: &self.origin.spec,
            conclusion: &conclusion,
            tries: &self.tries,
        };
        let fitted = self.tries.values().flatten().count();
        let mut open = finished.open_steps().into_iter();
        let step = match fitted < self.request.settings.tried_steps as usize {
            true => open.find(|step| !self.tries.contains_key(&step.patch)),
            false => None,
        };
        match step {
            Some(step) => {
                self.stage = RunStage::Advise(Box::new(Advising { conclusion, step }));
                Advance::Working
            }
            None => {
                self.stage = RunStage::Concluded(Box::new(conclusion));
                Advance::Finished
            }
        }
    }

    /// The stage that follows when the estimation has finished.
    fn analysis(&self) -> RunStage {
        match self.estimation.report(&self.problem, None) {
            Some(report) => {
                let analyser = Analyser::new(&self.problem, &report, &self.request);
                RunStage::Analyse(Box::new(analyser))
            }
            None => RunStage::WithoutEstimate,
        }
    }

    /// Whether other nodes may do some of what is left: searches follow the one at work, or the analysis has
    /// many refits that do not depend on each other.
    #[must_use]
    pub fn is_shareable(&self) -> bool {
        match &self.stage {
            RunStage::Estimate => self.estimation.has_searches_ahead(),
            RunStage::Analyse(analyser) => analyser.has_independent_refits(),
            _ => false,
        }
    }

    /// Runs the refits of a share first, because other nodes begin with the other shares, and so many in a
    /// unit at the most: after each unit the other nodes are told which refits have finished.
    pub fn share(&mut self, share: Share, at_most: u32) {
        self.quota = Quota {
            division: Division::StartingWith(share),
            at_most,
        };
    }

    /// Takes over what another node did.
    pub fn take_parts(&mut self, parts: impl IntoIterator<Item = (String, Part)>) {
        for (name, part) in parts {
            match part {
                Part::Refit(refit) => self.refits.add(&name, refit),
                Part::Search(update) => self.estimation.apply(update),
            }
        }
    }

    /// The parts that were done here since this was last called, for other nodes.
    pub fn new_parts(&mut self) -> Vec<(String, Part)> {
        let refits = self.refits.take_new().into_iter();
        let refits = refits.map(|(name, refit)| (name.to_string(), Part::Refit(refit)));
        let update = self.estimation.take_update().map(Part::of_search);
        refits.chain(update).collect()
    }

    /// Does so many refits or generations of a share at the most for the node that has the run; none
    /// where nothing of the share is left, or can be done yet.
    pub fn help(&mut self, share: Share, at_most: u32, stop: &AtomicBool) -> Vec<(String, Part)> {
        match &mut self.stage {
            RunStage::Analyse(analyser) if analyser.has_independent_refits() => {
                let division = Division::Only(share);
                let quota = Quota { division, at_most };
                analyser.advance(&mut self.refits, quota, stop);
                self.new_parts()
            }
            _ => {
                let problem = &self.problem;
                let update = self.estimation.help(problem, share, at_most, stop);
                update.map(Part::of_search).into_iter().collect()
            }
        }
    }

    /// The outcome: final when the run has finished, else, with why it was `stopped`, the best so
    /// far, which is nothing before the first candidate was judged. When `hurry` is raised it
    /// answers soon, without what takes long to be found out about the estimate.
    ///
    /// # Errors
    /// When the data do not fix the unknowns.
    pub fn outcome(
        &self,
        stopped: Option<StopReason>,
        hurry: &AtomicBool,
    ) -> Result<Option<Outcome>, IdentificationError> {
        match &self.stage {
            RunStage::Refused(grounds) => {
                return Err(IdentificationError::NotIdentifiable(grounds.clone()));
            }
            RunStage::Concluded(conclusion) if stopped.is_none() => {
                return Ok(Some(assemble::outcome(
                    &self.origin,
                    conclusion,
                    &self.tries,
                )));
            }
            // A step that was not tried is no part of the result that is missing.
            RunStage::Advise(advising) => {
                let conclusion = &advising.conclusion;
                return Ok(Some(assemble::outcome(
                    &self.origin,
                    conclusion,
                    &self.tries,
                )));
            }
            _ => {}
        }
        let Some(report) = self.estimation.report(&self.problem, stopped) else {
            return Ok(None);
        };
        let request = match (stopped, &self.stage) {
            (None, _) => self.request.clone(),
            // What the free run says is complete where only noise models were still compared.
            (Some(_), RunStage::Analyse(analyser)) if analyser.compares_noise() => {
                self.request.of_free_run()
            }
            // A run that was stopped is not kept waiting for the more thorough answers.
            (Some(_), _) => uncertainty::Request::default(),
        };
        let refits = self.refits.clone();
        let conclusion = uncertainty::conclude(&self.problem, &report, &request, refits, hurry);
        let unanalysed = || uncertainty::unanalysed(&self.problem, &report);
        let conclusion = conclusion.unwrap_or_else(unanalysed);
        Ok(Some(assemble::outcome(
            &self.origin,
            &conclusion,
            &self.tries,
        )))
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
