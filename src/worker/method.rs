//! The method of each kind of job.

use std::sync::Arc;

use serde_json::Value;

use super::run::{Assignment, Method, Run};
use super::{design, identification};
use crate::job::{Failure, JobKind};
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

    /// The model of a job; `document` is what its user wrote, where he did.
    fn model(&self, name: &str, document: Option<&Value>) -> Result<Arc<Model>, Failure> {
        match document {
            Some(document) => read_model(document),
            None => self.catalogue.get(name).cloned().ok_or_else(|| {
                Failure::cannot_run(format!("there is no model `{name}`"), Vec::new())
            }),
        }
    }
}

impl Method for Methods {
    fn begin(&self, assignment: Assignment) -> Result<Box<dyn Run>, Failure> {
        let model = self.model(&assignment.job.model, assignment.model.as_ref())?;
        match JobKind::of(&assignment.job.spec) {
            JobKind::Identification => identification::begin(&model, assignment),
            JobKind::Design => design::begin(model, assignment),
        }
    }
}

fn read_model(document: &Value) -> Result<Arc<Model>, Failure> {
    let read = document::referenced(document).map_err(|faults| {
        let detail = "the stored model does not read back".to_owned();
        Failure::cannot_run(detail, faults)
    })?;
    Ok(read.model)
}
