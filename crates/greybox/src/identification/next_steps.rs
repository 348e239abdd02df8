//! The jobs to run next: what a reason of a verdict asks to be changed in the specification.
//!
//! Each step changes the typed specification; its patch is the difference between the two
//! documents (JSON merge patch, RFC 7396), so that the patched document is one that can be
//! submitted.

mod free;
mod job;
mod parameters;
mod patch;
#[cfg(test)]
mod tests;

use super::JobSpec;
use super::tried::{TriedStep, Tries};
use crate::uncertainty::Conclusion;
use crate::uncertainty::verdict::{Doubt, Rule, Subject};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeSet;
use utoipa::ToSchema;

/// Steps for one reason at the most.
const MOST_STEPS: usize = 4;
/// Significant digits of the numbers in a patch.
const DIGITS: usize = 4;

/// A change to the specification that answers a reason of the verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct NextStep {
    /// A few words for people.
    #[schema(example = "Widen the range of mass")]
    pub label: String,
    /// What the change is good for, with its numbers.
    #[schema(example = "Upper bound 320 kg.")]
    pub why: String,
    /// The change to the specification of the job: a JSON merge patch (RFC 7396). The patched
    /// specification can be submitted as a job.
    #[schema(value_type = Object,
             example = json!({"parameters": {"mass": {"estimate": {"upper": 320.0}}}}))]
    pub patch: Value,
    /// What the step would change, where it was tried: a step that needs the recordings to be cut anew, another search
    /// or more time is not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub tried: Option<TriedStep>,
}

/// A step that can be tried.
#[derive(Clone, Debug)]
pub(super) struct OpenStep {
    /// The text of the step's patch.
    pub(super) patch: String,
    /// The changed specification.
    pub(super) spec: JobSpec,
}

/// A changed specification, before it is compared with the one that it comes from.
struct Change {
    label: String,
    why: String,
    spec: JobSpec,
}

/// A job and what it came to.
pub(super) struct Finished<'a> {
    /// The specification of the job.
    pub(super) spec: &'a JobSpec,
    /// The conclusion of the analysis.
    pub(super) conclusion: &'a Conclusion,
    /// The steps that were tried.
    pub(super) tries: &'a Tries,
}

impl Finished<'_> {
    /// What may be done about a doubt, the most promising first; nothing where no change of the
    /// specification would help.
    pub(super) fn next_steps(&self, doubt: &Doubt) -> Vec<NextStep> {
        let changes = self.changes(doubt).into_iter();
        let steps = changes.filter_map(|change| self.step(change));
        steps.take(MOST_STEPS).collect()
    }

    /// The steps of all doubts, the gravest first, each once.
    pub(super) fn open_steps(&self) -> Vec<OpenStep> {
        let doubts = self.conclusion.analysis.judgement.doubts.iter();
        let changes = doubts.flat_map(|doubt| self.changes(doubt).into_iter().take(MOST_STEPS));
        let steps = changes.filter_map(|change| {
            let spec = change.spec.clone();
            let patch = self.step(change)?.patch.to_string();
            Some(OpenStep { patch, spec })
        });
        let mut seen = BTreeSet::new();
        let each_once = steps.filter(|step| seen.insert(step.patch.clone()));
        each_once.collect()
    }

    fn changes(&self, doubt: &Doubt) -> Vec<Change> {
        match (doubt.rule, &doubt.subject) {
            (Rule::NotIdentifiable | Rule::Correlated, Subject::Coordinates(all)) => {
                each(all, |&index| self.fix(index))
            }
            (Rule::AtBound, Subject::Coordinates(all)) => each(all, |&index| self.widen(index)),
            (Rule::PriorContradicted, Subject::Coordinates(all)) => {
                each(all, |&index| self.forget_prior(index))
            }
            (
                Rule::Misfit
                | Rule::SlightMisfit
                | Rule::ResidualsNotWhite
                | Rule::ResidualsFollowInput,
                subject,
            ) => {
                let mut changes = self.free_effects();
                if let (Rule::Misfit, Subject::Output(output)) = (doubt.rule, subject) {
                    changes.extend(self.declare_noise(*output));
                }
                changes.extend(self.look_for_disturbances());
                changes
            }
            (Rule::NoiseContradicted, Subject::Output(output)) => match self.is_white(*output) {
                true => self.correct_noise(*output).into_iter().collect(),
                false => self.free_effects(),
            },
            (Rule::NoiseUnknown, Subject::Output(output)) => {
                self.declare_noise(*output).into_iter().collect()
            }
            (Rule::AssumptionContradicted, Subject::Assumptions(lines)) => {
                each(lines, |&line| self.free_assumption(line))
            }
            (Rule::AssumptionsDominate, Subject::Assumptions(lines)) => {
                each(lines, |&line| self.know_better(line))
            }
            (Rule::TwinMinima, Subject::Twin(twin)) => self.choose_minimum(*twin),
            (Rule::ConstraintContradicted, Subject::Constraint(constraint)) => {
                vec![self.without_constraint(*constraint)]
            }
            (Rule::WorseOnValidation, _) => self.whole_recordings().into_iter().collect(),
            (Rule::StartsDisagree | Rule::Plateau, _) => vec![self.search_longer()],
            (Rule::NotFinished | Rule::NotAnalysed, _) => self.run_longer().into_iter().collect(),
            (Rule::PosteriorNotConverged, _) => self.draw_longer().into_iter().collect(),
            (Rule::Drift, _) => self.halves(),
            (Rule::NoBudget, _) if self.was_stopped() => self.run_longer().into_iter().collect(),
            (Rule::NoBudget, _) => self.halves(),
            _ => Vec::new(),
        }
    }

    /// The step to a changed specification; none where the change changes nothing, or leaves
    /// nothing to estimate.
    fn step(&self, change: Change) -> Option<NextStep> {
        let description = self.conclusion.problem.model.description();
        if !change.spec.estimates_anything(description) {
            return None;
        }
        let patch = patch::between(&document(self.spec), &document(&change.spec))?;
        let tried = self.tries.get(&patch.to_string()).cloned().flatten();
        let trust = self.conclusion.analysis.judgement.trust;
        let words = tried.as_ref().map(|tried| tried.in_words(trust));
        Some(NextStep {
            label: change.label,
            why: [Some(change.why), words]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join(" "),
            patch,
            tried,
        })
    }

    /// The specification changed in place.
    fn changed(&self, change: impl FnOnce(&mut JobSpec)) -> JobSpec {
        let mut spec = self.spec.clone();
        change(&mut spec);
        spec
    }
}

fn each<T>(items: &[T], change: impl Fn(&T) -> Option<Change>) -> Vec<Change> {
    items.iter().filter_map(change).collect()
}

fn document(spec: &JobSpec) -> Value {
    serde_json::to_value(spec).expect("a specification has only text keys and finite numbers")
}
