//! Whether a window says something: before its job, and by its result.

use std::collections::BTreeMap;

use greybox::identification::JobSpec;
use greybox::identification::outcome::{Outcome, Rule, Trust};
use greybox::identification::spec::ParameterSpec;

/// The job whose data show what a window could say by itself, at the middle of a prior: without priors, and with what
/// was left of each output in the window before as the noise of those of which nothing is declared.
#[must_use]
pub fn looking_ahead(warm: &JobSpec, left: &BTreeMap<String, f64>) -> JobSpec {
    let mut ahead = warm.clone();
    ahead.priors.clear();
    for parameter in ahead.parameters.values_mut() {
        if let ParameterSpec::Free(free) = parameter {
            free.prior = None;
        }
    }
    for (output, left) in left.iter().filter(|(_, left)| **left > 0.0) {
        let spec = ahead.outputs.entry(output.clone()).or_default();
        if !spec.declares_noise() {
            spec.noise_std = Some(*left);
        }
    }
    ahead
}

/// Whether a result fixes none of its parameters well enough to be used, because of what noise leaves open alone.
#[must_use]
pub fn says_nothing(outcome: &Outcome) -> bool {
    let is_open = |name: &String| {
        let mut reasons = outcome.verdict.reasons.iter();
        reasons.any(|reason| {
            let concerns = reason.concerns.as_ref();
            matches!(reason.code, Rule::WideInterval | Rule::NotIdentifiable)
                && concerns.is_some_and(|concerns| concerns.contains(name))
        })
    };
    let mut shared = outcome
        .parameters
        .iter()
        .filter(|parameter| parameter.experiment.is_none());
    shared.all(|parameter| parameter.estimate.trust == Some(Trust::Low) && is_open(&parameter.name))
}
