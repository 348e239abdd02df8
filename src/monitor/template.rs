//! The job that a monitor does again and again, without the recordings that the windows will be.

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use greybox::identification::spec::Context;
use greybox::identification::{DatasetId, JobSpec};
use greybox::parsing::Fault;
use greybox::parsing::reader::Field;

/// The document of a job whose one experiment names neither a recording nor a part of one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct JobTemplate(Value);

/// By what the job of a window is told from those of other windows.
#[derive(Clone, Debug)]
pub struct WindowLabel {
    /// The name of the job.
    pub name: String,
    /// The value of the label `monitor`.
    pub monitor: String,
}

impl JobTemplate {
    /// A document that was read before.
    #[must_use]
    pub fn new(document: Value) -> Self {
        Self(document)
    }

    /// Reads a document as far as the document is not that of any job.
    pub(super) fn read(field: &Field<'_>) -> Option<Self> {
        let mut object = field.object()?;
        if let Some(experiments) = object.optional("experiments") {
            for (index, experiment) in experiments.array()?.enumerate() {
                check_experiment(index, &experiment)?;
            }
        }
        Some(Self(field.value.clone()))
    }

    /// The document.
    #[must_use]
    pub fn document(&self) -> &Value {
        &self.0
    }

    /// The name of the model, where the document has one.
    #[must_use]
    pub fn model(&self) -> Option<&str> {
        self.0.get("model")?.as_str()
    }

    /// The job on one recording.
    ///
    /// # Errors
    /// Everything that is wrong with the job.
    pub fn job(&self, recording: DatasetId, context: &Context<'_>) -> Result<JobSpec, Vec<Fault>> {
        JobSpec::read(&self.with_recording(recording), context)
    }

    /// The job on the recording of a window.
    ///
    /// # Errors
    /// Everything that is wrong with the job.
    pub fn job_of_window(
        &self,
        recording: DatasetId,
        label: WindowLabel,
        context: &Context<'_>,
    ) -> Result<JobSpec, Vec<Fault>> {
        let mut document = self.with_recording(recording);
        document["name"] = json!(label.name);
        document["labels"]["monitor"] = json!(label.monitor);
        if document.get("seed").is_none() {
            document["seed"] = json!(1);
        }
        JobSpec::read(&document, context)
    }

    fn with_recording(&self, recording: DatasetId) -> Value {
        let mut document = self.0.clone();
        let experiment = document.pointer("/experiments/0").cloned();
        let mut experiment = experiment.unwrap_or_else(|| json!({}));
        experiment["dataset"] = json!(recording);
        document["experiments"] = json!([experiment]);
        document
    }
}

/// Faults what an experiment of a monitor may not have; nothing where the experiment is no object.
fn check_experiment(index: usize, experiment: &Field<'_>) -> Option<()> {
    if index > 0 {
        let detail = "a monitor has one experiment: the windows of its stream";
        experiment.fault("too_many_experiments", detail);
    }
    let mut experiment = experiment.object()?;
    let given = ["dataset", "window"].map(|name| experiment.optional(name));
    for field in given.into_iter().flatten() {
        let detail = "the windows of the stream are the recordings; leave it out";
        field.fault("unknown_field", detail);
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_recording_of_a_window_is_that_of_the_one_experiment() {
        let template = JobTemplate::new(json!({"model": "lag", "seed": 1}));
        let recording = DatasetId::new();
        assert_eq!(template.model(), Some("lag"));
        assert_eq!(
            template.with_recording(recording),
            json!({"model": "lag", "seed": 1, "experiments": [{"dataset": recording}]})
        );
    }
}
