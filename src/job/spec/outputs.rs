//! The `outputs` section: what is known about each measured output.

use std::collections::BTreeMap;

use super::{ExperimentSpec, OutputSpec};
use crate::document::reader::{Field, did_you_mean, listed};
use crate::model::ModelDescription;

/// What the section says about each output; every name must be one that is measured.
pub(super) fn read(
    field: &Field<'_>,
    model: Option<&ModelDescription>,
    experiments: Option<&[ExperimentSpec]>,
) -> BTreeMap<String, OutputSpec> {
    let mut outputs = BTreeMap::new();
    for (name, field) in field.object().map(|o| o.entries()).into_iter().flatten() {
        check_output(name, &field, model, experiments);
        let Some(mut object) = field.object() else {
            continue;
        };
        let noise_std = object.optional("noise_std").and_then(|f| f.positive());
        object.finish();
        outputs.insert(name.to_owned(), OutputSpec { noise_std });
    }
    outputs
}

/// An output that is described must be one of the model, and be measured.
fn check_output(
    name: &str,
    field: &Field<'_>,
    model: Option<&ModelDescription>,
    experiments: Option<&[ExperimentSpec]>,
) {
    let Some(model) = model else {
        return;
    };
    let known = || model.outputs.iter().map(|output| &*output.name);
    if !known().any(|output| output == name) {
        let names: Vec<&str> = known().collect();
        let hint = did_you_mean(name, known());
        let detail = format!(
            "the outputs of `{}` are {}{hint}",
            model.name,
            listed(&names)
        );
        field.fault("unknown_output", detail);
    } else if let Some(experiments) = experiments
        && !experiments.iter().any(|e| e.signals.contains_key(name))
    {
        let detail = format!("no experiment measures `{name}`");
        field.fault("output_not_measured", detail);
    }
}
