//! What the budget, changes within the record and the priors say against a result.

use super::{own_share, short};
use crate::estimation::problem::{Assumed, Coordinate, Problem, Target};
use crate::estimation::report::Report;
use crate::uncertainty::budget::{BETTER, Line};
use crate::uncertainty::drift::{Change, Drift};
use crate::uncertainty::verdict::{Trust, Verdict};
use crate::uncertainty::{Analysis, NORMAL_95};

/// Standard deviations of a prior beyond which the data contradict it.
const LARGEST_PRIOR_SHIFT: f64 = 3.0;
/// Standard deviations by which the data may go beyond a constraint by chance.
const LARGEST_CONTRADICTION: f64 = 3.0;
/// A total standard error beyond this share of the value is worth a word.
const LARGE_TOTAL: f64 = 0.1;
/// A contradicted assumption that would move a parameter by more than so many standard errors of
/// noise and this share of its value makes its trust low,
const GRAVE_MOVE: (f64, f64) = (3.0, 0.02);
/// or moderate.
const SLIGHT_MOVE: (f64, f64) = (1.0, 0.002);
/// Other explanations that are named.
const MOST_NAMED: usize = 4;

/// The residuals ask for one of the assumptions to be another; all that would explain as much are
/// one reason, because each of them hides the others.
pub(super) fn contradictions(
    verdict: &mut Verdict,
    problem: &Problem,
    report: &Report,
    analysis: &Analysis,
) {
    let mut lines: Vec<&Line> = analysis.budget.lines.iter().collect();
    lines.retain(|line| line.is_contradicted());
    lines.sort_by(|a, b| b.likelihood().total_cmp(&a.likelihood()));
    let Some(detail) = contradiction_in_words(&lines) else {
        return;
    };
    let moved = |index: usize| {
        let moves = lines.iter().filter_map(|line| line.suggested_move(index));
        moves.map(f64::abs).fold(0.0, f64::max)
    };
    let reason = ("assumption_contradicted", detail);
    lower_by_moves(verdict, (problem, report, analysis), moved, reason);
}

/// Lowers the trust in each coordinate by how far it would be moved, as a position, in standard
/// errors of noise and as a share of its value.
fn lower_by_moves(
    verdict: &mut Verdict,
    (problem, report, analysis): (&Problem, &Report, &Analysis),
    moved: impl Fn(usize) -> f64,
    reason: (&'static str, String),
) {
    let moves = |index: usize| -> Option<(f64, f64)> {
        let deviation = analysis.deviations.get(index).copied().flatten()?;
        let moved = moved(index);
        Some((moved / deviation, moved / own_share(problem, report, index)))
    };
    let trust = |index: usize| match moves(index) {
        Some((errors, share)) if errors > GRAVE_MOVE.0 && share > GRAVE_MOVE.1 => Trust::Low,
        Some((errors, share)) if errors > SLIGHT_MOVE.0 && share > SLIGHT_MOVE.1 => Trust::Moderate,
        Some(_) => Trust::High,
        None => Trust::Low,
    };
    let n = problem.coordinates.len();
    let concerned: Vec<(usize, Trust)> = (0..n)
        .map(|index| (index, trust(index)))
        .filter(|(_, trust)| *trust < Trust::High)
        .collect();
    let shares = concerned
        .iter()
        .filter_map(|(index, _)| Some(moves(*index)?.1));
    let at_stake = shares.fold(0.0, f64::max);
    verdict.lower_each(concerned, at_stake, reason);
}

/// The residuals ask for unknowns that change within the record: one reason, because a change of
/// one may look like that of another.
pub(super) fn drifts(
    verdict: &mut Verdict,
    problem: &Problem,
    report: &Report,
    analysis: &Analysis,
) {
    let Some((likeliest, others)) = analysis.drifts.split_first() else {
        return;
    };
    let moved = |index: usize| {
        let of_drift = |drift: &Drift| {
            let own = if drift.coordinate == index {
                0.5 * drift.size.0
            } else {
                0.0
            };
            drift.moves[index].unwrap_or_default().abs().max(own.abs())
        };
        analysis.drifts.iter().map(of_drift).fold(0.0, f64::max)
    };
    let name = |drift: &Drift| format!("`{}`", problem.coordinates[drift.coordinate].name);
    let named: Vec<String> = others.iter().take(MOST_NAMED).map(name).collect();
    let or = match named.is_empty() {
        true => String::new(),
        false => format!("; or it is {}", named.join(", ")),
    };
    let share = own_share(problem, report, likeliest.coordinate);
    let per_cent = |part: f64| short(100.0 * (part / share).abs());
    let word = if likeliest.size.0 < 0.0 {
        "smaller"
    } else {
        "larger"
    };
    let parts = match likeliest.change {
        Change::Halves => "in the second half of the record than in the first",
        Change::MiddleThird => "in the middle third of the record than in the others",
    };
    let detail = format!(
        "{} {word} by {} ± {} % {parts} would explain what is left ({:.0} standard deviations of \
         noise{or}): something changes within the record; estimate from a shorter window, or from \
         parts of it one by one",
        name(likeliest),
        per_cent(likeliest.size.0),
        per_cent(likeliest.size.1),
        likeliest.score.abs(),
    );
    lower_by_moves(
        verdict,
        (problem, report, analysis),
        moved,
        ("drift", detail),
    );
}

/// What the residuals ask for, the likeliest explanation first; none where there is none.
fn contradiction_in_words(lines: &[&Line]) -> Option<String> {
    let (likeliest, others) = lines.split_first()?;
    let (value, error) = likeliest.suggested?;
    let own = &likeliest.assumption;
    let names = others.iter().take(MOST_NAMED);
    let named: Vec<String> = names
        .map(|line| format!("`{}`", line.assumption.name))
        .collect();
    let or = match (named.join(", "), others.len().saturating_sub(MOST_NAMED)) {
        (_, _) if named.is_empty() => String::new(),
        (named, 0) => format!("; or it is {named}"),
        (named, more) => format!("; or it is {named} or one of {more} others in the budget"),
    };
    let words = if own.value == 0.0 {
        format!(
            "`{}` of {} ± {} {}",
            own.name,
            short(value),
            short(error),
            own.unit
        )
    } else {
        let word = if value.abs() < own.value.abs() {
            "smaller"
        } else {
            "larger"
        };
        let per_cent = |part: f64| short(100.0 * (part / own.value).abs());
        let by = (per_cent(value - own.value), per_cent(error));
        format!("`{}` {word} by {} ± {} %", own.name, by.0, by.1)
    };
    let advice = match own.target {
        Assumed::Model(_) => "free it with {\"estimate\": {}}, or measure it",
        Assumed::Sensor { .. } => "calibrate the sensor, or correct the recording for it",
        Assumed::Clock => "compare the clock with another, or correct the sample time for it",
    };
    Some(format!(
        "{words} would explain what is left ({:.0} standard deviations of noise{or}): {advice}",
        likeliest.score?.abs(),
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
        // A wide interval that holds is to be trusted, if it says anything.
        let trust = if is_wide { Trust::Low } else { Trust::High };
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

/// Constraints that keep the estimate from where the data would have it.
pub(super) fn constraints(verdict: &mut Verdict, problem: &Problem, analysis: &Analysis) {
    for binding in &analysis.bindings {
        let constraint = &problem.constraints[binding.constraint];
        let is_in_it = |own: &Coordinate| match own.target {
            Target::Parameter(parameter) | Target::ExperimentParameter { parameter, .. } => {
                constraint.parameters().contains(&parameter)
            }
            Target::InitialState { .. } => false,
        };
        let coordinates = problem.coordinates.iter().enumerate();
        let concerned = coordinates.filter(|(_, own)| is_in_it(own));
        let concerned: Vec<usize> = concerned.map(|(index, _)| index).collect();
        let (text, deviations) = (constraint.text(), binding.deviations);
        let (trust, code, advice) = if deviations > LARGEST_CONTRADICTION {
            let advice = "either it is wrong, or the model misses an effect";
            (Trust::Low, "constraint_contradicted", advice)
        } else {
            let advice = "noise alone can do that, and the intervals end there";
            (Trust::High, "constraint_binds", advice)
        };
        let detail = format!(
            "`{text}` holds with equality: the data would go beyond it by {deviations:.1} standard \
             deviations of noise; {advice}"
        );
        verdict.lower_some(trust, (concerned, 0.0), (code, detail));
    }
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
