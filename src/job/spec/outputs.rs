//! The `outputs` section: what is known about each measured output.

use std::collections::{BTreeMap, HashMap};

use super::experiment::Link;
use super::{ExperimentSpec, OutputSpec};
use crate::document::reader::{Field, did_you_mean, listed};
use crate::job::id::DatasetId;
use crate::model::ModelDescription;
use crate::recording::Summary;

/// What the section says about each output; every name must be one that is measured.
pub(super) fn read(
    field: &Field<'_>,
    model: Option<&ModelDescription>,
    experiments: Option<&[ExperimentSpec]>,
    datasets: &HashMap<DatasetId, Summary>,
) -> BTreeMap<String, OutputSpec> {
    let mut outputs = BTreeMap::new();
    for (name, field) in field.object().map(|o| o.entries()).into_iter().flatten() {
        check_output(name, &field, model, experiments);
        let Some(mut object) = field.object() else {
            continue;
        };
        let noise_std = object.optional("noise_std").and_then(|f| f.positive());
        let noise_share = object.optional("noise_share").and_then(|f| f.positive());
        let noise_signal = object.optional("noise_signal");
        let noise_signal = noise_signal.and_then(|field| {
            let signal = field.text()?;
            let measured = experiments.into_iter().flatten();
            let measured = measured.filter(|experiment| experiment.signals.contains_key(name));
            let recordings = measured.filter_map(|own| datasets.get(&own.dataset));
            let links = recordings.filter_map(|recording| {
                Some(Link {
                    model: model?,
                    recording,
                })
            });
            links.for_each(|link| link.check_noise(&field, name, signal));
            Some(signal.to_owned())
        });
        object.finish();
        let said = OutputSpec {
            noise_std,
            noise_share,
            noise_signal,
        };
        outputs.insert(name.to_owned(), said);
    }
    outputs
}

/// An output that is described must be one of the model, and be measured.
pub(super) fn check_output(
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
