//! A plant as the filter sees it: from recorded inputs and measured outputs to what was expected of
//! each output.

use super::block::FilterBlock;
use super::start::StartVariance;
use crate::program::{Disturbance, DisturbanceKind, Program};
use crate::{Accuracy, BlockSimulator, CandidateBlock, DrivingInputs, Plant};
use greybox_numerics::lanes::LANES;
use std::sync::Arc;

/// What moves a plant beside its inputs, and how its record begins.
#[derive(Clone, Debug)]
pub struct FilterLayout {
    /// The disturbances.
    pub disturbances: Vec<Disturbance>,
    /// A typical size of each disturbance with memory, in the unit of what it acts on.
    pub sizes: Vec<f64>,
    /// How well each of the model's states is known at the first sample.
    pub starts: Vec<StartVariance>,
    /// How many inputs the model reads; the measured outputs stand behind them.
    pub n_inputs: usize,
    /// The longest step of the covariance `[s]`; the time between two samples is cut into steps
    /// that are not longer.
    pub longest_step: f64,
}

/// Why a plant cannot be filtered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutFault {
    /// The model is written in Rust: its equations cannot be extended.
    #[error("the model is built in, not a document: disturbances cannot be added to its equations")]
    NotADocument,
    /// The model computes a controller from its states once a sample: the recorded command belongs
    /// in its place.
    #[error(
        "the model computes a controller from its states: drive it with the recorded command instead"
    )]
    ControllerWithin,
    /// The equations with the disturbances have too many operations.
    #[error("the model has too many operations for its disturbances")]
    TooLarge,
}

/// A plant whose outputs are expectations. Its inputs are those of the model and behind them the
/// measured outputs, SI, where what is not a number was not measured. Its parameters are those of
/// the model, then for each disturbance the strength `[unit·√s]` (for white noise and walks that
/// of the rate's unit and of the quantity's unit per √s) and with memory the time constant `[s]`,
/// then the standard deviation of each output's sensor. Its outputs are the model's as they are
/// expected from all samples before, then for each of them the variance of its error.
///
/// A disturbance with memory has the variance strength²/(2·time constant).
#[derive(Debug)]
pub struct FilteredPlant {
    program: Program,
    layout: FilterLayout,
    n_model_parameters: usize,
}

impl FilteredPlant {
    /// The filter of a model with so many parameters.
    ///
    /// # Errors
    /// Where the equations do not allow it.
    pub fn new(
        program: &Program,
        layout: &FilterLayout,
        n_model_parameters: usize,
    ) -> Result<FilteredPlant, LayoutFault> {
        if program.samples_its_states() {
            return Err(LayoutFault::ControllerWithin);
        }
        let noise = noise_parameters(&layout.disturbances, n_model_parameters);
        let time_constants: Vec<Option<usize>> =
            noise.iter().map(|noise| noise.time_constant).collect();
        let program = program
            .disturbed(&layout.disturbances, &time_constants, &layout.sizes)
            .ok_or(LayoutFault::TooLarge)?;
        Ok(FilteredPlant {
            program,
            layout: layout.clone(),
            n_model_parameters,
        })
    }

    /// Where the parameters of the disturbances stand.
    pub(super) fn noise_parameters(&self) -> Vec<NoiseParameters> {
        noise_parameters(&self.layout.disturbances, self.n_model_parameters)
    }

    /// Where the first standard deviation of a sensor stands among the parameters.
    pub(super) fn first_sensor(&self) -> usize {
        let of_disturbance = |noise: &NoiseParameters| noise.count();
        let noise = self.noise_parameters();
        self.n_model_parameters + noise.iter().map(of_disturbance).sum::<usize>()
    }

    /// The equations with the disturbances.
    pub(super) fn program(&self) -> &Program {
        &self.program
    }

    /// What moves the plant.
    pub(super) fn layout(&self) -> &FilterLayout {
        &self.layout
    }
}

/// Where the parameters of a disturbance stand.
#[derive(Clone, Copy, Debug)]
pub(super) struct NoiseParameters {
    pub strength: usize,
    pub time_constant: Option<usize>,
}

impl NoiseParameters {
    fn count(&self) -> usize {
        1 + usize::from(self.time_constant.is_some())
    }
}

fn noise_parameters(disturbances: &[Disturbance], first: usize) -> Vec<NoiseParameters> {
    let mut next = first;
    let of_disturbance = |disturbance: &Disturbance| {
        let has_memory = disturbance.kind == DisturbanceKind::Memory;
        let noise = NoiseParameters {
            strength: next,
            time_constant: has_memory.then_some(next + 1),
        };
        next += noise.count();
        noise
    };
    disturbances.iter().map(of_disturbance).collect()
}

impl Plant for FilteredPlant {
    fn n_outputs(&self) -> usize {
        2 * self.program.n_outputs()
    }

    fn work_rate(&self, parameters: &[f64]) -> f64 {
        self.program.work_rate(parameters)
    }

    fn specialised(&self, fixed: &[Option<f64>]) -> Option<Arc<dyn Plant>> {
        Some(Arc::new(FilteredPlant {
            program: self.program.with_fixed(fixed),
            layout: self.layout.clone(),
            n_model_parameters: self.n_model_parameters,
        }))
    }

    fn block_sizes(&self, _accuracy: Accuracy) -> &'static [usize] {
        &[LANES]
    }

    fn simulator<'a>(
        &'a self,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
    ) -> Box<dyn BlockSimulator + 'a> {
        Box::new(FilterBlock::new(self, excitation, candidates))
    }
}
