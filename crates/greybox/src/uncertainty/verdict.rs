//! Whether the numbers can be trusted, in words.
//!
//! Every rule stands in this folder's part of the table. A rule that finds something lowers the
//! trust of the parameters that it concerns to its level and says what it saw and what to do next;
//! high trust promises that a parameter's total interval holds for everything in the budget. The
//! job has the trust of its worst parameter. Where the record starts is not what a job is for: an
//! initial state lowers the job only where its range cuts the estimate off.
//!
//! | rule | trust | when |
//! |---|---|---|
//! | `not_finished` | low | the run was ended before its refinement |
//! | `at_bound` | low, for an initial state moderate | it stands at an end of its search range |
//! | `not_identifiable` | low, for those that it concerns | its interval is wider than its search range, or is none |
//! | `misfit` | low | chi²/n above 1.5; or residuals far from white and no noise declared |
//! | `opposite_sign` | low | an output is simulated against what was measured |
//! | `assumption_contradicted` | by how far it moves a parameter | the residuals pull at what is taken as known, beyond four standard deviations |
//! | `drift` | by how far it moves a parameter | the residuals ask for an unknown that changes within the record, beyond four standard deviations |
//! | `assumptions_dominate` | low, or a remark | the total interval is wider than the search range; its standard error beyond 10 % of the value |
//! | `no_budget` | moderate | what is taken as known was not looked at |
//! | `prior_contradicted` | moderate | the data moved it by more than three standard deviations of its prior |
//! | `constraint_contradicted` | low, for those in it | the data would go beyond a constraint by more than three standard deviations |
//! | `constraint_binds` | a remark | the data would go beyond a constraint, by less |
//! | `slight_misfit` | moderate | chi²/n between 1.15 and 1.5 |
//! | `residuals_not_white` | moderate | residuals with a memory: the model misses dynamics |
//! | `residuals_follow_input` | moderate | residuals correlated with what an input was |
//! | `correlated` | moderate | a correlation beyond 0.95 of two unknowns, one of them known to no more than 2 % |
//! | `worse_on_validation` | moderate, low beyond twice | RMSE on the data held back 1.3 times that estimated from |
//! | `noise_unknown` | moderate | no noise level is declared and the fit is below 90 % |
//! | `twin_minima` | low | other parameters cost as little |
//! | `plateau` | low | a constant explains as much |
//! | `starts_disagree` | moderate | no second start of the refinement came to the lowest cost |

use crate::estimation::problem::{Problem, Target};

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
#[derive(Clone, Debug, PartialEq)]
pub struct Reason {
    /// A stable word for programs.
    pub code: &'static str,
    /// What was seen, and what to do next.
    pub detail: String,
    /// How far it lets those that it concerns be trusted.
    pub trust: Trust,
    /// The coordinates that it concerns, each with how far it lets it be trusted; none: all.
    pub concerns: Option<Vec<(usize, Trust)>>,
    /// How much of a parameter's value is at stake, where that is known: what reasons of equal
    /// trust are ranked by.
    pub at_stake: f64,
}

/// The verdict with its reasons.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// How far the job's parameters can be trusted: as far as the worst.
    pub trust: Trust,
    /// Why not further, the gravest first.
    pub reasons: Vec<Reason>,
    /// How far each coordinate can be trusted.
    pub coordinates: Vec<Trust>,
    /// What it comes to, in one sentence.
    pub summary: String,
}

impl Verdict {
    /// Low trust for one reason, in all coordinates of a problem.
    #[must_use]
    pub fn low(problem: &Problem, code: &'static str, detail: String) -> Verdict {
        let mut verdict = Verdict::default();
        verdict.lower(Trust::Low, code, detail);
        verdict.settle(problem);
        verdict
    }

    /// Lowers the trust in all coordinates.
    pub(super) fn lower(&mut self, trust: Trust, code: &'static str, detail: String) {
        self.push(trust, (None, 0.0), (code, detail));
    }

    /// Lowers the trust in some coordinates, in which a share of their value is at stake.
    pub(super) fn lower_some(
        &mut self,
        trust: Trust,
        (concerned, at_stake): (Vec<usize>, f64),
        (code, detail): (&'static str, String),
    ) {
        let each = concerned.into_iter().map(|index| (index, trust)).collect();
        self.push(trust, (Some(each), at_stake), (code, detail));
    }

    /// Lowers the trust in each of some coordinates to its own level.
    pub(super) fn lower_each(
        &mut self,
        concerned: Vec<(usize, Trust)>,
        at_stake: f64,
        reason: (&'static str, String),
    ) {
        let gravest = concerned.iter().map(|(_, trust)| *trust).min();
        let gravest = gravest.unwrap_or_default();
        self.push(gravest, (Some(concerned), at_stake), reason);
    }

    fn push(
        &mut self,
        trust: Trust,
        (concerns, at_stake): (Option<Vec<(usize, Trust)>>, f64),
        (code, detail): (&'static str, String),
    ) {
        self.reasons.push(Reason {
            code,
            detail,
            trust,
            concerns,
            at_stake,
        });
    }

    /// Ranks the reasons and says what follows for each coordinate and for the job.
    pub(super) fn settle(&mut self, problem: &Problem) {
        self.reasons.sort_by(|a, b| {
            let stakes = b.at_stake.total_cmp(&a.at_stake);
            a.trust.cmp(&b.trust).then(stakes)
        });
        let of_coordinate = |index: usize| {
            let own = |reason: &Reason| match &reason.concerns {
                None => Some(reason.trust),
                Some(some) => some.iter().find(|own| own.0 == index).map(|own| own.1),
            };
            self.reasons
                .iter()
                .filter_map(own)
                .min()
                .unwrap_or_default()
        };
        self.coordinates = (0..problem.coordinates.len()).map(of_coordinate).collect();
        let pairs = || problem.coordinates.iter().zip(&self.coordinates);
        let is_parameter = |target: Target| !matches!(target, Target::InitialState { .. });
        let parameters = pairs().filter(|(own, _)| is_parameter(own.target));
        let worst = parameters.map(|(_, trust)| *trust).min();
        let worst = worst.or(self.coordinates.iter().copied().min());
        self.trust = worst.unwrap_or_default();
        let names = |trust: Trust| {
            let own = pairs().filter(|(own, found)| is_parameter(own.target) && **found == trust);
            own.map(|(own, _)| format!("`{}`", own.name))
                .collect::<Vec<_>>()
        };
        self.summary = summary(&[
            (names(Trust::High), "can be relied on"),
            (names(Trust::Moderate), "with the reasons in mind"),
            (names(Trust::Low), "not to be used"),
        ]);
    }
}

/// One sentence of who is how far to be trusted.
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
