//! Whether the numbers can be trusted, in words.
//!
//! A rule that finds something raises a [`Doubt`]: it lowers the trust of the parameters that it
//! concerns, and says what it saw and what to do next. High trust promises that a parameter's
//! total interval holds for everything in the budget. The job has the trust of its worst parameter.
//! Where the record starts is not what a job is for: an initial state lowers the job only where its
//! range cuts the estimate off. [`Rule`] is the table of the rules.

mod rule;

pub use rule::{Rule, RuleEntry};

use crate::estimation::problem::{Coordinate, Problem};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The grade of a verdict.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Trust {
    /// Do not use the numbers.
    Low,
    /// Use the numbers with the reasons in mind.
    Moderate,
    /// Nothing speaks against the numbers.
    #[default]
    High,
}

impl Trust {
    /// The word in results.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Trust::Low => "low",
            Trust::Moderate => "moderate",
            Trust::High => "high",
        }
    }
}

/// How far a doubt lets a coordinate be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grade {
    /// The coordinate, by its place.
    pub coordinate: usize,
    /// The trust in the coordinate at the most.
    pub trust: Trust,
}

/// What a doubt is about: next steps are made from it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Subject {
    /// The job as a whole.
    #[default]
    Job,
    /// Coordinates, by their places.
    Coordinates(Vec<usize>),
    /// An output, by its place among the compared outputs.
    Output(usize),
    /// Lines of the budget by their places, the likeliest or most helpful first.
    Assumptions(Vec<usize>),
    /// A constraint of the problem, by its place.
    Constraint(usize),
    /// One of the other minima of the report, by its place.
    Twin(usize),
}

/// A rule that spoke.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubt {
    /// The rule.
    pub rule: Rule,
    /// What the rule saw, and what to do next.
    pub detail: String,
    /// How far the doubt lets the coordinates that it concerns be trusted.
    pub trust: Trust,
    /// The coordinates that the doubt concerns; none: all.
    pub concerns: Option<Vec<Grade>>,
    /// How much of a parameter's value is at stake, where that is known: doubts of equal trust are
    /// ranked by it.
    pub at_stake: f64,
    /// What the doubt is about.
    pub subject: Subject,
}

impl Doubt {
    /// A doubt about all coordinates of the job.
    pub(super) fn new(rule: Rule, trust: Trust, detail: impl Into<String>) -> Doubt {
        Doubt {
            rule,
            detail: detail.into(),
            trust,
            concerns: None,
            at_stake: 0.0,
            subject: Subject::Job,
        }
    }

    /// A doubt that lets each of some coordinates be trusted to a grade of its own.
    pub(super) fn graded(rule: Rule, grades: Vec<Grade>, detail: impl Into<String>) -> Doubt {
        let gravest = grades.iter().map(|grade| grade.trust).min();
        Doubt {
            concerns: Some(grades),
            ..Doubt::new(rule, gravest.unwrap_or_default(), detail)
        }
    }

    /// Leaves coordinates out that the doubt does not concern, and is about the others.
    pub(super) fn concerning(self, coordinates: Vec<usize>) -> Doubt {
        let trust = self.trust;
        let grade = |&coordinate: &usize| Grade { coordinate, trust };
        Doubt {
            concerns: Some(coordinates.iter().map(grade).collect()),
            ..self.about(Subject::Coordinates(coordinates))
        }
    }

    /// Says what the doubt is about.
    pub(super) fn about(self, subject: Subject) -> Doubt {
        Doubt { subject, ..self }
    }

    /// Lowers no trust further than to a grade.
    pub(super) fn at_least(self, least: Trust) -> Doubt {
        Doubt {
            trust: self.trust.max(least),
            ..self
        }
    }

    /// Says how much of a parameter's value is at stake.
    pub(super) fn at_stake(self, at_stake: f64) -> Doubt {
        Doubt { at_stake, ..self }
    }

    /// How far the doubt lets a coordinate be trusted; none where the doubt does not concern it.
    fn trust_in(&self, coordinate: usize) -> Option<Trust> {
        match &self.concerns {
            None => Some(self.trust),
            Some(grades) => {
                let mut grades = grades.iter();
                let grade = grades.find(|grade| grade.coordinate == coordinate);
                grade.map(|grade| grade.trust)
            }
        }
    }
}

/// What all doubts together come to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Judgement {
    /// How far the job's parameters can be trusted: as far as the worst.
    pub trust: Trust,
    /// What speaks against the estimate, the gravest first.
    pub doubts: Vec<Doubt>,
    /// How far each coordinate can be trusted.
    pub coordinates: Vec<Trust>,
    /// What the doubts come to, in one sentence.
    pub summary: String,
}

impl Judgement {
    /// Ranks doubts and says what follows for each coordinate and for the job.
    #[must_use]
    pub fn of(problem: &Problem, mut doubts: Vec<Doubt>) -> Judgement {
        doubts.sort_by(|a, b| {
            let stakes = b.at_stake.total_cmp(&a.at_stake);
            a.trust.cmp(&b.trust).then(stakes)
        });
        let trust_in = |coordinate: usize| {
            let grades = doubts.iter().filter_map(|doubt| doubt.trust_in(coordinate));
            grades.min().unwrap_or_default()
        };
        let coordinates: Vec<Trust> = (0..problem.coordinates.len()).map(trust_in).collect();
        let parameters = || {
            let pairs = problem.coordinates.iter().zip(&coordinates);
            pairs.filter(|(coordinate, _)| is_parameter(coordinate))
        };
        let worst = parameters().map(|(_, trust)| *trust).min();
        let worst = worst.or(coordinates.iter().copied().min());
        let names = |trust: Trust| {
            let of_trust = parameters().filter(|(_, grade)| **grade == trust);
            of_trust
                .map(|(coordinate, _)| format!("`{}`", coordinate.name))
                .collect::<Vec<_>>()
        };
        let summary = summary(&[
            (names(Trust::High), "can be relied on"),
            (names(Trust::Moderate), "with the reasons in mind"),
            (names(Trust::Low), "not to be used"),
        ]);
        Judgement {
            trust: worst.unwrap_or_default(),
            doubts,
            coordinates,
            summary,
        }
    }
}

fn is_parameter(coordinate: &Coordinate) -> bool {
    !coordinate.is_start()
}

/// One sentence of which parameters can be trusted how far.
fn summary(groups: &[(Vec<String>, &str)]) -> String {
    let filled: Vec<&(Vec<String>, &str)> = groups
        .iter()
        .filter(|(names, _)| !names.is_empty())
        .collect();
    match filled[..] {
        [] => String::new(),
        [(_, words)] => format!("the total intervals of all parameters: {words}"),
        _ => filled
            .iter()
            .map(|(names, words)| format!("{}: {words}", names.join(", ")))
            .collect::<Vec<_>>()
            .join("; "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_names_who_is_trusted_how_far() {
        let some = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        let words = summary(&[
            (some(&["`mass`", "`stiffness`"]), "can be relied on"),
            (Vec::new(), "with the reasons in mind"),
            (some(&["`damping`"]), "not to be used"),
        ]);
        assert_eq!(
            words,
            "`mass`, `stiffness`: can be relied on; `damping`: not to be used"
        );
        let words = summary(&[(some(&["`mass`"]), "can be relied on")]);
        assert_eq!(
            words,
            "the total intervals of all parameters: can be relied on"
        );
    }
}
