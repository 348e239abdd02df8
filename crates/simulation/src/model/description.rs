//! What the catalogue shows of a model.

use super::{ParameterDescription, SignalDescription, StateDescription};
use serde::Serialize;
use std::borrow::Cow;
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
    /// What the model computes once a sample, as a controller does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub sampled: Vec<SignalDescription>,
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

    /// The place of a quantity that is computed once a sample.
    #[must_use]
    pub fn sampled_index(&self, name: &str) -> Option<usize> {
        self.sampled
            .iter()
            .position(|quantity| quantity.name == name)
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
