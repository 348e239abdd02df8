//! What can be identified: the structure of a plant, its parameters, signals and equations.
//!
//! A model is one file (or folder) with its equations ([`Dynamics`]) and its description, or a
//! document with its equations as text ([`document`]), and one line in [`Catalogue::built_in`].

mod catalogue;
mod lookup;
mod parameter;
mod specialised;
mod tolerance;

pub mod document;
pub mod positioning_drive;
pub mod single_rod_servo;

pub use catalogue::Catalogue;
pub use parameter::{
    InitialState, ParameterDescription, Scale, SignalDescription, StateDescription,
};
pub use tolerance::{Tolerance, ToleranceText};

use crate::Plant;
use crate::filter::{FilterLayout, FilteredPlant, LayoutFault};
use crate::native::{Dynamics, Native};
use crate::program::Program;
use serde::Serialize;
use specialised::Specialised;
use std::borrow::Cow;
use std::sync::Arc;
use utoipa::ToSchema;

/// A model as the catalogue shows it.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ModelDescription {
    /// The name in requests, e.g. `single_rod_servo`.
    #[schema(value_type = String)]
    pub name: Cow<'static, str>,
    /// The name for people.
    #[schema(value_type = String)]
    pub title: Cow<'static, str>,
    /// What the model covers and what it leaves out.
    #[schema(value_type = String)]
    pub summary: Cow<'static, str>,
    /// The inputs.
    pub inputs: Vec<SignalDescription>,
    /// Sets of inputs that can drive the model, preferred ones first; a job uses one set.
    #[schema(value_type = Vec<Vec<String>>)]
    pub input_sets: Vec<Vec<Cow<'static, str>>>,
    /// The states, in the order of integration.
    pub states: Vec<StateDescription>,
    /// The outputs that can be measured.
    pub outputs: Vec<SignalDescription>,
    /// The parameters.
    pub parameters: Vec<ParameterDescription>,
    /// The equations, a line each.
    #[schema(value_type = Vec<String>)]
    pub equations: Vec<Cow<'static, str>>,
    /// Where the equations come from.
    #[schema(value_type = String)]
    pub source: Cow<'static, str>,
}

impl ModelDescription {
    /// The place of a parameter.
    #[must_use]
    pub fn parameter_index(&self, name: &str) -> Option<usize> {
        self.parameters
            .iter()
            .position(|parameter| parameter.name == name)
    }

    /// The place of a state.
    #[must_use]
    pub fn state_index(&self, name: &str) -> Option<usize> {
        self.states.iter().position(|state| state.name == name)
    }

    /// The place of an output.
    #[must_use]
    pub fn output_index(&self, name: &str) -> Option<usize> {
        self.outputs.iter().position(|output| output.name == name)
    }

    /// A value for each parameter when a job names none, SI.
    #[must_use]
    pub fn defaults(&self) -> Vec<f64> {
        self.parameters
            .iter()
            .map(|parameter| parameter.default)
            .collect()
    }
}

/// A model: its description and its equations.
pub struct Model {
    description: ModelDescription,
    plant: Arc<dyn Plant>,
    /// The equations where they were written as text.
    program: Option<Arc<Program>>,
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
            program: None,
            specialised: Specialised::default(),
            document: None,
        }
    }

    /// Joins a description and the equations of a document.
    #[must_use]
    pub fn of_program(description: ModelDescription, program: Program) -> Model {
        let program = Arc::new(program);
        Model {
            program: Some(Arc::clone(&program)),
            ..Model::of_plant(description, program)
        }
    }

    /// Joins a description and a plant of any kind.
    #[must_use]
    pub fn of_plant(description: ModelDescription, plant: Arc<dyn Plant>) -> Model {
        Model {
            description,
            plant,
            program: None,
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

    /// The model as the filter sees it, where disturbances move its plant ([`FilteredPlant`]): the
    /// variance of each output's error stands behind the outputs of the model.
    ///
    /// # Errors
    /// Where the equations do not allow it.
    pub fn filtered(&self, layout: &FilterLayout) -> Result<Model, LayoutFault> {
        let program = self.program.as_ref().ok_or(LayoutFault::NotADocument)?;
        let n_parameters = self.description.parameters.len();
        let filtered = FilteredPlant::new(program, layout, n_parameters)?;
        let mut description = self.description.clone();
        let variances = self.description.outputs.iter().map(|output| {
            let name = Cow::Owned(format!("variance of {}", output.name));
            SignalDescription {
                name,
                ..output.clone()
            }
        });
        description.outputs.extend(variances);
        Ok(Model::of_plant(description, Arc::new(filtered)))
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
