//! What the budget, changes within the record, the priors and the constraints say against a result.

use super::{Case, short};
use crate::estimation::problem::{Assumed, Coordinate, Target};
use crate::uncertainty::budget::{Line, SLIGHT_SHARE};
use crate::uncertainty::drift::{Change, Drift};
use crate::uncertainty::joint::LARGEST_SHIFT;
use crate::uncertainty::verdict::{Doubt, Grade, Rule, Subject, Trust};

/// Standard deviations by which the data may go beyond a constraint by chance.
const LARGEST_CONTRADICTION: f64 = 3.0;
/// A contradicted assumption that would move a parameter further makes the trust in the parameter low.
const GRAVE_MOVE: Move = Move {
    errors: 3.0,
    share: 0.02,
};
/// A contradicted assumption that would move a parameter further makes the trust in the parameter
/// moderate.
const SLIGHT_MOVE: Move = Move {
    errors: 1.0,
    share: 0.002,
};
/// What speaks against the estimate under a noise model is within the total intervals: where the move of a
/// parameter is further, the linear extrapolation says little and the trust is low.
const GRAVE_COVERED_MOVE: Move = Move {
    errors: 3.0,
    share: 0.25,
};
/// Other explanations that are named.
const MOST_NAMED: usize = 4;

/// How far a parameter would move.
#[derive(Clone, Copy)]
struct Move {
    /// The move in standard errors of noise.
    errors: f64,
    /// The move as a share of the value.
    share: f64,
}

impl Move {
    fn is_beyond(self, limit: Move) -> bool {
        self.errors > limit.errors && self.share > limit.share
    }
}

/// How far coordinates would move, as positions.
pub(super) struct Moves<'a> {
    /// By anything that speaks against the estimate.
    pub any: &'a dyn Fn(usize) -> f64,
    /// By what is large enough to give another answer.
    pub large: &'a dyn Fn(usize) -> f64,
}

impl Case<'_> {
    /// The residuals ask for one of the assumptions to be another; all that would explain as much
    /// are one reason, because each of them hides the others.
    pub(super) fn contradictions(&self) -> Option<Doubt> {
        let lines = self.analysis.budget.lines.iter().enumerate();
        let mut lines: Vec<(usize, &Line)> =
            lines.filter(|(_, line)| line.is_contradicted()).collect();
        lines.sort_by(|(_, a), (_, b)| b.likelihood().total_cmp(&a.likelihood()));
        let (places, lines): (Vec<usize>, Vec<&Line>) = lines.into_iter().unzip();
        let detail = contradiction_in_words(&lines)?;
        // Under a noise model an effect that explains little is a detail: it moves no answer far.
        let is_covered = self.analysis.noise.is_some();
        let n_residuals = self.problem.n_residuals();
        let is_large =
            |line: &Line| !is_covered || line.explained_share(n_residuals) > SLIGHT_SHARE;
        let moved = |index: usize, is_counted: &dyn Fn(&Line) -> bool| {
            let counted = lines.iter().filter(|line| is_counted(line));
            let moves = counted.filter_map(|line| line.suggested_move(index));
            moves.map(f64::abs).fold(0.0, f64::max)
        };
        let moves = Moves {
            any: &|index| moved(index, &|_| true),
            large: &|index| moved(index, &is_large),
        };
        let doubt = self.graded_by_moves(Rule::AssumptionContradicted, moves, detail);
        Some(doubt.about(Subject::Assumptions(places)))
    }

    /// A doubt that lowers the trust in each coordinate by how far the coordinate would be moved,
    /// as a position. Under a noise model the total intervals cover the moves, and their width counts too.
    pub(super) fn graded_by_moves(&self, rule: Rule, moves: Moves<'_>, detail: String) -> Doubt {
        let measured = |index: usize, moved: f64| -> Option<Move> {
            let deviation = self.deviation(index)?;
            Some(Move {
                errors: moved / deviation,
                share: moved / self.value_share(index),
            })
        };
        let is_covered = self.analysis.noise.is_some();
        let grave = match is_covered {
            true => GRAVE_COVERED_MOVE,
            false => GRAVE_MOVE,
        };
        let trust = |index: usize| {
            let Some(any) = measured(index, (moves.any)(index)) else {
                return Trust::Low;
            };
            let large = measured(index, (moves.large)(index));
            if large.is_some_and(|large| large.is_beyond(grave)) {
                Trust::Low
            } else if !any.is_beyond(SLIGHT_MOVE) {
                Trust::High
            } else if is_covered {
                self.trust_in_hull(index)
            } else {
                Trust::Moderate
            }
        };
        let grades = (0..self.problem.coordinates.len()).map(|coordinate| Grade {
            coordinate,
            trust: trust(coordinate),
        });
        let grades: Vec<Grade> = grades.filter(|grade| grade.trust < Trust::High).collect();
        let shares = grades.iter().filter_map(|grade| {
            Some(measured(grade.coordinate, (moves.any)(grade.coordinate))?.share)
        });
        let at_stake = shares.fold(0.0, f64::max);
        Doubt::graded(rule, grades, detail).at_stake(at_stake)
    }

    /// The residuals ask for unknowns that change within the record: one reason, because a change
    /// of one may look like that of another.
    pub(super) fn drifts(&self) -> Option<Doubt> {
        let drifts = &self.analysis.drifts;
        let (likeliest, others) = drifts.split_first()?;
        let windows = self.analysis.windows.as_ref();
        let scatter = |index: usize| windows.and_then(|windows| windows.scatters[index]);
        let moved = |index: usize| {
            let moves = drifts.iter().map(|drift| drift.move_of(index));
            // What windows say of an unknown is measured; what a change would do is extrapolated.
            scatter(index).unwrap_or_else(|| moves.fold(0.0, f64::max))
        };
        let name = |drift: &Drift| format!("`{}`", self.problem.coordinates[drift.coordinate].name);
        let named: Vec<String> = others.iter().take(MOST_NAMED).map(name).collect();
        let or = match named.is_empty() {
            true => String::new(),
            false => format!("; or it is {}", named.join(", ")),
        };
        let share = self.value_share(likeliest.coordinate);
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
            "{} {word} by {} ± {} % {parts} would explain what is left ({:.0} standard deviations \
             of noise{or}): something changes within the record; estimate from a shorter window, \
             or from parts of it one by one",
            name(likeliest),
            per_cent(likeliest.size.0),
            per_cent(likeliest.size.1),
            likeliest.score.abs(),
        );
        let moves = Moves {
            any: &moved,
            large: &moved,
        };
        Some(self.graded_by_moves(Rule::Drift, moves, detail))
    }

    pub(super) fn left_out(&self) -> Option<Doubt> {
        let detail = "what is taken as known was not looked at: the run was stopped, or the \
                      recording is too long; estimate from a window of it for a budget";
        let is_left_out = self.analysis.budget.is_left_out;
        is_left_out.then(|| Doubt::new(Rule::NoBudget, Trust::Moderate, detail))
    }

    /// Constraints that keep the estimate from where the data would have it.
    pub(super) fn constraints(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        for binding in &self.analysis.bindings {
            let constraint = &self.problem.constraints[binding.constraint];
            let is_in_it = |coordinate: &Coordinate| match coordinate.target {
                Target::Parameter(parameter) | Target::ExperimentParameter { parameter, .. } => {
                    constraint.parameters().contains(&parameter)
                }
                Target::InitialState { .. } => false,
            };
            let coordinates = self.problem.coordinates.iter().enumerate();
            let concerned = coordinates.filter(|(_, coordinate)| is_in_it(coordinate));
            let concerned = concerned.map(|(index, _)| index).collect();
            let (text, deviations) = (constraint.text(), binding.deviations);
            let (trust, rule, advice) = if deviations > LARGEST_CONTRADICTION {
                let advice = "either it is wrong, or the model misses an effect";
                (Trust::Low, Rule::ConstraintContradicted, advice)
            } else {
                let advice = "noise alone can do that, and the intervals end there";
                (Trust::High, Rule::ConstraintBinds, advice)
            };
            let detail = format!(
                "`{text}` holds with equality: the data would go beyond it by {deviations:.1} \
                 standard deviations of noise; {advice}"
            );
            let doubt = Doubt::new(rule, trust, detail).concerning(concerned);
            doubts.push(doubt.about(Subject::Constraint(binding.constraint)));
        }
        doubts
    }

    /// Priors that the data move away from.
    pub(super) fn priors(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        for (index, uncertainty) in self.analysis.coordinates.iter().enumerate() {
            let shift = uncertainty.prior_shift.map(f64::abs);
            if let Some(shift) = shift.filter(|shift| *shift > LARGEST_SHIFT) {
                let detail = format!(
                    "the data move `{}` by {shift:.1} standard deviations of what was known of it \
                     before: one of the two is wrong; check the prior, or look for an effect that \
                     the model leaves out",
                    self.problem.coordinates[index].name,
                );
                let doubt = Doubt::new(Rule::PriorContradicted, Trust::Moderate, detail);
                doubts.push(doubt.concerning(vec![index]));
            }
        }
        doubts
    }
}

/// What the residuals ask for, the likeliest explanation first; none where there is none.
fn contradiction_in_words(lines: &[&Line]) -> Option<String> {
    let (likeliest, others) = lines.split_first()?;
    let (value, error) = likeliest.suggested?;
    let assumption = &likeliest.assumption;
    let names = others.iter().take(MOST_NAMED);
    let named: Vec<String> = names
        .map(|line| format!("`{}`", line.assumption.name))
        .collect();
    let or = match (named.join(", "), others.len().saturating_sub(MOST_NAMED)) {
        (_, _) if named.is_empty() => String::new(),
        (named, 0) => format!("; or it is {named}"),
        (named, more) => format!("; or it is {named} or one of {more} others in the budget"),
    };
    let words = if assumption.value == 0.0 {
        format!(
            "`{}` of {} ± {} {}",
            assumption.name,
            short(value),
            short(error),
            assumption.unit
        )
    } else {
        let word = if value.abs() < assumption.value.abs() {
            "smaller"
        } else {
            "larger"
        };
        let per_cent = |part: f64| short(100.0 * (part / assumption.value).abs());
        let by = (per_cent(value - assumption.value), per_cent(error));
        format!("`{}` {word} by {} ± {} %", assumption.name, by.0, by.1)
    };
    let advice = match assumption.target {
        Assumed::Model(_) => "free it with {\"estimate\": {}}, or measure it",
        Assumed::Probe(_) => "the equations have no such term: add it, as a parameter to estimate",
        Assumed::Input(_) => "check how the input is scaled, or what acts beside it",
        Assumed::Sensor { .. } => "calibrate the sensor, or correct the recording for it",
        Assumed::Clock => "compare the clock with another, or correct the sample time for it",
    };
    Some(format!(
        "{words} would explain what is left ({:.0} standard deviations of noise{or}): {advice}",
        likeliest.score?.abs(),
    ))
}
