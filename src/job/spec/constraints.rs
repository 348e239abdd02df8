//! The `constraints` section: conditions that the parameters keep.

use super::{ExperimentSpec, ParameterSpec};
use crate::model::ModelDescription;
use crate::model::document::Condition;
use crate::parsing::reader::Field;
use std::collections::BTreeMap;

/// The constraints of one job at the most.
pub const MAX_CONSTRAINTS: usize = 16;

/// The section; what is wrong is told.
pub(super) fn read(
    field: &Field<'_>,
    model: &ModelDescription,
    (parameters, experiments): (&BTreeMap<String, ParameterSpec>, &[ExperimentSpec]),
) -> Vec<String> {
    let is_free = |name: &str| {
        let own = experiments.iter().filter_map(|own| own.parameters.get(name));
        let mut said = parameters.get(name).into_iter().chain(own);
        said.any(|said| matches!(said, ParameterSpec::Free(_)))
    };
    let Some(entries) = field.array() else {
        return Vec::new();
    };
    if entries.len() > MAX_CONSTRAINTS {
        let detail = format!(
            "{} constraints are more than {MAX_CONSTRAINTS}",
            entries.len()
        );
        field.fault("too_many", detail);
    }
    let mut texts = Vec::new();
    for entry in entries.take(MAX_CONSTRAINTS) {
        let conditions = Condition::read(&entry, model);
        let places = conditions.iter().flat_map(|own| own.parameters());
        let mut names = places.map(|place| &*model.parameters[*place].name);
        if !conditions.is_empty() && !names.any(&is_free) {
            let detail = "every parameter in it is known: there is nothing to keep";
            entry.fault("nothing_to_constrain", detail);
        }
        texts.extend(entry.value.as_str().map(str::to_owned));
    }
    texts
}
