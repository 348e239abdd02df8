//! The steps from an estimate to its conclusion.
//!
//! Outputs of unknown noise are weighed anew ([`super::reweighting`]), the effects that the data
//! support are selected ([`super::selection`]), what is taken as known is moved to where the data and
//! the tolerances put it ([`super::nuisances`]), and the estimate is linearised
//! ([`super::linearised`]). Each step lists the refits that it waits for; when they have finished
//! the step comes to the next one, the last step to the conclusion. Refits that are finished when
//! the analysis begins are not run again, so an analysis that was saved goes on with the same bits.

use super::disturbed_estimate::DisturbedEstimate;
use super::linearised::LinearisedEstimate;
use super::noise_comparison::{AfterNoiseRound, NoiseComparison};
use super::nuisances::NuisanceFit;
use super::refits::{Quota, RefitSequence, Refits};
use super::reweighting::Reweighting;
use super::selection::{AfterRound, Elimination, Selected, Selection};
use super::solved::Solved;
use super::{Analysis, Request, validation_start};
use crate::estimation::Advance;
use crate::estimation::observer::PosteriorRow;
use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use std::sync::atomic::{AtomicBool, Ordering};

/// An estimate with all that is said of it.
#[derive(Clone, Debug)]
pub struct Conclusion {
    /// The problem that the estimate solves: without the effects that the data do not support.
    pub problem: Problem,
    /// What the run came to, at the estimate.
    pub report: Report,
    /// What is known of the estimate.
    pub analysis: Analysis,
    /// How the effects were chosen, where the job left that open.
    pub selection: Option<Selection>,
}

/// Comes from an estimate to its conclusion at once, with the refits that have finished already.
/// Answers nothing when `stop` was raised.
#[must_use]
pub fn conclude(
    problem: &Problem,
    report: &Report,
    request: &Request,
    mut refits: Refits,
    stop: &AtomicBool,
) -> Option<Conclusion> {
    let mut analyser = Analyser::new(problem, report, request);
    analyser.advance(&mut refits, Quota::UNLIMITED, stop);
    analyser.conclusion()
}

/// An analysis at work.
#[derive(Debug)]
pub struct Analyser {
    request: Request,
    step: AnalysisStep,
}

#[derive(Debug)]
enum AnalysisStep {
    /// The estimate stands as the run came to it.
    Begin(Box<Solved>),
    /// Outputs of unknown noise are weighed anew.
    Reweight(Box<Reweighting>),
    /// Models without some of the effects are tried.
    Select(Box<Elimination>),
    /// Assumed values are moved to where the data and the tolerances put them.
    Move(Box<Moving>),
    /// Noise models are fitted.
    CompareNoise(Box<Comparing>),
    /// The estimate is linearised; refits improve what follows from that.
    Examine(Box<Examined>),
    /// The estimate under a noise model is linearised.
    ExamineDisturbed(Box<ExaminedDisturbed>),
}

/// An estimate whose nuisances are moved.
#[derive(Debug)]
struct Moving {
    /// The estimate with the declared values.
    unmoved: Solved,
    fit: NuisanceFit,
    selection: Option<Selection>,
}

/// An estimate to which noise models are fitted.
#[derive(Debug)]
struct Comparing {
    comparison: NoiseComparison,
    /// The estimate of the free run.
    stands: Solved,
    selection: Option<Selection>,
}

/// The estimate that stands, as far as it is looked at.
#[derive(Debug)]
struct Examined {
    estimate: LinearisedEstimate,
    selection: Option<Selection>,
}

/// The estimate under a noise model.
#[derive(Debug)]
struct ExaminedDisturbed {
    estimate: DisturbedEstimate,
    selection: Option<Selection>,
}

impl AnalysisStep {
    /// The refits that the step waits for.
    fn sequences(&mut self) -> Vec<&mut dyn RefitSequence> {
        match self {
            AnalysisStep::Begin(_) => Vec::new(),
            AnalysisStep::Reweight(reweighting) => vec![&mut **reweighting],
            AnalysisStep::Select(elimination) => elimination.sequences(),
            AnalysisStep::CompareNoise(comparing) => comparing.comparison.sequences(),
            AnalysisStep::Move(moving) => vec![&mut moving.fit],
            AnalysisStep::Examine(examined) => examined.estimate.sequences(),
            AnalysisStep::ExamineDisturbed(examined) => examined.estimate.sequences(),
        }
    }
}

impl Analyser {
    /// Begins the analysis of an estimate.
    #[must_use]
    pub fn new(problem: &Problem, report: &Report, request: &Request) -> Analyser {
        let solved = Solved {
            problem: problem.clone(),
            report: report.clone(),
        };
        Analyser {
            request: request.clone(),
            step: AnalysisStep::Begin(Box::new(solved)),
        }
    }

    /// Whether there are many refits that do not depend on each other.
    #[must_use]
    pub fn has_independent_refits(&self) -> bool {
        self.request.settings.has_independent_refits() || !self.request.effects.is_empty()
    }

    /// Whether the estimate of the free run stands and noise models are compared.
    #[must_use]
    pub fn compares_noise(&self) -> bool {
        matches!(self.step, AnalysisStep::CompareNoise(_))
    }

    /// Runs refits up to a quota, step after step: finished when no step waits for any, interrupted
    /// when `stop` was raised. What has finished by then is among `refits`.
    pub fn advance(&mut self, refits: &mut Refits, quota: Quota, stop: &AtomicBool) -> Advance {
        let mut quota = quota;
        loop {
            let mut sequences = self.step.sequences();
            quota.at_most -= refits.run(&mut sequences, quota, stop);
            if sequences.iter().any(|sequence| sequence.next().is_some()) {
                return match stop.load(Ordering::Relaxed) {
                    true => Advance::Interrupted,
                    false => Advance::Working,
                };
            }
            let next = match &self.step {
                AnalysisStep::Begin(solved) => self.reweight(&solved.problem, &solved.report, stop),
                AnalysisStep::Reweight(weighed) => {
                    self.select(&weighed.problem, &weighed.report, stop)
                }
                AnalysisStep::Select(elimination) => match elimination.after_round() {
                    AfterRound::Further(elimination) => Some(AnalysisStep::Select(elimination)),
                    AfterRound::Selected(selected) => {
                        let Selected {
                            problem,
                            report,
                            selection,
                        } = *selected;
                        self.move_nuisances(&problem, &report, Some(selection), stop)
                    }
                },
                AnalysisStep::Move(moving) => {
                    let stands = Solved {
                        problem: moving.fit.problem.clone(),
                        report: moving.fit.report.clone(),
                    };
                    let selection = moving.selection.clone();
                    self.compare_noise(&moving.unmoved, &stands, selection, stop)
                }
                AnalysisStep::CompareNoise(comparing) => self.after_noise_round(comparing, stop),
                AnalysisStep::Examine(_) | AnalysisStep::ExamineDisturbed(_) => {
                    return Advance::Finished;
                }
            };
            match next {
                Some(step) => self.step = step,
                None => return Advance::Interrupted,
            }
        }
    }

    fn reweight(
        &self,
        problem: &Problem,
        report: &Report,
        stop: &AtomicBool,
    ) -> Option<AnalysisStep> {
        if !self.request.thorough {
            return self.select(problem, report, stop);
        }
        let reweighting = Reweighting::begin(problem, report, stop)?;
        Some(AnalysisStep::Reweight(Box::new(reweighting)))
    }

    fn select(
        &self,
        problem: &Problem,
        report: &Report,
        stop: &AtomicBool,
    ) -> Option<AnalysisStep> {
        let effects = &self.request.effects;
        if effects.is_empty() {
            return self.move_nuisances(problem, report, None, stop);
        }
        let elimination = Elimination::begin(problem, report, effects, stop)?;
        Some(AnalysisStep::Select(Box::new(elimination)))
    }

    fn move_nuisances(
        &self,
        problem: &Problem,
        report: &Report,
        selection: Option<Selection>,
        stop: &AtomicBool,
    ) -> Option<AnalysisStep> {
        let unmoved = Solved {
            problem: problem.clone(),
            report: report.clone(),
        };
        if !self.request.thorough || problem.assumptions.is_empty() {
            return self.compare_noise(&unmoved, &unmoved, selection, stop);
        }
        let fit = NuisanceFit::begin(problem, report, stop)?;
        Some(AnalysisStep::Move(Box::new(Moving {
            unmoved,
            fit,
            selection,
        })))
    }

    /// Noise models begin at the declared values: what is taken as known is not moved for what a disturbance
    /// does.
    fn compare_noise(
        &self,
        unmoved: &Solved,
        stands: &Solved,
        selection: Option<Selection>,
        stop: &AtomicBool,
    ) -> Option<AnalysisStep> {
        match NoiseComparison::begin(stands, unmoved, &self.request, stop)? {
            Some(comparison) => {
                let comparing = Comparing {
                    comparison,
                    stands: stands.clone(),
                    selection,
                };
                Some(AnalysisStep::CompareNoise(Box::new(comparing)))
            }
            None => self.examine(stands, selection, stop),
        }
    }

    fn after_noise_round(&self, comparing: &Comparing, stop: &AtomicBool) -> Option<AnalysisStep> {
        let selection = comparing.selection.clone();
        match comparing.comparison.after_round(&self.request, stop)? {
            AfterNoiseRound::Further(comparison) => {
                Some(AnalysisStep::CompareNoise(Box::new(Comparing {
                    comparison: *comparison,
                    stands: comparing.stands.clone(),
                    selection,
                })))
            }
            AfterNoiseRound::Taken(estimate) => {
                let examined = ExaminedDisturbed {
                    estimate: *estimate,
                    selection,
                };
                Some(AnalysisStep::ExamineDisturbed(Box::new(examined)))
            }
            AfterNoiseRound::FreeRun => self.examine(&comparing.stands, selection, stop),
        }
    }

    fn examine(
        &self,
        solved: &Solved,
        selection: Option<Selection>,
        stop: &AtomicBool,
    ) -> Option<AnalysisStep> {
        let report = &solved.report;
        let problem = validation_start::settled(&solved.problem, &report.positions, stop)?;
        let estimate = LinearisedEstimate::of(&problem, report, &self.request, stop)?;
        Some(AnalysisStep::Examine(Box::new(Examined {
            estimate,
            selection,
        })))
    }

    /// Returns how far the chains of a posterior came, a row for each look at them; empty where none was asked for.
    #[must_use]
    pub fn posterior_looks(&self) -> &[PosteriorRow] {
        match &self.step {
            AnalysisStep::Examine(examined) => examined.estimate.posterior_looks(),
            AnalysisStep::ExamineDisturbed(examined) => examined.estimate.posterior_looks(),
            _ => &[],
        }
    }

    /// The conclusion; none before all refits have finished.
    #[must_use]
    pub fn conclusion(&self) -> Option<Conclusion> {
        let examined = match &self.step {
            AnalysisStep::Examine(examined) => examined,
            AnalysisStep::ExamineDisturbed(examined) => {
                return Some(Conclusion {
                    problem: examined.estimate.plant.clone(),
                    report: examined.estimate.report.clone(),
                    analysis: examined.estimate.analysis()?,
                    selection: examined.selection.clone(),
                });
            }
            _ => return None,
        };
        let analysis = examined.estimate.analysis()?;
        let solved = examined.estimate.estimate();
        Some(Conclusion {
            problem: solved.problem.clone(),
            report: solved.report.clone(),
            analysis,
            selection: examined.selection.clone(),
        })
    }
}
