//! What the filter is asked, and where its numbers stand among the parameters.

use super::start::StartVariance;
use crate::program::{ControllerLayout, Disturbance, DisturbanceKind, RecordedQuantity};

/// What moves a plant beside its inputs, and how its record begins.
#[derive(Clone, Debug)]
pub struct FilterLayout {
    /// The disturbances.
    pub disturbances: Vec<Disturbance>,
    /// A typical size of each disturbance with memory, in the unit of what it acts on.
    pub sizes: Vec<f64>,
    /// How well each of the model's states is known at the first sample.
    pub starts: Vec<StartVariance>,
    /// The controller that the model computes from its states once a sample.
    pub controller: Option<ControllerLayout>,
    /// What the controller computes and a measured output shows: what was recorded has acted.
    pub recorded: Vec<RecordedQuantity>,
    /// How many inputs the model reads; the measured outputs stand behind them.
    pub n_inputs: usize,
    /// The longest step of the covariance `[s]`; the time between two samples is cut into steps
    /// that are not longer.
    pub longest_step: f64,
    /// Whether each sample is answered with all that a smoother needs of it.
    pub is_traced: bool,
}

/// Where the parameters of a disturbance stand.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoiseParameters {
    pub strength: usize,
    pub time_constant: Option<usize>,
}

impl FilterLayout {
    /// The first state of the controller: the states of the model and of the disturbances stand before it.
    pub(super) fn first_of_controller(&self) -> usize {
        self.starts.len() + self.disturbances.len()
    }

    /// Whether an output shows what acted: the output corrects nothing.
    pub(super) fn shows_what_acted(&self, output: usize) -> bool {
        self.recorded.iter().any(|shown| shown.output == output)
    }

    /// The number of all states.
    pub(super) fn n_states(&self) -> usize {
        let of_controller = self.controller.map_or(0, ControllerLayout::n_states);
        self.first_of_controller() + of_controller
    }

    /// Where the parameters of the disturbances stand, behind those of the model.
    pub(super) fn noise_parameters(&self, n_model_parameters: usize) -> Vec<NoiseParameters> {
        let mut next = n_model_parameters;
        let of_disturbance = |disturbance: &Disturbance| {
            let has_memory = disturbance.kind == DisturbanceKind::Memory;
            let noise = NoiseParameters {
                strength: next,
                time_constant: has_memory.then_some(next + 1),
            };
            next += 1 + usize::from(has_memory);
            noise
        };
        self.disturbances.iter().map(of_disturbance).collect()
    }

    /// Where the first standard deviation of a sensor stands.
    pub(super) fn first_sensor(&self, n_model_parameters: usize) -> usize {
        let noise = self.noise_parameters(n_model_parameters);
        let last = |noise: &NoiseParameters| noise.time_constant.unwrap_or(noise.strength);
        noise
            .last()
            .map_or(n_model_parameters, |noise| last(noise) + 1)
    }
}
