//! The `outputs` section: what is known about each measured output.

use std::collections::{BTreeMap, HashMap};

use super::ExperimentSpec;
use super::experiment::SignalMatch;
use crate::identification::DatasetId;
use greybox_numerics::parsing::reader::{Field, did_you_mean, listed};
use greybox_recording::Summary;
use greybox_simulation::model::{ModelDescription, Tolerance, ToleranceText};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What is known about a measured output.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct OutputSpec {
    /// The standard deviation of its measurement noise, SI; left out, it is estimated, unless one
    /// of the next two says it. Where more than one is given their squares add up.
    #[schema(exclusive_minimum = 0, example = 1e-5)]
    pub noise_std: Option<f64>,
    /// The standard deviation of its noise as a share of each measured value, e.g. 0.05 for 5 %.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, nullable = false, example = 0.05)]
    pub noise_share: Option<f64>,
    /// The recorded signal that holds the standard deviation of each sample's noise, in a unit of
    /// the output; a sample for which it is missing or not above 0 is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false, example = "position_std")]
    pub noise_signal: Option<String>,
    /// How well the gain of its sensor is known: one standard deviation, e.g. `"0.2 %"`; left out, it
    /// is taken as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<ToleranceText>, nullable = false, example = "0.2 %")]
    pub gain_tolerance: Option<Tolerance>,
    /// How well the offset of its sensor is known: one standard deviation, SI.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, nullable = false, example = 1e-5)]
    pub offset_tolerance: Option<f64>,
    /// How late its sensor may be: one standard deviation `[s]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, nullable = false, example = 1e-4)]
    pub lag_tolerance_s: Option<f64>,
}

impl OutputSpec {
    /// Whether anything is said of its noise.
    #[must_use]
    pub fn declares_noise(&self) -> bool {
        self.noise_std.is_some() || self.noise_share.is_some() || self.noise_signal.is_some()
    }
}

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
            let recordings = measured.filter_map(|experiment| datasets.get(&experiment.dataset));
            let links = recordings.filter_map(|recording| {
                Some(SignalMatch {
                    model: model?,
                    recording,
                })
            });
            links.for_each(|link| link.check_noise(&field, name, signal));
            Some(signal.to_owned())
        });
        let gain_tolerance = tolerance(object.optional("gain_tolerance"));
        let offset_tolerance = object.optional("offset_tolerance");
        let offset_tolerance = offset_tolerance.and_then(|field| field.positive());
        let lag_tolerance_s = object.optional("lag_tolerance_s");
        let lag_tolerance_s = lag_tolerance_s.and_then(|field| field.positive());
        object.finish();
        let spec = OutputSpec {
            noise_std,
            noise_share,
            noise_signal,
            gain_tolerance,
            offset_tolerance,
            lag_tolerance_s,
        };
        outputs.insert(name.to_owned(), spec);
    }
    outputs
}

/// How well something is known, where that is said.
pub(super) fn tolerance(field: Option<Field<'_>>) -> Option<Tolerance> {
    field.and_then(|field| Tolerance::read(&field))
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
    let names: Vec<&str> = model.outputs.iter().map(|output| &*output.name).collect();
    if !names.contains(&name) {
        let hint = did_you_mean(name, names.iter().copied());
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
