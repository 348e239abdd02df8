//! Which of the effects that a job may leave out its data support.
//!
//! The estimate with all effects free is refitted without each of them in turn, and without the
//! one whose loss the criterion likes best that goes on, as long as the criterion falls (backward
//! elimination). The model without any and those with a single one are fitted too, so that the
//! table shows what each effect is worth alone. Where one of them comes lower than the model with all,
//! whose search has missed its floor, that is fitted again from there. The criterion is Schwarz's ([`super::fit`]), of the
//! data that were held back where there are any. An effect that is left out has its value in
//! [`Problem::parameters`].

use super::fit::{self, OutputFit, Part};
use super::refits::{Refit, RefitName, RefitSequence, RefitTask};
use super::validation_start;
use crate::estimation::problem::{Coordinate, Problem, Target};
use crate::estimation::report::Report;
use crate::estimation::trajectory;
use greybox_simulation::Accuracy;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use utoipa::ToSchema;

/// A model with some of the effects.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct TriedModel {
    /// The effects that the model has; other effects stand at the model's defaults.
    pub effects: Vec<String>,
    /// The number of unknowns of the model, effects included.
    pub unknowns: u64,
    /// The cost; `null` where the model could not be fitted.
    pub cost: Option<f64>,
    /// Schwarz's criterion of the data that the models are compared by; `null` where the model
    /// could not be fitted.
    pub bic: Option<f64>,
    /// How well the model explains what it was fitted to, by output.
    pub estimation: BTreeMap<String, OutputFit>,
    /// How well the model explains what was held back, by output.
    pub validation: BTreeMap<String, OutputFit>,
}

/// The outcome of a selection of effects.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Every model that was tried, the best first.
    pub tried: Vec<TriedModel>,
    /// The part of the data by which the models were compared.
    pub compared_on: Part,
}

/// A model with its fit.
#[derive(Clone, Debug)]
struct FittedModel {
    problem: Problem,
    positions: Vec<f64>,
    tried: TriedModel,
}

/// A model whose cost is smaller by more than this share than that of one with more unknowns has shown that the
/// larger one is not at its floor.
const BELOW: f64 = 1e-6;

impl FittedModel {
    /// Whether the model explains what it was fitted to better than another one.
    fn is_below(&self, other: &FittedModel) -> bool {
        match (self.tried.cost, other.tried.cost) {
            (Some(cost), Some(rival)) => cost < (1.0 - BELOW) * rival,
            (cost, rival) => cost.is_some() && rival.is_none(),
        }
    }

    fn is_better_than(&self, other: &FittedModel) -> bool {
        match (self.tried.bic, other.tried.bic) {
            (Some(criterion), Some(rival)) => criterion < rival,
            (criterion, rival) => criterion.is_some() && rival.is_none(),
        }
    }
}

/// The model whose effects the data support, with its estimate.
#[derive(Debug)]
pub(super) struct Selected {
    /// The problem without the effects that are left out.
    pub problem: Problem,
    /// The estimate.
    pub report: Report,
    /// How the effects were chosen.
    pub selection: Selection,
}

/// What follows when all models of a round are fitted.
#[derive(Debug)]
pub(super) enum AfterRound {
    /// Smaller models are tried.
    Further(Box<Elimination>),
    /// No smaller model is better.
    Selected(Box<Selected>),
}

/// A backward elimination of effects, a round of models at a time.
#[derive(Debug)]
pub(super) struct Elimination {
    basis: Arc<EliminationBasis>,
    /// The models that earlier rounds have tried.
    tried: Vec<FittedModel>,
    /// The model that smaller ones are measured against.
    current: FittedModel,
    round: Round,
    /// The models of this round.
    fits: Vec<ModelFit>,
}

/// A round of an elimination.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Round {
    /// The models with a single effect and with none, which show what each effect is worth.
    Singles,
    /// The model with all effects, from where a smaller one came lower.
    Raise,
    /// The models with one effect less than the best.
    Eliminate,
}

impl Elimination {
    /// Begins with an estimate that has all effects. Answers nothing when `stop` was raised.
    pub fn begin(
        problem: &Problem,
        report: &Report,
        effects: &[String],
        stop: &AtomicBool,
    ) -> Option<Elimination> {
        let has_validation = problem
            .experiments
            .iter()
            .any(|experiment| experiment.samples > experiment.estimation_samples);
        let mut basis = EliminationBasis {
            problem: problem.clone(),
            report: report.clone(),
            effects: effects.to_vec(),
            compared_on: if has_validation {
                Part::Validation
            } else {
                Part::Estimation
            },
            worst: f64::INFINITY,
        };
        let positions = report.positions.clone();
        let whole = basis.measure(problem.clone(), positions, report.cost, stop)?;
        basis.worst = whole.tried.bic.unwrap_or(f64::INFINITY) + HOPELESS;
        // A single effect is the whole model, which is fitted already.
        let alone = effects.iter().filter(|_| effects.len() > 1);
        let singles = alone.map(|effect| vec![effect.clone()]);
        let basis = Arc::new(basis);
        let fits = ModelFit::all(&basis, singles.chain([Vec::new()]));
        Some(Elimination {
            basis,
            tried: Vec::new(),
            current: whole,
            round: Round::Singles,
            fits,
        })
    }

    /// The fits of the models of this round.
    pub fn sequences(&mut self) -> Vec<&mut dyn RefitSequence> {
        let fits = self.fits.iter_mut();
        fits.map(|fit| fit as &mut dyn RefitSequence).collect()
    }

    /// Goes on when all models of the round are fitted.
    pub fn after_round(&self) -> AfterRound {
        let fitted: Vec<&FittedModel> = self.fits.iter().filter_map(ModelFit::fitted).collect();
        let mut tried = self.tried.clone();
        tried.extend(fitted.iter().copied().cloned());
        match self.round {
            Round::Singles => match fitted.iter().find(|fit| fit.is_below(&self.current)) {
                Some(_) => self.raise(&fitted, tried),
                None => {
                    tried.push(self.current.clone());
                    self.eliminate(&self.basis, &self.current, tried)
                }
            },
            Round::Raise => {
                let raised = fitted.iter().find(|raised| raised.is_below(&self.current));
                let whole = raised.map_or(&self.current, |raised| *raised);
                let mut tried = self.tried.clone();
                tried.push(whole.clone());
                self.eliminate(&self.basis.standing_at(whole), whole, tried)
            }
            Round::Eliminate => {
                let best = fitted.iter().fold(None, |best, fit| match best {
                    Some(best) if !fit.is_better_than(best) => Some(best),
                    _ => Some(*fit),
                });
                match best.filter(|best| best.is_better_than(&self.current)) {
                    Some(better) => self.eliminate(&self.basis, better, tried),
                    None => AfterRound::Selected(Box::new(self.selected(tried))),
                }
            }
        }
    }

    /// Fits the model with all effects from the lowest of smaller ones.
    fn raise(&self, fitted: &[&FittedModel], tried: Vec<FittedModel>) -> AfterRound {
        let lowest = fitted.iter().fold(&self.current, |lowest, fit| {
            if fit.is_below(lowest) { fit } else { lowest }
        });
        let start = self.basis.raised(lowest);
        let raised = ModelFit {
            basis: Arc::clone(&self.basis),
            effects: self.basis.effects.clone(),
            stage: FitStage::Coarse {
                problem: self.basis.problem.clone(),
                start,
            },
        };
        AfterRound::Further(Box::new(Elimination {
            basis: Arc::clone(&self.basis),
            current: self.current.clone(),
            round: Round::Raise,
            fits: vec![raised],
            tried,
        }))
    }

    /// Tries the models with one effect less than the current one.
    fn eliminate(
        &self,
        basis: &Arc<EliminationBasis>,
        current: &FittedModel,
        tried: Vec<FittedModel>,
    ) -> AfterRound {
        let kept = &current.tried.effects;
        let without = |left: &String| kept.iter().filter(|kept| *kept != left).cloned().collect();
        let is_new = |effects: &Vec<String>| tried.iter().all(|fit| fit.tried.effects != *effects);
        let smaller = kept.iter().map(without).filter(is_new);
        let fits = ModelFit::all(basis, smaller);
        AfterRound::Further(Box::new(Elimination {
            basis: Arc::clone(basis),
            current: current.clone(),
            round: Round::Eliminate,
            fits,
            tried,
        }))
    }

    /// Selects the best of all models that were tried.
    fn selected(&self, mut tried: Vec<FittedModel>) -> Selected {
        tried.sort_by(|a, b| {
            let worth = |fit: &FittedModel| fit.tried.bic.unwrap_or(f64::INFINITY);
            worth(a).total_cmp(&worth(b))
        });
        let best = tried.first().unwrap_or(&self.current).clone();
        Selected {
            report: Report {
                values: best.problem.values(&best.positions),
                positions: best.positions,
                cost: best.tried.cost,
                ..self.basis.report.clone()
            },
            problem: best.problem,
            selection: Selection {
                tried: tried.into_iter().map(|fit| fit.tried).collect(),
                compared_on: self.basis.compared_on,
            },
        }
    }
}

/// Between a coarse fit and a fine one the criterion changes by less than this: a model that is so
/// much worse after its coarse fit stays worse.
const HOPELESS: f64 = 100.0;

/// What all fits have in common.
#[derive(Clone, Debug)]
struct EliminationBasis {
    problem: Problem,
    /// The estimate with all effects.
    report: Report,
    effects: Vec<String>,
    compared_on: Part,
    /// A model with a larger criterion is not fitted any more closely.
    worst: f64,
}

/// The fit of one model: coarse, then fine where the coarse one gives hope.
#[derive(Debug)]
struct ModelFit {
    basis: Arc<EliminationBasis>,
    effects: Vec<String>,
    stage: FitStage,
}

#[derive(Debug)]
enum FitStage {
    /// The coarse fit comes next.
    Coarse { problem: Problem, start: Vec<f64> },
    /// The fine fit comes next, from where the coarse one ended.
    Fine(FittedModel),
    /// The model is fitted.
    Fitted(FittedModel),
}

impl ModelFit {
    /// Begins the fits of the models with each of these sets of effects.
    fn all(
        basis: &Arc<EliminationBasis>,
        models: impl Iterator<Item = Vec<String>>,
    ) -> Vec<ModelFit> {
        models
            .map(|effects| {
                let (problem, start) = basis.reduced(&effects);
                ModelFit {
                    basis: Arc::clone(basis),
                    effects,
                    stage: FitStage::Coarse { problem, start },
                }
            })
            .collect()
    }

    fn fitted(&self) -> Option<&FittedModel> {
        match &self.stage {
            FitStage::Fitted(fitted) => Some(fitted),
            FitStage::Coarse { .. } | FitStage::Fine(_) => None,
        }
    }
}

impl RefitSequence for ModelFit {
    fn next(&self) -> Option<RefitName> {
        let is_fine = match &self.stage {
            FitStage::Coarse { .. } => false,
            FitStage::Fine(_) => true,
            FitStage::Fitted(_) => return None,
        };
        Some(RefitName::Effects {
            effects: self.effects.clone(),
            is_fine,
        })
    }

    fn run(&self, stop: &AtomicBool) -> Option<Refit> {
        let (problem, start, accuracy) = match &self.stage {
            FitStage::Coarse { problem, start } => (problem, start, Accuracy::Screening),
            FitStage::Fine(coarse) | FitStage::Fitted(coarse) => {
                (&coarse.problem, &coarse.positions, Accuracy::Full)
            }
        };
        RefitTask {
            problem: Cow::Borrowed(problem),
            start: start.clone(),
            accuracy,
        }
        .run(stop)
    }

    fn follow(&mut self, refit: &Refit, stop: &AtomicBool) -> Option<()> {
        let (problem, is_coarse) = match &self.stage {
            FitStage::Coarse { problem, .. } => (problem, true),
            FitStage::Fine(coarse) | FitStage::Fitted(coarse) => (&coarse.problem, false),
        };
        let (problem, positions) = (problem.clone(), refit.positions.clone());
        let fitted = self.basis.measure(problem, positions, refit.cost, stop)?;
        let is_hopeless = |criterion: f64| criterion > self.basis.worst;
        self.stage = if is_coarse && !fitted.tried.bic.is_none_or(is_hopeless) {
            FitStage::Fine(fitted)
        } else {
            FitStage::Fitted(fitted)
        };
        Some(())
    }
}

impl EliminationBasis {
    /// The basis with the estimate that the model with all effects has come to.
    fn standing_at(&self, whole: &FittedModel) -> Arc<EliminationBasis> {
        let mut basis = self.clone();
        basis.report.positions.clone_from(&whole.positions);
        Arc::new(basis)
    }

    /// The positions of the model with all effects where it is a smaller one.
    fn raised(&self, smaller: &FittedModel) -> Vec<f64> {
        let position = |(place, unknown): (usize, &Coordinate)| {
            let fitted = smaller.problem.coordinates.iter();
            let mut fitted = fitted.zip(&smaller.positions);
            let fitted = fitted.find(|(fitted, _)| fitted.name == unknown.name);
            let left_out = || match unknown.target {
                Target::Parameter(parameter) => {
                    let value = smaller.problem.parameters[parameter];
                    let Coordinate { lower, upper, .. } = *unknown;
                    unknown
                        .scale
                        .position(value.clamp(lower, upper), lower, upper)
                }
                _ => self.report.positions[place],
            };
            fitted.map_or_else(left_out, |(_, position)| *position)
        };
        let unknowns = self.problem.coordinates.iter().enumerate();
        unknowns.map(position).collect()
    }

    /// The problem without the effects that a model leaves out, and where to fit it from.
    fn reduced(&self, effects: &[String]) -> (Problem, Vec<f64>) {
        let is_left_out = |name: &String| self.effects.contains(name) && !effects.contains(name);
        let mut problem = self.problem.clone();
        problem
            .coordinates
            .retain(|unknown| !is_left_out(&unknown.name));
        let all = self.problem.coordinates.iter().zip(&self.report.positions);
        let kept = all.filter(|(unknown, _)| !is_left_out(&unknown.name));
        (problem, kept.map(|(_, position)| *position).collect())
    }

    /// Measures a model at its fit. Answers nothing when `stop` was raised.
    fn measure(
        &self,
        problem: Problem,
        positions: Vec<f64>,
        cost: Option<f64>,
        stop: &AtomicBool,
    ) -> Option<FittedModel> {
        let problem = validation_start::settled(&problem, &positions, stop)?;
        let trajectories = trajectory::simulate(&problem, &positions, stop)?;
        let fits = |part| match &trajectories {
            Ok(trajectories) => fit::of(&problem, trajectories, part),
            Err(_) => Vec::new(),
        };
        let (estimation_fit, validation_fit) = (fits(Part::Estimation), fits(Part::Validation));
        let compared = match self.compared_on {
            Part::Estimation => &estimation_fit,
            Part::Validation => &validation_fit,
        };
        let criteria = fit::criteria(compared, problem.coordinates.len());
        let names = problem.coordinates.iter().map(|unknown| &unknown.name);
        let effects = names.filter(|name| self.effects.contains(name)).cloned();
        Some(FittedModel {
            tried: TriedModel {
                effects: effects.collect(),
                unknowns: problem.coordinates.len() as u64,
                cost,
                bic: criteria.bic.filter(|_| trajectories.is_ok()),
                estimation: problem.by_output(&estimation_fit),
                validation: problem.by_output(&validation_fit),
            },
            positions,
            problem,
        })
    }
}

#[cfg(test)]
mod tests;
