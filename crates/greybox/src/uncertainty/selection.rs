//! Which of the effects that a job may leave out its data support.
//!
//! The estimate with all effects free is refitted without each of them in turn, and without the
//! one whose loss the criterion likes best that goes on, as long as the criterion falls (backward
//! elimination). The model without any and those with a single one are fitted too, so that the
//! table shows what each effect is worth alone. The criterion is Schwarz's ([`super::fit`]), of the
//! data that were held back where there are any. An effect that is left out has its value in
//! [`Problem::parameters`].

use super::fit::{self, OutputFit, Part};
use super::{Analysis, Refits, Request, analyse, reweighting, validation_start};
use crate::estimation::problem::Problem;
use crate::estimation::report::Report;
use crate::estimation::trajectory;
use greybox_simulation::Accuracy;
use rayon::prelude::*;
use std::sync::atomic::AtomicBool;

/// A model that was tried.
#[derive(Clone, Debug)]
pub struct Tried {
    /// The effects that the model has.
    pub effects: Vec<String>,
    /// The number of unknowns of the model.
    pub unknowns: usize,
    /// The mean square of its scaled residuals; none where the fit failed.
    pub cost: Option<f64>,
    /// For each output how well the model explains what it was fitted to.
    pub estimation_fit: Vec<OutputFit>,
    /// For each output how well the model explains what was held back.
    pub validation_fit: Vec<OutputFit>,
    /// What the model is compared by; the lowest is best.
    pub criterion: Option<f64>,
}

/// The outcome of a selection of effects.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Every model that was tried, the best first.
    pub tried: Vec<Tried>,
    /// The part of the data by which the models were compared.
    pub compared_on: Part,
}

/// An estimate with all that is said of it.
#[derive(Clone, Debug)]
pub struct Conclusion {
    /// The problem that it solves: without the effects that the data do not support.
    pub problem: Problem,
    /// What the run came to, at the estimate.
    pub report: Report,
    /// What is known of it.
    pub analysis: Analysis,
    /// How its effects were chosen, where the job left that open.
    pub selection: Option<Selection>,
}

/// Weighs the outputs anew and chooses the effects where that is asked for, and analyses the
/// estimate. Answers nothing when `stop` was raised, or the refits were cut.
#[must_use]
pub fn conclude(
    problem: &Problem,
    report: &Report,
    request: &Request,
    refits: &Refits,
    stop: &AtomicBool,
) -> Option<Conclusion> {
    let (problem, report) = if request.thorough {
        reweighting::reweighted(problem, report, (refits, stop))?
    } else {
        (problem.clone(), report.clone())
    };
    let (problem, report, selection) = if request.effects.is_empty() {
        (problem, report, None)
    } else {
        let (best, selection) = select(&problem, &report, &request.effects, (refits, stop))?;
        let report = Report {
            values: best.problem.values(&best.positions),
            positions: best.positions,
            cost: best.tried.cost,
            ..report
        };
        (best.problem, report, Some(selection))
    };
    let problem = validation_start::settled(&problem, &report.positions, stop)?;
    let analysis = analyse(&problem, &report, request, refits, stop)?;
    Some(Conclusion {
        problem,
        report,
        analysis,
        selection,
    })
}

/// A model with its fit.
#[derive(Clone, Debug)]
struct Fitted {
    problem: Problem,
    positions: Vec<f64>,
    tried: Tried,
}

impl Fitted {
    fn is_better_than(&self, other: &Fitted) -> bool {
        match (self.tried.criterion, other.tried.criterion) {
            (Some(own), Some(others)) => own < others,
            (own, others) => own.is_some() && others.is_none(),
        }
    }
}

fn select(
    problem: &Problem,
    report: &Report,
    effects: &[String],
    (refits, stop): (&Refits, &AtomicBool),
) -> Option<(Fitted, Selection)> {
    let has_validation = problem
        .experiments
        .iter()
        .any(|experiment| experiment.samples > experiment.estimation_samples);
    let mut bench = Bench {
        problem,
        start: &report.positions,
        effects,
        compared_on: if has_validation {
            Part::Validation
        } else {
            Part::Estimation
        },
        worst: f64::INFINITY,
        refits,
        stop,
    };
    let whole = bench.measure(problem.clone(), report.positions.clone(), report.cost)?;
    bench.worst = whole.tried.criterion.unwrap_or(f64::INFINITY) + HOPELESS;
    // A single effect is the whole model, which is fitted already.
    let alone = effects.iter().filter(|_| effects.len() > 1);
    let singles = alone.map(|effect| vec![effect.clone()]);
    let mut all = bench.fit_all(singles.chain([Vec::new()]).collect())?;
    let mut current = whole.clone();
    all.push(whole);
    loop {
        let kept = &current.tried.effects;
        let without = |left: &String| kept.iter().filter(|kept| *kept != left).cloned().collect();
        let known = |effects: &Vec<String>| all.iter().any(|fit| fit.tried.effects == *effects);
        let fresh: Vec<Vec<String>> = kept.iter().map(without).filter(|e| !known(e)).collect();
        let smaller = bench.fit_all(fresh)?;
        let best = smaller
            .iter()
            .fold(None::<&Fitted>, |best, fit| match best {
                Some(best) if !fit.is_better_than(best) => Some(best),
                _ => Some(fit),
            })
            .cloned();
        all.extend(smaller);
        match best {
            Some(best) if best.is_better_than(&current) => current = best,
            _ => break,
        }
    }
    all.sort_by(|a, b| {
        let worth = |fit: &Fitted| fit.tried.criterion.unwrap_or(f64::INFINITY);
        worth(a).total_cmp(&worth(b))
    });
    let best = all.first().cloned()?;
    let selection = Selection {
        tried: all.into_iter().map(|fit| fit.tried).collect(),
        compared_on: bench.compared_on,
    };
    Some((best, selection))
}

/// Between a coarse fit and a fine one the criterion changes by less than this: a model that is so
/// much worse after its coarse fit stays worse.
const HOPELESS: f64 = 100.0;

/// What all fits have in common.
struct Bench<'a> {
    problem: &'a Problem,
    /// The estimate with all effects.
    start: &'a [f64],
    effects: &'a [String],
    compared_on: Part,
    /// A model with a larger criterion is not fitted any more closely.
    worst: f64,
    refits: &'a Refits,
    stop: &'a AtomicBool,
}

impl Bench<'_> {
    /// Fits the models with each of these sets of effects. Where one is missing the others are fitted all
    /// the same.
    fn fit_all(&self, models: Vec<Vec<String>>) -> Option<Vec<Fitted>> {
        let fits: Vec<Option<Fitted>> =
            models.par_iter().map(|effects| self.fit(effects)).collect();
        fits.into_iter().collect()
    }

    fn fit(&self, effects: &[String]) -> Option<Fitted> {
        let is_left_out = |name: &String| self.effects.contains(name) && !effects.contains(name);
        let mut problem = self.problem.clone();
        problem.coordinates.retain(|own| !is_left_out(&own.name));
        let all = self.problem.coordinates.iter().zip(self.start);
        let kept = all.filter(|(own, _)| !is_left_out(&own.name));
        let start = kept.map(|(_, position)| *position).collect();
        let refit = |kind: &str, of: (&Problem, Vec<f64>), accuracy| {
            let name = format!("effects/{}/{kind}", effects.join(", "));
            self.refits.descend(name, || of, accuracy, self.stop)
        };
        let coarse = refit("coarse", (&problem, start), Accuracy::Screening)?;
        let fitted = self.measure(problem, coarse.positions, coarse.cost)?;
        if fitted.tried.criterion.is_none_or(|own| own > self.worst) {
            return Some(fitted);
        }
        let (problem, start) = (fitted.problem, fitted.positions);
        let fine = refit("fine", (&problem, start), Accuracy::Full)?;
        self.measure(problem, fine.positions, fine.cost)
    }

    fn measure(&self, problem: Problem, positions: Vec<f64>, cost: Option<f64>) -> Option<Fitted> {
        let problem = validation_start::settled(&problem, &positions, self.stop)?;
        let trajectories = trajectory::simulate(&problem, &positions, self.stop)?;
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
        let names = problem.coordinates.iter().map(|own| &own.name);
        let effects = names.filter(|name| self.effects.contains(name)).cloned();
        Some(Fitted {
            tried: Tried {
                effects: effects.collect(),
                unknowns: problem.coordinates.len(),
                cost,
                criterion: criteria.bic.filter(|_| trajectories.is_ok()),
                estimation_fit,
                validation_fit,
            },
            positions,
            problem,
        })
    }
}
