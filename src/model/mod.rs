//! What can be identified: the structure of a plant, its parameters, signals and equations.
//!
//! A model is one file (or folder) that implements [`Model`] and one line in [`catalogue`].

use serde::Serialize;
use utoipa::ToSchema;

/// How a parameter's range is laid out for the search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// Equal steps.
    #[default]
    Linear,
    /// Equal ratios; both bounds are positive.
    Log,
}

/// One physical parameter of a model.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ParameterDescription {
    /// The name in requests and results, e.g. `bulk_modulus`.
    pub name: &'static str,
    /// The symbol in the equations, e.g. `K_m`.
    pub symbol: &'static str,
    /// The SI unit, e.g. `Pa`; `1` where there is none.
    pub unit: &'static str,
    /// What it is, in one sentence.
    pub meaning: &'static str,
    /// The value when a job does not name it, SI.
    pub default: f64,
    /// The default search range, SI.
    pub lower: f64,
    /// The default search range, SI.
    pub upper: f64,
    /// How the default search range is laid out.
    pub scale: Scale,
    /// Whether a job that does not name it estimates it.
    pub unknown_by_default: bool,
    /// Values outside `[minimum, maximum]` are physically impossible and refused.
    pub minimum: f64,
    /// Values outside `[minimum, maximum]` are physically impossible and refused.
    #[schema(value_type = Option<f64>)]
    pub maximum: f64,
}

/// An input, a state or an output of a model.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct SignalDescription {
    /// The name in requests and results.
    pub name: &'static str,
    /// The SI unit.
    pub unit: &'static str,
    /// What it is, in one sentence.
    pub meaning: &'static str,
}

/// A model as the catalogue shows it.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ModelDescription {
    /// The name in requests, e.g. `single_rod_servo`.
    pub name: &'static str,
    /// The name for people.
    pub title: &'static str,
    /// What the model covers and what it leaves out.
    pub summary: &'static str,
    /// Input sets in the order of preference: a job drives the model by one set.
    pub input_sets: Vec<Vec<&'static str>>,
    /// All inputs.
    pub inputs: Vec<SignalDescription>,
    /// The states, in the order of integration. Each can be given an initial value by its name.
    pub states: Vec<SignalDescription>,
    /// The outputs that can be measured.
    pub outputs: Vec<SignalDescription>,
    /// The parameters.
    pub parameters: Vec<ParameterDescription>,
    /// The equations, a line each.
    pub equations: Vec<&'static str>,
    /// Where the equations come from.
    pub source: &'static str,
}
