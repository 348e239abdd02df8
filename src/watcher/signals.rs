//! The signals of a stream that a job takes for inputs and for outputs of its model.

use greybox::identification::JobSpec;
use greybox::model::ModelDescription;

/// The recorded signals that a job takes for inputs of its model.
pub(super) fn inputs(job: &JobSpec, models: &[&ModelDescription]) -> Vec<String> {
    let model = models.iter().find(|model| model.name == job.model);
    let names = model
        .into_iter()
        .flat_map(|model| model.input_sets.iter().flatten());
    recorded(job, names.map(|name| &**name))
}

/// The recorded signals that a job takes for outputs of its model.
pub(super) fn outputs(job: &JobSpec, models: &[&ModelDescription]) -> Vec<String> {
    let model = models.iter().find(|model| model.name == job.model);
    let outputs = model.into_iter().flat_map(|model| &model.outputs);
    recorded(job, outputs.map(|output| &*output.name))
}

/// The signals of a recording that a job takes for these of its model.
fn recorded<'a>(job: &JobSpec, names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let signals = job
        .experiments
        .first()
        .map(|experiment| &experiment.signals);
    let mut recorded: Vec<String> = names
        .filter_map(|name| signals?.get(name).cloned())
        .collect();
    recorded.sort();
    recorded.dedup();
    recorded
}
