//! The result document of a run.

use super::{posterior, process_noise};
use crate::estimation::problem::{Coordinate, Experiment, Problem, Target};
use crate::estimation::report::Report;
use crate::identification::JobSpec;
use crate::identification::next_steps::Finished;
use crate::identification::outcome::{
    ConfidenceInterval, Correlation, Criteria, Engine, Estimate, Fit, InitialStateEstimate,
    ModelSearchReport, Outcome, ParameterEstimate, ProfilePoint, Reason, SearchReport,
    TotalInterval, ValidationStart, Verdict,
};
use crate::identification::tried::Tries;
use crate::uncertainty::selection::Selection;
use crate::uncertainty::verdict::{Doubt, Grade};
use crate::uncertainty::{Analysis, Conclusion, CoordinateUncertainty, fit};
use greybox_numerics::statistics::finite;
use std::collections::BTreeMap;

/// What made a result, beside the method.
#[derive(Clone, Debug)]
pub struct Origin {
    /// The job, as clients name it.
    pub job: String,
    /// The specification of the job.
    pub spec: JobSpec,
    /// The digest of each recording.
    pub dataset_digests: Vec<String>,
}

/// The result document of an analysed run, with the next steps that were tried.
#[must_use]
pub fn outcome(origin: &Origin, conclusion: &Conclusion, tries: &Tries) -> Outcome {
    let Conclusion {
        problem,
        report,
        analysis,
        selection,
    } = conclusion;
    let (parameters, initial_states) = estimates(problem, report, analysis);
    Outcome {
        job: origin.job.clone(),
        model: problem.model.description().name.to_string(),
        stop_reason: report.stop_reason,
        verdict: verdict(&Finished {
            spec: &origin.spec,
            conclusion,
            tries,
        }),
        parameters,
        initial_states,
        validation_starts: validation_starts(problem),
        correlation: analysis.correlation.as_ref().map(|matrix| Correlation {
            names: problem
                .coordinates
                .iter()
                .map(|coordinate| coordinate.name.clone())
                .collect(),
            matrix: matrix
                .iter()
                .map(|row| row.iter().map(|v| finite(*v)).collect())
                .collect(),
            condition_number: analysis.condition.and_then(finite),
        }),
        flat_directions: analysis
            .flat
            .iter()
            .map(|flat| flat.words.clone())
            .collect(),
        budget: super::budget::of_result(problem, &report.positions, analysis),
        fit: Fit {
            estimation: problem.by_output(&analysis.estimation_fit),
            validation: problem.by_output(&analysis.validation_fit),
        },
        residuals: problem.by_output(&analysis.residuals),
        criteria: Criteria {
            cost: report.cost.and_then(finite),
            ..analysis.criteria.clone()
        },
        search: search(report),
        searches: report.searches.clone(),
        starts: report.starts.clone(),
        floor: report.floor.clone(),
        model_search: selection.as_ref().map(model_search),
        process_noise: analysis
            .noise
            .as_ref()
            .map(|noise| process_noise::report(problem, noise, analysis)),
        output_error: analysis.noise.as_ref().map_or_else(BTreeMap::new, |noise| {
            process_noise::output_error(problem, noise)
        }),
        posterior: analysis
            .posterior
            .as_ref()
            .and_then(|drawn| posterior::draws(problem, drawn)),
        engine: Engine {
            seed: origin.spec.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            spec_digest: origin.spec.digest(),
            dataset_digests: origin.dataset_digests.clone(),
        },
    }
}

fn verdict(finished: &Finished<'_>) -> Verdict {
    let Conclusion {
        problem, analysis, ..
    } = finished.conclusion;
    let judgement = &analysis.judgement;
    let name = |grade: &Grade| problem.coordinates[grade.coordinate].name.clone();
    let reason = |doubt: &Doubt| Reason {
        code: doubt.rule,
        detail: doubt.detail.clone(),
        concerns: doubt
            .concerns
            .as_ref()
            .map(|grades| grades.iter().map(name).collect()),
        next: finished.next_steps(doubt),
    };
    Verdict {
        trust: judgement.trust,
        summary: judgement.summary.clone(),
        reasons: judgement.doubts.iter().map(reason).collect(),
    }
}

/// Where experiments start that only validate.
fn validation_starts(problem: &Problem) -> Vec<ValidationStart> {
    let states = &problem.model.description().states;
    let of_experiment = |experiment: &Experiment| {
        let starts = experiment.unknown_starts.iter();
        let starts = starts.filter_map(|unknown| {
            Some(ValidationStart {
                experiment: experiment.place,
                state: states[unknown.state].name.to_string(),
                unit: states[unknown.state].unit.to_string(),
                value: experiment.initial_state[unknown.state]?,
                fitted_s: experiment.instant(experiment.scored_from),
            })
        });
        starts.collect::<Vec<_>>()
    };
    problem.experiments.iter().flat_map(of_experiment).collect()
}

fn estimates(
    problem: &Problem,
    report: &Report,
    analysis: &Analysis,
) -> (Vec<ParameterEstimate>, Vec<InitialStateEstimate>) {
    let mut parameters = Vec::new();
    let mut initial_states = Vec::new();
    for (index, coordinate) in problem.coordinates.iter().enumerate() {
        let uncertainty = &analysis.coordinates[index];
        let missing = analysis.missing.as_deref();
        let mut estimate = estimate(coordinate, report.values[index], uncertainty, missing);
        let drawn = analysis.posterior.as_ref();
        estimate.posterior = drawn.and_then(|drawn| posterior::report(drawn, index));
        let names = problem.outputs.iter().map(|output| output.name.clone());
        estimate.output_change = names
            .zip(uncertainty.output_changes.iter().copied())
            .collect();
        let unit = coordinate.unit.clone();
        match coordinate.target {
            Target::Parameter(_) | Target::ExperimentParameter { .. } => {
                parameters.push(ParameterEstimate {
                    name: coordinate.quantity.clone(),
                    experiment: coordinate.target.experiment(),
                    symbol: coordinate.symbol.clone(),
                    unit,
                    estimate,
                })
            }
            Target::InitialState { experiment, .. } => {
                initial_states.push(InitialStateEstimate {
                    experiment,
                    state: coordinate.quantity.clone(),
                    unit,
                    estimate,
                });
            }
        }
    }
    (parameters, initial_states)
}

fn estimate(
    coordinate: &Coordinate,
    value: f64,
    uncertainty: &CoordinateUncertainty,
    missing: Option<&str>,
) -> Estimate {
    let standard_error = uncertainty.standard_error.and_then(finite);
    let interval = uncertainty
        .interval
        .map(|(lower, upper)| ConfidenceInterval {
            level: 0.95,
            lower: lower.and_then(finite),
            upper: upper.and_then(finite),
            method: uncertainty.method.to_owned(),
        });
    let reason =
        |absent: bool| absent.then(|| missing.unwrap_or("the data do not fix it").to_owned());
    Estimate {
        estimate: value,
        standard_error_reason: reason(standard_error.is_none()),
        standard_error,
        confidence_interval_reason: reason(interval.is_none()),
        confidence_interval: interval,
        profile: uncertainty
            .profile
            .iter()
            .filter_map(profile_point)
            .collect(),
        total_standard_error: uncertainty.total_error.and_then(finite),
        total_interval: uncertainty
            .total_interval
            .map(|(lower, upper)| TotalInterval {
                level: 0.95,
                lower: lower.and_then(finite),
                upper: upper.and_then(finite),
            }),
        monte_carlo: uncertainty.monte_carlo,
        posterior: None,
        trust: Some(uncertainty.trust),
        prior_shift: uncertainty.prior_shift.and_then(finite),
        lower: coordinate.lower,
        upper: coordinate.upper,
        at_bound: uncertainty.at_bound,
        identifiable: uncertainty.identifiable,
        output_change: BTreeMap::new(),
    }
}

fn profile_point((value, excess): &(f64, f64)) -> Option<ProfilePoint> {
    Some(ProfilePoint {
        value: finite(*value)?,
        excess: finite(*excess)?,
    })
}

fn search(report: &Report) -> SearchReport {
    let failed = report.counters.failed_evaluations.iter();
    SearchReport {
        generations: report.generations,
        evaluations: report.counters.evaluations,
        distinct_evaluations: report.counters.distinct_evaluations,
        failed_evaluations: failed
            .map(|(failure, count)| (failure.name().to_owned(), *count))
            .collect(),
        best_credit: report.best_credit,
        best_generation: report.best_generation,
    }
}

fn model_search(selection: &Selection) -> ModelSearchReport {
    let best = selection.tried.first();
    ModelSearchReport {
        supported: best.map_or_else(Vec::new, |best| best.effects.clone()),
        compared_on: match selection.compared_on {
            fit::Part::Estimation => "estimation",
            fit::Part::Validation => "validation",
        }
        .to_owned(),
        tried: selection.tried.clone(),
    }
}
