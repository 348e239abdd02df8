//! The parameters of a job: those that all experiments share, and those that single experiments have
//! for themselves.

use std::collections::BTreeMap;

use super::{
    ExperimentRole, ExperimentSpec, FreeParameter, InitialStateSpec, ModelSearch, ParameterSpec,
};
use greybox_numerics::parsing::reader::Object;
use greybox_simulation::model::ModelDescription;
#[cfg(test)]
use {
    greybox_numerics::parsing::reader::{Faults, Field},
    greybox_simulation::model::Catalogue,
    serde_json::json,
};

/// What a job and its experiments say of the parameters of a model.
#[derive(Clone, Copy)]
pub(super) struct JobParameters<'a> {
    /// The model of the job.
    pub(super) model: &'a ModelDescription,
    /// The parameters of the job.
    pub(super) shared: &'a BTreeMap<String, ParameterSpec>,
    /// The experiments with their parameters.
    pub(super) experiments: &'a [ExperimentSpec],
}

/// Whether an experiment that is estimated from takes the job's value of a parameter, and not one
/// of its own.
pub(super) fn shares(experiments: &[ExperimentSpec], parameter: &str) -> bool {
    experiments.iter().any(|experiment| {
        experiment.role == ExperimentRole::Estimation
            && !experiment.parameters.contains_key(parameter)
    })
}

fn is_free(spec: &ParameterSpec) -> bool {
    matches!(spec, ParameterSpec::Free(_))
}

impl<'a> JobParameters<'a> {
    /// An unknown that experiments share.
    pub(super) fn shared_unknown(&self, name: &str) -> Option<&'a FreeParameter> {
        match self.shared.get(name) {
            Some(ParameterSpec::Free(free)) if shares(self.experiments, name) => Some(free),
            _ => None,
        }
    }

    /// Whether a parameter is unknown in any experiment.
    pub(super) fn is_unknown_anywhere(&self, name: &str) -> bool {
        let experiments = self.experiments.iter();
        let mut specs = experiments
            .filter_map(|experiment| experiment.parameters.get(name))
            .chain(self.shared.get(name));
        specs.any(is_free)
    }

    /// Whether there is anything to estimate.
    pub(super) fn has_unknowns(&self) -> bool {
        let has_unknown_start = |experiment: &ExperimentSpec| {
            let mut states = self.model.states.iter();
            states.any(|state| match experiment.initial_state.get(&*state.name) {
                Some(start) => matches!(start, InitialStateSpec::Free(_)),
                None => state.initial.is_estimated(),
            })
        };
        let mut shared = self.shared.keys();
        shared.any(|name| self.shared_unknown(name).is_some())
            || self.experiments.iter().any(|experiment| {
                experiment.parameters.values().any(is_free) || has_unknown_start(experiment)
            })
    }

    /// What experiments say of their own parameters must leave every number something that the
    /// number can be estimated from, and one meaning.
    pub(super) fn check(&self, job: &Object<'_>, search: Option<&ModelSearch>) {
        for (name, spec) in self.shared {
            let mut experiments = self.experiments.iter();
            let without = experiments.position(|e| !e.parameters.contains_key(name));
            if let (true, false, Some(without)) =
                (is_free(spec), shares(self.experiments, name), without)
            {
                let detail = format!(
                    "every experiment that is estimated from has its own `{name}`, but experiment \
                     {without}, which validates, has none: give it a value there"
                );
                job.fault("contradiction", detail);
            }
        }
        for effect in search.map_or(&[][..], |search| &search.effects) {
            let mut experiments = self.experiments.iter();
            if let Some(experiment) = experiments.position(|e| e.parameters.contains_key(effect)) {
                let detail = format!(
                    "`{effect}` is an effect that `model_search` decides about for all experiments; \
                     experiment {experiment} cannot have its own"
                );
                job.fault("contradiction", detail);
            }
        }
    }
}

/// The place and the code of each fault that the reader of a section finds in a document, where the
/// job has one experiment of the servo and says nothing of its parameters.
#[cfg(test)]
pub(super) fn faults_of<T>(
    document: &serde_json::Value,
    read: impl Fn(&Field<'_>, JobParameters<'_>) -> T,
) -> Vec<(String, String)> {
    let model = Catalogue::built_in();
    let model = model
        .get("single_rod_servo")
        .expect("a model")
        .description();
    let faults = Faults::default();
    let experiment = json!({"dataset": "ds_0192d3a4b5c67d8e9f00112233445566", "window": null});
    let experiment = serde_json::from_value(experiment).expect("an experiment");
    let parameters = JobParameters {
        model,
        shared: &super::parameter::read_all(None, model),
        experiments: &[experiment],
    };
    read(&Field::root(document, &faults), parameters);
    let faults = faults.into_vec().into_iter();
    faults
        .map(|fault| (fault.pointer().to_owned(), fault.code.into_owned()))
        .collect()
}
