//! What the budget and the priors say against a result.

use super::{own_share, short};
use crate::estimation::problem::{Coordinate, Problem};
use crate::estimation::report::Report;
use crate::uncertainty::budget::{BETTER, Line};
use crate::uncertainty::verdict::{Trust, Verdict};
use crate::uncertainty::{Analysis, NORMAL_95};

/// Standard deviations of a prior beyond which the data contradict it.
const LARGEST_PRIOR_SHIFT: f64 = 3.0;
/// A total standard error beyond this share of the value is worth a word.
const LARGE_TOTAL: f64 = 0.1;
/// A contradicted assumption that moves a parameter by so many standard errors of noise makes its
/// trust moderate, or low.
const HARMFUL_MOVES: [f64; 2] = [1.0, 3.0];

/// The residuals ask for one of the assumptions to be another; all that would explain as much are
/// one reason, because each of them hides the others.
pub(super) fn contradictions(
    verdict: &mut Verdict,
    problem: &Problem,
    report: &Report,
    analysis: &Analysis,
) {
    let pull = |line: &Line| line.score.unwrap_or_default().abs();
    let mut lines: Vec<&Line> = analysis.budget.lines.iter().collect();
    lines.retain(|line| line.is_contradicted());
    lines.sort_by(|a, b| pull(b).total_cmp(&pull(a)));
    let Some(detail) = contradiction_in_words(&lines) else {
        return;
    };
    // How far any of the explanations would move each coordinate, in standard errors of noise and
    // as a share of its value.
    let moves = |index: usize| -> Option<(f64, f64)> {
        let deviation = analysis.deviations.get(index).copied().flatten()?;
        let moves = lines.iter().filter_map(|line| line.suggested_move(index));
        let moved = moves.map(f64::abs).fold(0.0, f64::max);
        Some((moved / deviation, moved / own_share(problem, report, index)))
    };
    let mut is_harmless = true;
    for (trust, least, most) in [
        (Trust::Low, HARMFUL_MOVES[1], f64::INFINITY),
        (Trust::Moderate, HARMFUL_MOVES[0], HARMFUL_MOVES[1]),
    ] {
        let is_within = |index: &usize| match moves(*index) {
            Some((moved, _)) => moved > least && moved <= most,
            None => trust == Trust::Low,
        };
        let concerned: Vec<usize> = (0..problem.coordinates.len()).filter(is_within).collect();
        if !concerned.is_empty() {
            let shares = concerned.iter().filter_map(|index| Some(moves(*index)?.1));
            let at_stake = shares.fold(0.0, f64::max);
            let reason = ("assumption_contradicted", detail.clone());
            verdict.lower_some(trust, (concerned, at_stake), reason);
            is_harmless = false;
        }
    }
    if is_harmless {
        // It moves nothing that is asked for, and is worth a word all the same.
        let reason = ("assumption_contradicted", detail);
        verdict.lower_some(Trust::High, (Vec::new(), 0.0), reason);
    }
}

/// What the residuals ask for, the strongest explanation first; none where there is none.
fn contradiction_in_words(lines: &[&Line]) -> Option<String> {
    let (strongest, others) = lines.split_first()?;
    let (value, error) = strongest.suggested?;
    let own = &strongest.assumption;
    let others: Vec<String> = others
        .iter()
        .map(|line| format!("`{}`", line.assumption.name))
        .collect();
    let or = match others[..] {
        [] => String::new(),
        _ => format!("; or it is {}", others.join(" or ")),
    };
    let words = if own.is_absent_effect {
        format!("`{}` of", own.name)
    } else {
        format!("`{}` not of {} but of", own.name, short(own.value))
    };
    Some(format!(
        "{words} {} ± {} {} would explain what is left ({:.0} standard deviations of noise{or}): \
         free it with {{\"estimate\": {{}}}}, or measure it",
        short(value),
        short(error),
        own.unit,
        strongest.score?.abs(),
    ))
}

pub(super) fn left_out(verdict: &mut Verdict, analysis: &Analysis) {
    if analysis.budget.is_left_out {
        let detail = "what is taken as known was not looked at: the run was stopped, or the \
                      recording is too long; estimate from a window of it for a budget";
        verdict.lower(Trust::Moderate, "no_budget", detail.to_owned());
    }
}

/// Where what is assumed leaves more open than the data.
pub(super) fn dominance(
    verdict: &mut Verdict,
    problem: &Problem,
    report: &Report,
    analysis: &Analysis,
) {
    let described = problem.coordinates.iter().zip(&analysis.budget.totals);
    for (index, (coordinate, total)) in described.enumerate() {
        let noise = analysis.deviations.get(index).copied().flatten();
        let (Some(total), Some(noise)) = (*total, noise) else {
            continue;
        };
        let share = total / own_share(problem, report, index);
        let is_wide = 2.0 * NORMAL_95 * total >= 1.0;
        let is_assumed = total > std::f64::consts::SQRT_2 * noise;
        if !is_assumed || !(is_wide || share > LARGE_TOTAL) {
            continue;
        }
        let trust = if is_wide { Trust::Low } else { Trust::Moderate };
        let reason = dominance_in_words((index, coordinate), (share, total), analysis);
        verdict.lower_some(
            trust,
            (vec![index], share),
            ("assumptions_dominate", reason),
        );
    }
}

fn dominance_in_words(
    (index, coordinate): (usize, &Coordinate),
    (share, total): (f64, f64),
    analysis: &Analysis,
) -> String {
    let better = |line: &&Line| line.contributions[index].map(|own| own.total_if_better);
    let lines = analysis.budget.lines.iter();
    let best = lines.filter(|line| better(line).is_some()).min_by(|a, b| {
        better(a)
            .unwrap_or(total)
            .total_cmp(&better(b).unwrap_or(total))
    });
    let known = format!(
        "with all that is assumed `{}` is known to ± {:.2} % (one standard error)",
        coordinate.name,
        100.0 * share
    );
    let Some((line, then)) = best.and_then(|line| Some((line, better(&line)?))) else {
        return known;
    };
    let own = &line.assumption;
    format!(
        "{known}: know `{}` to {} {} instead of {}, and it falls to ± {:.2} %",
        own.name,
        short(own.tolerance / BETTER),
        own.unit,
        short(own.tolerance),
        100.0 * share * then / total
    )
}

pub(super) fn priors(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    let pairs = problem.coordinates.iter().zip(&analysis.coordinates);
    for (index, (coordinate, known)) in pairs.enumerate() {
        let shift = known
            .prior_shift
            .filter(|shift| shift.abs() > LARGEST_PRIOR_SHIFT);
        if let Some(shift) = shift {
            let detail = format!(
                "the data move `{}` by {:.1} standard deviations of what was known of it before: \
                 one of the two is wrong; check the prior, or look for an effect that the model \
                 leaves out",
                coordinate.name,
                shift.abs()
            );
            let reason = ("prior_contradicted", detail);
            verdict.lower_some(Trust::Moderate, (vec![index], 0.0), reason);
        }
    }
}
