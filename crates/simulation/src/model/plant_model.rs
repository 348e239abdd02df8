//! A model: the equations of a plant and their description.

use super::ModelDescription;
use super::specialised::Specialised;
use crate::Plant;
use crate::native::{Dynamics, Native};
use std::borrow::Cow;
use std::sync::Arc;

/// A model: its description and its equations.
pub struct Model {
    description: ModelDescription,
    plant: Arc<dyn Plant>,
    specialised: Specialised,
    document: Option<serde_json::Value>,
}

impl Model {
    /// Joins a description and the equations it describes.
    #[must_use]
    pub fn new(description: ModelDescription, dynamics: impl Dynamics) -> Model {
        let n_outputs = description.outputs.len();
        Model {
            description,
            plant: Arc::new(Native {
                dynamics,
                n_outputs,
            }),
            specialised: Specialised::default(),
            document: None,
        }
    }

    /// Joins a description and a plant of any kind.
    #[must_use]
    pub fn of_plant(description: ModelDescription, plant: impl Plant + 'static) -> Model {
        Model {
            description,
            plant: Arc::new(plant),
            specialised: Specialised::default(),
            document: None,
        }
    }

    /// The model with the document that it was read from.
    #[must_use]
    pub fn with_document(mut self, document: serde_json::Value) -> Model {
        self.document = Some(document);
        self
    }

    /// The model under another name.
    #[must_use]
    pub fn renamed(mut self, name: String) -> Model {
        self.description.name = Cow::Owned(name);
        self
    }

    /// The document that the model was read from, where it is one of the catalogue.
    #[must_use]
    pub fn document(&self) -> Option<&serde_json::Value> {
        self.document.as_ref()
    }

    /// What the model says of itself.
    #[must_use]
    pub fn description(&self) -> &ModelDescription {
        &self.description
    }

    /// The equations, ready for simulation.
    #[must_use]
    pub fn plant(&self) -> &dyn Plant {
        self.plant.as_ref()
    }

    /// The equations for candidates that have these parameters in common, SI.
    #[must_use]
    pub fn plant_with(&self, fixed: &[Option<f64>]) -> Arc<dyn Plant> {
        self.specialised.get(&self.plant, fixed)
    }
}

impl std::fmt::Debug for Model {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Model")
            .field("name", &self.description.name)
            .finish()
    }
}
