//! The `method` section, and what the settings of a job ask of the rest of the job.

use super::{JobSpec, OutputSpec};
use crate::estimation::Settings;
use crate::uncertainty::settings::Intervals;
use greybox_numerics::parsing::reader::{Field, Object};
use greybox_numerics::parsing::settings::Section as _;
use greybox_simulation::model::ModelDescription;

/// The settings, which a method has to be able to work with.
pub(super) fn read(field: &Field<'_>) -> Settings {
    let settings = Settings::read(field);
    if let Some(detail) = settings.contradiction() {
        field.fault("contradiction", detail);
    }
    settings
}

/// What Huber's loss asks of the rest of the job: a noise level to measure residuals by, and
/// nothing that compares likelihoods.
pub(super) fn check_loss(job: &Object<'_>, spec: &JobSpec, model: &ModelDescription) {
    if spec.method.huber_threshold.is_none() {
        return;
    }
    let is_measured = |name: &str| {
        let mut experiments = spec.experiments.iter();
        experiments.any(|experiment| experiment.signals.contains_key(name))
    };
    let has_noise = |name: &str| {
        let output = spec.outputs.get(name);
        output.is_some_and(OutputSpec::declares_noise)
    };
    let outputs = model.outputs.iter().map(|output| &*output.name);
    for output in outputs.filter(|name| is_measured(name) && !has_noise(name)) {
        let detail = format!(
            "`method.huber_threshold` counts in units of the noise: \
             `outputs.{output}.noise_std` is needed"
        );
        job.fault("missing_field", detail);
    }
    if spec.model_search.is_some() {
        let detail = "`model_search` compares models by the likelihood of normal noise, which \
                      `method.huber_threshold` gives up: leave one of them out";
        job.fault("contradiction", detail);
    }
    if spec.uncertainty.intervals == Intervals::Profile {
        let detail = "profile intervals follow the likelihood of normal noise, which \
                      `method.huber_threshold` gives up: ask for `bootstrap`";
        job.fault("contradiction", detail);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncertainty;
    use greybox_numerics::parsing::reader::Faults;
    use serde_json::json;

    #[test]
    fn too_few_fits_for_an_interval_are_refused_where_they_are_asked_for() {
        for (asked, is_refused) in [(0, false), (3, true), (100, false), (100_001, true)] {
            let document = json!({"monte_carlo_samples": asked});
            let faults = Faults::default();
            uncertainty::Settings::read(&Field::root(&document, &faults));
            let faults = faults.into_vec();
            assert_eq!(!faults.is_empty(), is_refused, "{asked}: {faults:?}");
            assert!(
                faults
                    .iter()
                    .all(|fault| fault.pointer == "/monte_carlo_samples")
            );
        }
    }
}
