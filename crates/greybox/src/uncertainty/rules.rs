//! The rules of the verdict; what each of them is for stands in [`super::verdict`].

mod assumptions;

use super::Analysis;
use super::verdict::{Trust, Verdict};
use crate::estimation::problem::{Coordinate, Problem, Target};
use crate::estimation::report::Report;
use crate::estimation::stop_reason::StopReason;
use std::collections::BTreeSet;

/// chi²/n above which the model is wrong.
const MISFIT: f64 = 1.5;
/// chi²/n above which something is left over.
const SLIGHT_MISFIT: f64 = 1.15;
/// A correlation of residuals with the next beyond which, where no noise is declared, they are
/// what the model misses rather than noise.
const MISFIT_CORRELATION: f64 = 0.3;
/// A correlation of simulated and measured below which they go opposite ways.
const OPPOSITE: f64 = -0.5;
/// Correlation beyond which two unknowns are hardly told apart,
const LARGEST_CORRELATION: f64 = 0.95;
/// which does no harm where both are known to this share of their values all the same.
const KNOWN_WELL: f64 = 0.02;
/// RMSE on the data held back against that on the data estimated from, and where that is grave.
const VALIDATION_RATIOS: [f64; 2] = [1.3, 2.0];
/// A fit below which a noise level would have to be declared to tell noise from misfit [%].
const PLAIN_FIT: f64 = 90.0;
/// A parameter has another value in another minimum where it lies this share of its range off.
const ELSEWHERE: f64 = 0.02;

/// Judges an analysed estimate.
#[must_use]
pub(super) fn judge(problem: &Problem, report: &Report, analysis: &Analysis) -> Verdict {
    let mut verdict = Verdict::default();
    check(&mut verdict, problem, report, analysis);
    verdict.settle(problem);
    verdict
}

/// Applies every rule.
fn check(verdict: &mut Verdict, problem: &Problem, report: &Report, analysis: &Analysis) {
    completion(verdict, report);
    bounds(verdict, problem, analysis);
    identifiability(verdict, problem, analysis);
    noise(verdict, problem, analysis);
    colour(verdict, problem, analysis);
    inputs(verdict, problem, analysis);
    assumptions::contradictions(verdict, problem, report, analysis);
    assumptions::drifts(verdict, problem, report, analysis);
    assumptions::left_out(verdict, analysis);
    assumptions::dominance(verdict, problem, report, analysis);
    assumptions::priors(verdict, problem, analysis);
    assumptions::constraints(verdict, problem, analysis);
    correlation(verdict, problem, report, analysis);
    validation(verdict, problem, analysis);
    starts(verdict, report);
    minima(verdict, problem, report, analysis);
}

fn completion(verdict: &mut Verdict, report: &Report) {
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

fn bounds(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    let pairs = problem.coordinates.iter().zip(&analysis.coordinates);
    for (coordinate, _) in pairs.filter(|(_, known)| known.at_bound) {
        let trust = match coordinate.target {
            Target::Parameter(_) | Target::ExperimentParameter { .. } => Trust::Low,
            Target::InitialState { .. } => Trust::Moderate,
        };
        let detail = format!(
            "`{}` stands at an end of its search range {} to {} {}; widen the range, or look \
             for an effect that the model leaves out",
            coordinate.name, coordinate.lower, coordinate.upper, coordinate.unit
        );
        verdict.lower(trust, "at_bound", detail);
    }
}

/// One flat direction is one reason.
fn identifiability(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    for flat in &analysis.flat {
        let reason = ("not_identifiable", flat.words.clone());
        if analysis.missing.is_some() {
            // Without a covariance nothing is promised of the others either.
            verdict.lower(Trust::Low, reason.0, reason.1);
        } else {
            let concerned = flat.parts.iter().map(|(index, _)| *index).collect();
            verdict.lower_some(Trust::Low, (concerned, 1.0), reason);
        }
    }
    let described = problem.coordinates.iter().zip(&analysis.coordinates);
    for (index, (coordinate, known)) in described.enumerate() {
        let is_wide = known.standard_error.is_some() && !known.identifiable;
        if is_wide && !is_flat(analysis, index) {
            let detail = format!(
                "the 95 % interval of `{}` is wider than its search range: the data do not fix \
                 it; give its value, or record an experiment that excites it",
                coordinate.name
            );
            verdict.lower_some(Trust::Low, (vec![index], 1.0), ("not_identifiable", detail));
        }
    }
    if let (Some(missing), true) = (&analysis.missing, analysis.flat.is_empty()) {
        let detail = format!("there are no standard errors: {missing}; fix an unknown");
        verdict.lower(Trust::Low, "not_identifiable", detail);
    }
}

fn is_flat(analysis: &Analysis, index: usize) -> bool {
    let mut parts = analysis.flat.iter().flat_map(|flat| &flat.parts);
    parts.any(|(own, _)| *own == index)
}

fn noise(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    let residuals = analysis.residuals.iter().zip(&analysis.estimation_fit);
    for (output, (residual, fit)) in problem.outputs.iter().zip(residuals) {
        let name = &output.name;
        if let Some(rho) = fit.correlation.filter(|rho| *rho < OPPOSITE) {
            let detail = format!(
                "`{name}` is simulated against what was measured (correlation {rho:.2}): a sign \
                 is wrong, of the signal in the recording or of a gain in the model"
            );
            verdict.lower(Trust::Low, "opposite_sign", detail);
        }
        let next = residual.lag_1_autocorrelation.unwrap_or_default();
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
            None if residual.white == Some(false) && next.abs() > MISFIT_CORRELATION => {
                let detail = format!(
                    "no noise level of `{name}` is declared and what is left is no white noise \
                     (correlation {next:.2} with the next sample): it is taken for what the model \
                     misses; free an effect, or give outputs.{name}.noise_std"
                );
                verdict.lower(Trust::Low, "misfit", detail);
            }
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

fn colour(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
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

fn inputs(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
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

/// The coordinate's own value as a share of its range: what a move is measured by.
fn own_share(problem: &Problem, report: &Report, index: usize) -> f64 {
    let coordinate = &problem.coordinates[index];
    let slope = coordinate.slope(report.positions[index]).abs();
    (report.values[index].abs() / slope).max(f64::MIN_POSITIVE)
}

fn correlation(verdict: &mut Verdict, problem: &Problem, report: &Report, analysis: &Analysis) {
    let Some(correlation) = &analysis.correlation else {
        return;
    };
    let is_known_well = |index: usize| {
        let deviation = analysis.deviations.get(index).copied().flatten();
        deviation.is_some_and(|own| own / own_share(problem, report, index) < KNOWN_WELL)
    };
    for (row, entries) in correlation.iter().enumerate() {
        for (column, value) in entries.iter().enumerate().take(row) {
            let pair = [column, row];
            let is_said = pair.iter().all(|index| is_flat(analysis, *index));
            let is_harmless = pair.iter().all(|index| is_known_well(*index));
            if value.abs() <= LARGEST_CORRELATION || is_said || is_harmless {
                continue;
            }
            let [a, b] = pair.map(|index| &problem.coordinates[index].name);
            let detail = format!(
                "`{a}` and `{b}` move together (correlation {value:.3}): the data fix a \
                 combination better than either; fix one of them from a data sheet"
            );
            let reason = ("correlated", detail);
            verdict.lower_some(Trust::Moderate, (pair.to_vec(), 0.0), reason);
        }
    }
}

fn validation(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    let parts = analysis.estimation_fit.iter().zip(&analysis.validation_fit);
    let [slight, grave] = VALIDATION_RATIOS;
    for (output, (estimation, validation)) in problem.outputs.iter().zip(parts) {
        let (Some(inside), Some(outside)) = (estimation.rmse, validation.rmse) else {
            continue;
        };
        let ratio = outside / inside;
        let percent = validation.fit_percent.filter(|percent| *percent < 0.0);
        if ratio <= slight {
            continue;
        }
        let (trust, than_a_mean) = match percent {
            Some(_) => (Trust::Low, ", and a constant would explain them better"),
            None if ratio > grave => (Trust::Low, ""),
            None => (Trust::Moderate, ""),
        };
        let detail = format!(
            "the RMSE of `{}` is {ratio:.2} times as large on the data held back{than_a_mean}: the \
             estimate does not carry over; use a longer or richer recording",
            output.name,
        );
        verdict.lower(trust, "worse_on_validation", detail);
    }
}

fn starts(verdict: &mut Verdict, report: &Report) {
    let Some(floor) = &report.floor else {
        return;
    };
    if floor.is_plateau {
        let detail = "a constant explains the data as well as the estimate does: nothing was \
                      found that follows them; look at the search ranges and the initial states, \
                      or search longer with a larger `population`";
        verdict.lower(Trust::Low, "plateau", detail.to_owned());
    } else if floor.starts > 1 && floor.at_floor <= 1 {
        let reached = match floor.at_floor {
            0 => "none",
            _ => "only one",
        };
        let detail = format!(
            "{reached} of {} starts of the refinement, in {} searches, reached the lowest cost: \
             there may be better minima; ask for more `further_searches`, or a larger `population`",
            floor.starts,
            report.searches.len().max(1)
        );
        verdict.lower(Trust::Moderate, "starts_disagree", detail);
    }
}

/// Other minima as low, by what noise allows. What differs only in what the data do not fix is a
/// point of the same valley, which has its own reason.
fn minima(verdict: &mut Verdict, problem: &Problem, report: &Report, analysis: &Analysis) {
    let is_fixed =
        |index: &usize| !is_flat(analysis, *index) && analysis.coordinates[*index].identifiable;
    let elsewhere = |twin: &[(String, f64)]| -> Vec<usize> {
        let pairs = problem.coordinates.iter().zip(twin).enumerate();
        let elsewhere = pairs.filter(|(index, (coordinate, (_, value)))| {
            let Coordinate { lower, upper, .. } = **coordinate;
            let position = coordinate.scale.position(*value, lower, upper);
            (position - report.positions[*index]).abs() > ELSEWHERE
        });
        elsewhere.map(|(index, _)| index).collect()
    };
    let twins = report.twins.iter().map(|twin| (twin, elsewhere(twin)));
    let twins = twins.filter(|(_, concerned)| concerned.iter().any(is_fixed));
    let twins: Vec<_> = twins.collect();
    let Some((first, _)) = twins.first() else {
        return;
    };
    let values: Vec<String> = first
        .iter()
        .map(|(name, value)| format!("{name} {}", short(*value)))
        .collect();
    let values = values.join(", ");
    let others = match twins.len() {
        1 => format!("another minimum explains the data as well ({values}): two answers"),
        n => format!("{n} other minima explain the data as well (one at {values})"),
    };
    let detail = format!("{others}; say in the search ranges or with a prior which one is meant");
    let concerned: BTreeSet<usize> = twins.iter().flat_map(|(_, own)| own).copied().collect();
    let concerned = concerned.into_iter().collect();
    verdict.lower_some(Trust::Low, (concerned, 1.0), ("twin_minima", detail));
}

/// A number with three significant digits.
fn short(value: f64) -> String {
    let magnitude = value.abs();
    if value == 0.0 || (1e-3..1e5).contains(&magnitude) {
        let digits = (2.0 - magnitude.max(f64::MIN_POSITIVE).log10().floor()).clamp(0.0, 6.0);
        let text = format!("{value:.*}", digits as usize);
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        return text;
    }
    format!("{value:.2e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_reasons_have_three_digits() {
        let shown = [0.0, 31.04, 0.00123, 7e6, 8.91e-8, 123.4, -0.5];
        let expected = ["0", "31", "0.00123", "7.00e6", "8.91e-8", "123", "-0.5"];
        assert_eq!(shown.map(short), expected);
    }
}
