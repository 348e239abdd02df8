//! Whether the numbers can be trusted, in words.
//!
//! Every rule stands here. A rule that finds something lowers the trust to its level and says
//! what it saw and what to do next; an estimate that no rule speaks against has high trust.
//!
//! | rule | trust | when |
//! |---|---|---|
//! | `at_bound` | low, for an initial state moderate | it stands at an end of its search range |
//! | `not_identifiable` | the same | its interval is wider than its search range, or is none |
//! | `misfit` | low | chi²/n above 1.5: residuals far larger than the declared noise |
//! | `not_finished` | low | the run was ended before its refinement |
//! | `slight_misfit` | moderate | chi²/n between 1.15 and 1.5 |
//! | `residuals_not_white` | moderate | residuals with a memory: the model misses dynamics |
//! | `residuals_follow_input` | moderate | residuals correlated with what an input was |
//! | `correlated` | moderate | two unknowns with a correlation beyond 0.95 |
//! | `worse_on_validation` | moderate | RMSE on the data held back 1.3 times that estimated from |
//! | `noise_unknown` | moderate | no noise level is declared and the fit is below 90 % |
//! | `twin_minima` | low | other parameters cost as little |
//! | `plateau` | low | a constant explains as much |
//! | `starts_disagree` | moderate | no second start of the refinement came to the lowest cost |

use super::Analysis;
use crate::estimation::problem::{Problem, Target};
use crate::estimation::report::Report;
use crate::estimation::stop_reason::StopReason;

/// How far the numbers can be trusted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Trust {
    /// Do not use them.
    Low,
    /// Use them with care.
    Moderate,
    /// Nothing speaks against them.
    #[default]
    High,
}

/// One reason against full trust.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reason {
    /// A stable word for programs.
    pub code: &'static str,
    /// What was seen, and what to do next.
    pub detail: String,
}

/// The verdict with its reasons.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Verdict {
    /// How far the numbers can be trusted.
    pub trust: Trust,
    /// Why not further, the gravest first.
    pub reasons: Vec<Reason>,
}

/// chi²/n above which the model is wrong.
const MISFIT: f64 = 1.5;
/// chi²/n above which something is left over.
const SLIGHT_MISFIT: f64 = 1.15;
/// Correlation beyond which two unknowns are hardly told apart.
const LARGEST_CORRELATION: f64 = 0.95;
/// RMSE on the data held back against that on the data estimated from.
const LARGEST_VALIDATION_RATIO: f64 = 1.3;
/// A fit below which a noise level would have to be declared to tell noise from misfit [%].
const PLAIN_FIT: f64 = 90.0;

impl Verdict {
    /// Low trust for one reason.
    #[must_use]
    pub fn low(code: &'static str, detail: String) -> Verdict {
        Verdict {
            trust: Trust::Low,
            reasons: vec![Reason { code, detail }],
        }
    }

    fn lower(&mut self, trust: Trust, code: &'static str, detail: String) {
        self.trust = self.trust.min(trust);
        self.reasons.push(Reason { code, detail });
    }
}

/// Judges an analysed estimate.
#[must_use]
pub fn of(problem: &Problem, report: &Report, analysis: &Analysis) -> Verdict {
    let mut verdict = Verdict::default();
    check_completion(&mut verdict, report);
    check_coordinates(&mut verdict, problem, analysis);
    check_noise(&mut verdict, problem, analysis);
    check_colour(&mut verdict, problem, analysis);
    check_inputs(&mut verdict, problem, analysis);
    check_correlation(&mut verdict, problem, analysis);
    check_validation(&mut verdict, problem, analysis);
    check_starts(&mut verdict, report);
    verdict
}

fn check_completion(verdict: &mut Verdict, report: &Report) {
    let reason = match report.stop_reason {
        StopReason::Cancelled => "cancelled",
        StopReason::Paused => "paused",
        StopReason::TimeLimit => "ended by its time limit",
        _ => return,
    };
    let detail = format!(
        "the run was {reason} after {} generations, before its refinement had finished; let it \
         run to its end",
        report.generations
    );
    verdict.lower(Trust::Low, "not_finished", detail);
}

fn check_coordinates(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    for (coordinate, known) in problem.coordinates.iter().zip(&analysis.coordinates) {
        // Where the record starts is not what the job is for.
        let trust = match coordinate.target {
            Target::Parameter(_) | Target::ExperimentParameter { .. } => Trust::Low,
            Target::InitialState { .. } => Trust::Moderate,
        };
        if known.at_bound {
            let detail = format!(
                "`{}` stands at an end of its search range {} to {} {}; widen the range, or look \
                 for an effect that the model leaves out",
                coordinate.name, coordinate.lower, coordinate.upper, coordinate.unit
            );
            verdict.lower(trust, "at_bound", detail);
        }
        if known.standard_error.is_some() && !known.identifiable {
            let detail = format!(
                "the 95 % interval of `{}` is wider than its search range: the data do not fix \
                 it; give its value, or record an experiment that excites it",
                coordinate.name
            );
            verdict.lower(trust, "not_identifiable", detail);
        }
    }
    for flat in &analysis.flat {
        verdict.lower(Trust::Low, "not_identifiable", flat.words.clone());
    }
    if let Some(missing) = analysis
        .missing
        .as_ref()
        .filter(|_| analysis.flat.is_empty())
    {
        let detail = format!("there are no standard errors: {missing}; fix an unknown");
        verdict.lower(Trust::Low, "not_identifiable", detail);
    }
}

fn check_noise(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    let outputs = problem
        .outputs
        .iter()
        .zip(&analysis.residuals)
        .zip(&analysis.estimation_fit);
    for ((output, residual), fit) in outputs {
        let name = &output.name;
        match residual.chi_square_per_sample {
            Some(chi_square) if chi_square > MISFIT => {
                let detail = format!(
                    "the residuals of `{name}` are {:.2} times the declared noise (chi²/n \
                     {chi_square:.2}): the model misses an effect, and the parameters pay for it; \
                     free an effect such as friction, dead band, offset or gain",
                    chi_square.sqrt()
                );
                verdict.lower(Trust::Low, "misfit", detail);
            }
            Some(chi_square) if chi_square > SLIGHT_MISFIT => {
                let detail = format!(
                    "the residuals of `{name}` are somewhat larger than the declared noise \
                     (chi²/n {chi_square:.2}); check the noise level and try a richer model"
                );
                verdict.lower(Trust::Moderate, "slight_misfit", detail);
            }
            Some(_) => {}
            None if fit.fit_percent.is_some_and(|percent| percent < PLAIN_FIT) => {
                let detail = format!(
                    "`{name}` is explained to {:.1} % and no noise level is declared, so noise \
                     cannot be told from misfit; give outputs.{name}.noise_std",
                    fit.fit_percent.unwrap_or_default()
                );
                verdict.lower(Trust::Moderate, "noise_unknown", detail);
            }
            None => {}
        }
    }
}

fn check_colour(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    for (output, residual) in problem.outputs.iter().zip(&analysis.residuals) {
        if residual.white == Some(false) {
            let detail = format!(
                "the residuals of `{}` are not white (correlation {:.2} with the next sample): \
                 the model misses dynamics; the intervals are widened for it",
                output.name,
                residual.lag_1_autocorrelation.unwrap_or_default()
            );
            verdict.lower(Trust::Moderate, "residuals_not_white", detail);
        }
    }
}

fn check_inputs(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    for (output, residual) in problem.outputs.iter().zip(&analysis.residuals) {
        for found in residual.inputs.iter().filter(|found| found.significant) {
            let detail = format!(
                "the residuals of `{}` follow the input `{}` (correlation {:.2} with what it was \
                 {} samples before): the model misses a part of its effect, such as a gain, an \
                 offset or a delay",
                output.name, found.input, found.correlation, found.lag
            );
            verdict.lower(Trust::Moderate, "residuals_follow_input", detail);
        }
    }
}

fn check_correlation(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    let Some(correlation) = &analysis.correlation else {
        return;
    };
    for (row, entries) in correlation.iter().enumerate() {
        for (column, value) in entries.iter().enumerate().take(row) {
            if value.abs() > LARGEST_CORRELATION {
                let (a, b) = (
                    &problem.coordinates[column].name,
                    &problem.coordinates[row].name,
                );
                let detail = format!(
                    "`{a}` and `{b}` move together (correlation {value:.3}): the data fix a \
                     combination better than either; fix one of them from a data sheet"
                );
                verdict.lower(Trust::Moderate, "correlated", detail);
            }
        }
    }
}

fn check_validation(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    let parts = analysis.estimation_fit.iter().zip(&analysis.validation_fit);
    for (output, (estimation, validation)) in problem.outputs.iter().zip(parts) {
        let (Some(inside), Some(outside)) = (estimation.rmse, validation.rmse) else {
            continue;
        };
        if outside > LARGEST_VALIDATION_RATIO * inside {
            let detail = format!(
                "the RMSE of `{}` is {:.2} times as large on the data held back: the estimate \
                 does not carry over; use a longer or richer recording",
                output.name,
                outside / inside
            );
            verdict.lower(Trust::Moderate, "worse_on_validation", detail);
        }
    }
}

fn check_starts(verdict: &mut Verdict, report: &Report) {
    for twin in &report.twins {
        let values: Vec<String> = twin
            .iter()
            .map(|(name, value)| format!("{name} {value:.4e}"))
            .collect();
        let detail = format!(
            "another minimum explains the data as well: {}; the data do not say which of the two \
             is true: narrow the search range of a parameter in which they differ to the side \
             that is possible, or fix it",
            values.join(", ")
        );
        verdict.lower(Trust::Low, "twin_minima", detail);
    }
    let Some(floor) = &report.floor else {
        return;
    };
    if floor.is_plateau {
        let detail = "a constant explains the data as well as the estimate does: nothing was \
                      found that follows them; look at the search ranges and the initial states, \
                      or search longer with a larger `population`";
        verdict.lower(Trust::Low, "plateau", detail.to_owned());
    } else if floor.starts > 1 && floor.at_floor == 1 {
        let detail = format!(
            "only one of {} starts of the refinement, in {} searches, reached the lowest cost: \
             there may be better minima; ask for more `further_searches`, or a larger `population`",
            floor.starts,
            report.searches.len().max(1)
        );
        verdict.lower(Trust::Moderate, "starts_disagree", detail);
    }
}
