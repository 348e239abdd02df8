//! The budget of the method as that of the result document.

use crate::estimation::problem::{Assumed, Problem};
use crate::identification::budget::{AssumptionKind, BudgetContribution, BudgetLine, Suggested};
use crate::uncertainty::Analysis;
use crate::uncertainty::budget::{Budget, Line};

/// The lines of the budget of a result. Where a total standard error covers more than the budget, such as other noise
/// models, each share is that of the whole.
pub(super) fn of_result(
    problem: &Problem,
    positions: &[f64],
    analysis: &Analysis,
) -> Vec<BudgetLine> {
    let mut budget = lines(problem, positions, &analysis.budget);
    let coordinates = problem.coordinates.iter().zip(&analysis.coordinates);
    let totals = analysis.budget.totals.iter().zip(positions);
    for ((coordinate, described), (total, position)) in coordinates.zip(totals) {
        let (Some(total), Some(reported)) = (*total, described.total_error) else {
            continue;
        };
        let covered = (total * coordinate.slope(*position).abs() / reported).powi(2);
        let contributions = budget
            .iter_mut()
            .filter_map(|line| line.contributions.get_mut(&coordinate.name));
        contributions.for_each(|contribution| contribution.share *= covered);
    }
    budget
}

/// The lines of a budget at some positions of a problem.
pub(super) fn lines(problem: &Problem, positions: &[f64], budget: &Budget) -> Vec<BudgetLine> {
    let line = |line: &Line| {
        let assumption = &line.assumption;
        let pairs = problem.coordinates.iter().zip(positions);
        let contributions = pairs.zip(&line.contributions);
        let contributions = contributions.filter_map(|((coordinate, position), positional)| {
            let (positional, slope) = ((*positional)?, coordinate.slope(*position).abs());
            let contribution = BudgetContribution {
                standard_error: positional.deviation * slope,
                share: positional.share,
                total_if_better: positional.total_if_better * slope,
            };
            let numbers = [
                contribution.standard_error,
                contribution.share,
                contribution.total_if_better,
            ];
            let is_finite = numbers.iter().all(|number| number.is_finite());
            is_finite.then(|| (coordinate.name.clone(), contribution))
        });
        BudgetLine {
            assumption: assumption.name.clone(),
            kind: match assumption.target {
                Assumed::Sensor { .. } => AssumptionKind::Sensor,
                Assumed::Clock => AssumptionKind::Clock,
                Assumed::Input(_) => AssumptionKind::Input,
                Assumed::Probe(_) => AssumptionKind::AbsentEffect,
                Assumed::Model(_) if assumption.is_absent_effect => AssumptionKind::AbsentEffect,
                Assumed::Model(_) => AssumptionKind::Tolerance,
            },
            value: assumption.value,
            taken: Some(assumption.taken).filter(|taken| *taken != assumption.value),
            tolerance: assumption.tolerance,
            by_default: assumption.is_default,
            unit: assumption.unit.clone(),
            score: line.score.filter(|score| score.is_finite()),
            suggested: suggested(line.suggested),
            posterior: suggested(line.posterior),
            unnoticed_up_to: line.unnoticed.filter(|size| size.is_finite()),
            contributions: contributions.collect(),
        }
    };
    budget.lines.iter().map(line).collect()
}

/// A value with its standard error; none where one of the two is no number.
fn suggested(value: Option<(f64, f64)>) -> Option<Suggested> {
    let (value, standard_error) = value?;
    let is_finite = value.is_finite() && standard_error.is_finite();
    is_finite.then_some(Suggested {
        value,
        standard_error,
    })
}
