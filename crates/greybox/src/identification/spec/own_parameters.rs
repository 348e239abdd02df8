//! Parameters that single experiments have for themselves.

use std::collections::BTreeMap;

use super::{ExperimentRole, ExperimentSpec, ModelSearch, ParameterSpec};
use greybox_numerics::parsing::reader::Object;

/// Whether an experiment that is estimated from takes the job's value of a parameter, and not one
/// of its own.
pub(super) fn shares(experiments: &[ExperimentSpec], parameter: &str) -> bool {
    experiments.iter().any(|experiment| {
        experiment.role == ExperimentRole::Estimation
            && !experiment.parameters.contains_key(parameter)
    })
}

/// What experiments say of their own parameters must leave every number something that it can be
/// estimated from, and one meaning.
pub(super) fn check(
    job: &Object<'_>,
    experiments: &[ExperimentSpec],
    parameters: &BTreeMap<String, ParameterSpec>,
    search: Option<&ModelSearch>,
) {
    for (name, said) in parameters {
        let free = matches!(said, ParameterSpec::Free(_));
        let alone = experiments
            .iter()
            .position(|experiment| !experiment.parameters.contains_key(name));
        if let (true, false, Some(alone)) = (free, shares(experiments, name), alone) {
            let detail = format!(
                "every experiment that is estimated from has its own `{name}`, but experiment \
                 {alone}, which validates, has none: give it a value there"
            );
            job.fault("contradiction", detail);
        }
    }
    for effect in search.map_or(&[][..], |search| &search.effects) {
        let own = |experiment: &ExperimentSpec| experiment.parameters.contains_key(effect);
        if let Some(experiment) = experiments.iter().position(own) {
            let detail = format!(
                "`{effect}` is an effect that `model_search` decides about for all experiments; \
                 experiment {experiment} cannot have its own"
            );
            job.fault("contradiction", detail);
        }
    }
}
