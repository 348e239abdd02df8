//! The method of each kind of job.

use std::sync::Arc;

use super::run::{Assignment, Method, Run};
use super::{design, identification, selection};
use crate::job::{Failure, JobTask};
use crate::store::ModelRow;
use greybox::model::{Catalogue, Model, document};

/// Begins the runs of jobs of every kind.
#[derive(Debug)]
pub struct Methods {
    catalogue: Catalogue,
}

impl Methods {
    /// For jobs with the models of a catalogue, and with those that users wrote.
    pub fn new(catalogue: Catalogue) -> Self {
        Self { catalogue }
    }

    /// The model of a job: the stored one, where a user wrote the model.
    fn model(&self, name: &str, stored: Option<&ModelRow>) -> Result<Arc<Model>, Failure> {
        match stored {
            Some(stored) => read_model(stored),
            None => self.catalogue.get(name).cloned().ok_or_else(|| {
                Failure::cannot_run(format!("there is no model `{name}`"), Vec::new())
            }),
        }
    }
}

impl Method for Methods {
    fn begin(&self, assignment: Assignment) -> Result<Box<dyn Run>, Failure> {
        let model = self.model(&assignment.job.model, assignment.model.as_ref())?;
        match &assignment.job.task {
            JobTask::Identification(spec) => {
                let spec = spec.clone();
                identification::begin(&spec, &model, assignment)
            }
            JobTask::Design(task) => {
                let design = task.design.clone();
                design::begin(&design, model, assignment)
            }
            JobTask::Selection(task) => {
                let task = task.clone();
                selection::begin(&task, model, assignment)
            }
        }
    }
}

fn read_model(stored: &ModelRow) -> Result<Arc<Model>, Failure> {
    let read = document::referenced(&stored.document).map_err(|faults| {
        let detail = "the stored model does not read back".to_owned();
        Failure::cannot_run(detail, faults)
    })?;
    Ok(read.model)
}
