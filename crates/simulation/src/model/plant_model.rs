//! A model: the equations of a plant and their description.

use super::specialised::Specialised;
use super::{ModelDescription, ParameterDescription, SignalDescription};
use crate::Plant;
use crate::filter::{FilterLayout, FilteredPlant, LayoutFault};
use crate::native::{Dynamics, Native};
use crate::program::{ControllerLayout, Disturbance, Probes, Program, RecordedQuantity};
use std::borrow::Cow;
use std::sync::Arc;

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
        let plant = Native {
            dynamics,
            n_outputs,
        };
        Model::of_plant(description, Arc::new(plant))
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

    /// The states that a force, an inflow or a current moves, by their places; none where the equations are not
    /// those of a document.
    #[must_use]
    pub fn driven_states(&self) -> Vec<usize> {
        let program = self.program.as_ref();
        program.map_or_else(Vec::new, |program| program.driven_states())
    }

    /// The inputs that act on the plant, by their places, but for those that decide between cases; none where the
    /// equations are not those of a document.
    #[must_use]
    pub fn acting_inputs(&self) -> Vec<usize> {
        let program = self.program.as_ref();
        program.map_or_else(Vec::new, |program| program.acting_inputs())
    }

    /// The model with probes, whose parameters stand behind those of the model: a gain is 1 and everything else 0
    /// where nothing is said. Answers nothing for a model that is not a document.
    #[must_use]
    pub fn with_probes(&self, probes: &Probes) -> Option<Model> {
        let mut description = self.description.clone();
        let first = description.parameters.len();
        let program = self.program.as_ref()?.with_probes(probes, first)?;
        let mut probe = |name: String, unit: String, default: f64| {
            description.parameters.push(ParameterDescription {
                name: Cow::Owned(name),
                unit: Cow::Owned(unit),
                minimum: None,
                ..ParameterDescription::known(
                    "",
                    ["", "", "What the model takes as exact or leaves out."],
                    default,
                    [0.0, 1.0],
                )
            });
        };
        for input in &probes.inputs {
            let input = &self.description.inputs[*input];
            probe(format!("{}.input_gain", input.name), String::new(), 1.0);
            let unit = input.unit.to_string();
            probe(format!("{}.input_offset", input.name), unit, 0.0);
        }
        for loss in &probes.losses {
            let state = &self.description.states[loss.state];
            let unit = format!("{}/s", state.unit);
            for kind in ["constant_loss", "quadratic_loss"] {
                probe(format!("{}.{kind}", state.name), unit.clone(), 0.0);
            }
        }
        Some(Model::of_program(description, program))
    }

    /// The model whose outputs are these states, then their rates. Answers nothing for a model that is not a
    /// document.
    #[must_use]
    pub fn watching(&self, states: &[usize]) -> Option<Model> {
        let program = self.program.as_ref()?.watching(states)?;
        let mut description = self.description.clone();
        let states = || states.iter().map(|state| &self.description.states[*state]);
        let watched = |name: String, unit: String| SignalDescription {
            name: Cow::Owned(name),
            unit: Cow::Owned(unit),
            ..description.outputs[0].clone()
        };
        let values = states().map(|state| watched(state.name.to_string(), state.unit.to_string()));
        let rates = states().map(|state| {
            watched(
                format!("rate of {}", state.name),
                format!("{}/s", state.unit),
            )
        });
        description.outputs = values.chain(rates).collect();
        Some(Model::of_program(description, program))
    }

    /// The controller within the model, as the filter carries it where these disturbances move the plant.
    /// `sample_time` is that of the recording `[s]`;
    /// none where the samples are not evenly spaced.
    ///
    /// # Errors
    /// Where the filter cannot follow the controller.
    pub fn controller(
        &self,
        sample_time: Option<f64>,
        disturbances: &[Disturbance],
    ) -> Result<Option<ControllerLayout>, LayoutFault> {
        let program = self.program.as_ref();
        program.map_or(Ok(None), |program| {
            let controller = program.controller(sample_time, disturbances);
            controller.map_err(LayoutFault::Controller)
        })
    }

    /// For each output the state that it shows, by its place, where it shows nothing else; empty where the
    /// equations are not those of a document.
    #[must_use]
    pub fn shown_states(&self) -> Vec<Option<usize>> {
        let program = self.program.as_ref();
        program.map_or_else(Vec::new, |program| program.shown_states())
    }

    /// The outputs that show what a controller computes, and nothing else, where none of these parameters, by
    /// their places, decides what is computed.
    #[must_use]
    pub fn recorded_quantities(&self, unknown: &[usize]) -> Vec<RecordedQuantity> {
        let program = self.program.as_ref();
        program.map_or_else(Vec::new, |program| program.recorded_quantities(unknown))
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
