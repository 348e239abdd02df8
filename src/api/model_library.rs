//! Models by name: those of the program, and those that users of a project wrote.

use std::sync::Arc;

use serde_json::Value;

use super::client::Client;
use super::error::{Answer, Problem};
use super::work::Work;
use crate::access::Project;
use crate::store::{Models, NewModel};
use greybox::model::document::{self, Referenced};
use greybox::model::{Catalogue, Model, ModelDescription};
use greybox::parsing::Fault;

/// What a job or a simulation names as its model.
pub(super) struct Asked {
    /// The model, where the document names one that the catalogue does not have.
    pub model: Option<Arc<Model>>,
    /// What must be stored before a job may name it.
    pub new: Option<NewModel>,
    /// The document, with the model's name in the place of the model.
    pub document: Value,
}

/// Finds and reads models. Cheap to clone.
#[derive(Clone)]
pub struct ModelLibrary {
    /// The models of the program.
    pub(super) catalogue: Arc<Catalogue>,
    /// The models that users wrote.
    pub(super) models: Models,
    /// Reads documents beside the threads that serve.
    pub(super) work: Work,
}

impl ModelLibrary {
    /// The models of a catalogue and of a store.
    pub(super) fn new(catalogue: Catalogue, models: Models, work: Work) -> Self {
        Self {
            catalogue: Arc::new(catalogue),
            models,
            work,
        }
    }

    /// A model by its name: one of the program's, or one of the project by its reference.
    pub(super) async fn model(&self, project: &Project, name: &str) -> Answer<Arc<Model>> {
        if let Some(model) = self.catalogue.get(name) {
            return Ok(model.clone());
        }
        let row = self.models.find(project, name).await?;
        let row = row.ok_or_else(|| Problem::not_found("model", name))?;
        let read = self.read(row.document).await?;
        Ok(read.map_err(Problem::of_document)?.model)
    }

    /// Reads a document beside the threads that serve.
    pub(super) async fn read(&self, document: Value) -> Answer<Result<Referenced, Vec<Fault>>> {
        self.work
            .convert(move || Ok(document::referenced(&document)))
            .await
    }

    /// Finds the model that a document names by reference or brings along.
    pub(super) async fn asked(&self, document: &Value, client: &Client) -> Answer<Asked> {
        let mut asked = Asked {
            model: None,
            new: None,
            document: document.clone(),
        };
        match document.get("model") {
            Some(Value::String(name))
                if self.catalogue.get(name).is_none() && name.contains('@') =>
            {
                if let Some(row) = self.models.find(&client.project, name).await? {
                    let read = self.read(row.document).await?;
                    asked.model = Some(read.map_err(Problem::of_document)?.model);
                }
            }
            Some(inline @ Value::Object(_)) => {
                let read = self.read(inline.clone()).await?.map_err(|faults| {
                    let faults = faults.into_iter().map(|fault| fault.below("/model"));
                    Problem::of_document(faults.collect())
                })?;
                asked.document["model"] = Value::from(read.reference());
                asked.new = Some(new_model(&read, inline.clone(), client.clone()));
                asked.model = Some(read.model);
            }
            _ => {}
        }
        Ok(asked)
    }

    /// The model of a document that was asked for, by its name.
    pub(super) fn asked_model(&self, asked: &Asked, name: &str) -> Option<Arc<Model>> {
        let mut models = self.catalogue.iter().chain(&asked.model);
        let model = models.find(|model| model.description().name == name);
        model.cloned()
    }

    /// The descriptions that a document is read against.
    pub(super) fn descriptions<'a>(&'a self, asked: &'a Asked) -> Vec<&'a ModelDescription> {
        let models = self.catalogue.iter().chain(&asked.model);
        models.map(|model| model.description()).collect()
    }
}

/// A document that was read, to be stored.
pub(super) fn new_model(read: &Referenced, document: Value, client: Client) -> NewModel {
    NewModel {
        project: client.project,
        reference: read.reference().to_owned(),
        name: read.name.clone(),
        digest: read.digest.clone(),
        document,
        client: client.address,
    }
}
