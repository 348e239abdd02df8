//! The result document of a run.

use crate::estimation::problem::{Coordinate, Experiment, Problem, Target};
use crate::estimation::report::{self, Refinement, Report};
use crate::identification::outcome::{
    ConfidenceInterval, Correlation, Criteria, Engine, Estimate, Fit, FloorReport,
    InitialStateEstimate, InputCorrelation, ModelSearchReport, MonteCarlo, Outcome, OutputFit,
    ParameterEstimate, ProfilePoint, Reason, ResidualReport, SearchEnd, SearchReport, StartReport,
    TotalInterval, TriedModel, Trust, ValidationStart, Verdict,
};
use crate::uncertainty::selection::{Selection, Tried};
use crate::uncertainty::{Analysis, Conclusion, CoordinateUncertainty, fit, residuals, verdict};
use std::collections::BTreeMap;

/// What made a result, beside the method.
#[derive(Clone, Debug)]
pub struct Origin {
    /// The job, as clients name it.
    pub job: String,
    /// The seed.
    pub seed: u64,
    /// The digest of the completed specification.
    pub spec_digest: String,
    /// The digest of each recording.
    pub dataset_digests: Vec<String>,
}

/// The result document of an analysed run.
#[must_use]
pub fn outcome(origin: &Origin, conclusion: &Conclusion) -> Outcome {
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
        stop_reason: report.stop_reason.name().to_owned(),
        verdict: verdict_of(problem, &analysis.verdict),
        parameters,
        initial_states,
        validation_starts: validation_starts(problem),
        correlation: analysis.correlation.as_ref().map(|matrix| Correlation {
            names: problem
                .coordinates
                .iter()
                .map(|known| known.name.clone())
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
        budget: super::budget::lines(problem, &report.positions, &analysis.budget),
        fit: Fit {
            estimation: fits(problem, &analysis.estimation_fit),
            validation: fits(problem, &analysis.validation_fit),
        },
        residuals: residuals(problem, analysis),
        criteria: criteria(report, analysis),
        search: search(report),
        searches: report.searches.iter().map(search_end).collect(),
        starts: report.refinements.iter().map(start_of).collect(),
        floor: report.floor.as_ref().map(|floor| FloorReport {
            starts: floor.starts as u64,
            starts_at_floor: floor.at_floor as u64,
            searches_at_floor: floor.searches as u64,
            plateau: floor.is_plateau,
            twins: report
                .twins
                .iter()
                .map(|twin| twin.iter().cloned().collect())
                .collect(),
        }),
        model_search: selection
            .as_ref()
            .map(|selection| model_search(problem, selection)),
        engine: Engine {
            seed: origin.seed,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            spec_digest: origin.spec_digest.clone(),
            dataset_digests: origin.dataset_digests.clone(),
        },
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn trust_of(trust: verdict::Trust) -> Trust {
    match trust {
        verdict::Trust::Low => Trust::Low,
        verdict::Trust::Moderate => Trust::Moderate,
        verdict::Trust::High => Trust::High,
    }
}

fn verdict_of(problem: &Problem, verdict: &verdict::Verdict) -> Verdict {
    let name = |index: &usize| problem.coordinates[*index].name.clone();
    let reason = |reason: &verdict::Reason| Reason {
        code: reason.code.to_owned(),
        detail: reason.detail.clone(),
        concerns: reason
            .concerns
            .as_ref()
            .map(|concerned| concerned.iter().map(|(index, _)| name(index)).collect()),
    };
    Verdict {
        trust: trust_of(verdict.trust),
        summary: verdict.summary.clone(),
        reasons: verdict.reasons.iter().map(reason).collect(),
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
        let known = &analysis.coordinates[index];
        let missing = analysis.missing.as_deref();
        let mut estimate = estimate(coordinate, report.values[index], known, missing);
        let names = problem.outputs.iter().map(|output| output.name.clone());
        estimate.output_change = names.zip(known.output_changes.iter().copied()).collect();
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
    known: &CoordinateUncertainty,
    missing: Option<&str>,
) -> Estimate {
    let standard_error = known.standard_error.and_then(finite);
    let interval = known.interval.map(|(lower, upper)| ConfidenceInterval {
        level: 0.95,
        lower: lower.and_then(finite),
        upper: upper.and_then(finite),
        method: known.method.to_owned(),
    });
    let reason =
        |absent: bool| absent.then(|| missing.unwrap_or("the data do not fix it").to_owned());
    Estimate {
        estimate: value,
        standard_error_reason: reason(standard_error.is_none()),
        standard_error,
        confidence_interval_reason: reason(interval.is_none()),
        confidence_interval: interval,
        profile: known.profile.iter().filter_map(profile_point).collect(),
        total_standard_error: known.total_error.and_then(finite),
        total_interval: known.total_interval.map(|(lower, upper)| TotalInterval {
            level: 0.95,
            lower: lower.and_then(finite),
            upper: upper.and_then(finite),
        }),
        monte_carlo: known.monte_carlo.map(MonteCarlo::of),
        trust: Some(trust_of(known.trust)),
        prior_shift: known.prior_shift.and_then(finite),
        lower: coordinate.lower,
        upper: coordinate.upper,
        at_bound: known.at_bound,
        identifiable: known.identifiable,
        output_change: BTreeMap::new(),
    }
}

fn profile_point((value, excess): &(f64, f64)) -> Option<ProfilePoint> {
    Some(ProfilePoint {
        value: finite(*value)?,
        excess: finite(*excess)?,
    })
}

fn fits(problem: &Problem, fits: &[fit::OutputFit]) -> BTreeMap<String, OutputFit> {
    let entry = |fit: &fit::OutputFit| OutputFit {
        fit_percent: fit.fit_percent.and_then(finite),
        rmse: fit.rmse.and_then(finite),
        max_abs_error: fit.max_abs_error.and_then(finite),
        samples: fit.samples as u64,
        reason: match (fit.samples, fit.fit_percent) {
            (0, _) => Some("no samples are held in this part".to_owned()),
            (_, None) => Some("the measured signal does not vary".to_owned()),
            _ => None,
        },
    };
    let pairs = problem.outputs.iter().zip(fits);
    pairs
        .map(|(output, fit)| (output.name.clone(), entry(fit)))
        .collect()
}

fn residuals(problem: &Problem, analysis: &Analysis) -> BTreeMap<String, ResidualReport> {
    let pairs = problem.outputs.iter().zip(&analysis.residuals);
    pairs
        .map(|(output, report)| {
            let given = output
                .noise_std
                .is_some_and(|declared| declared >= report.noise_std);
            let entry = ResidualReport {
                noise_std: report.noise_std,
                noise_std_source: if given { "given" } else { "estimated" }.to_owned(),
                chi_square_per_sample: report.chi_square_per_sample.and_then(finite),
                lag_1_autocorrelation: report.lag_1_autocorrelation.and_then(finite),
                white: report.white,
                effective_samples: report.effective_samples.and_then(finite),
                outliers: report.outliers.map(|outliers| outliers as u64),
                inputs: report.inputs.iter().map(input_correlation).collect(),
            };
            (output.name.clone(), entry)
        })
        .collect()
}

fn input_correlation(found: &residuals::InputCorrelation) -> (String, InputCorrelation) {
    let shown = InputCorrelation {
        correlation: finite(found.correlation),
        lag: found.lag as u64,
        significant: found.significant,
    };
    (found.input.clone(), shown)
}

fn criteria(report: &Report, analysis: &Analysis) -> Criteria {
    let known = analysis.criteria;
    let cost = report.cost.and_then(finite);
    Criteria {
        cost,
        aic: known.map(|criteria| criteria.aic),
        aicc: known.map(|criteria| criteria.aicc),
        bic: known.map(|criteria| criteria.bic),
        fpe: known.and_then(|criteria| finite(criteria.fpe)),
        reason: known.is_none().then(|| {
            "too few samples, a simulation that fails or fits exactly, or Huber's loss".to_owned()
        }),
    }
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

fn search_end(end: &report::SearchEnd) -> SearchEnd {
    SearchEnd {
        stop_reason: end.stop_reason.name().to_owned(),
        generations: end.generations,
        cost: end.cost.and_then(finite),
    }
}

fn model_search(problem: &Problem, selection: &Selection) -> ModelSearchReport {
    let tried = |tried: &Tried| TriedModel {
        effects: tried.effects.clone(),
        unknowns: tried.unknowns as u64,
        cost: tried.cost.and_then(finite),
        bic: tried.criterion.and_then(finite),
        estimation: fits(problem, &tried.estimation_fit),
        validation: fits(problem, &tried.validation_fit),
    };
    let tried: Vec<TriedModel> = selection.tried.iter().map(tried).collect();
    ModelSearchReport {
        supported: tried
            .first()
            .map_or_else(Vec::new, |best| best.effects.clone()),
        compared_on: match selection.compared_on {
            fit::Part::Estimation => "estimation",
            fit::Part::Validation => "validation",
        }
        .to_owned(),
        tried,
    }
}

fn start_of(start: &Refinement) -> StartReport {
    StartReport {
        initial_cost: start.start_cost.and_then(finite),
        cost: start.coarse_cost.and_then(finite),
        parameters: start.values.iter().cloned().collect(),
        end: start.end.map(|end| end.name().to_owned()),
    }
}
