//! A plant as the filter sees it: from recorded inputs and measured outputs to what was expected of
//! each output.

use super::block::{FilterBlock, FilterEquations};
use super::layout::{FilterLayout, NoiseParameters};
use super::trace::TraceLayout;
use crate::program::{ControllerFault, Program};
use crate::{Accuracy, BlockSimulator, CandidateBlock, DrivingInputs, Plant};
use greybox_numerics::lanes::LANES;
use std::sync::Arc;

/// Why a plant cannot be filtered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayoutFault {
    /// The model is written in Rust: its equations cannot be extended.
    #[error("the model is built in, not a document: disturbances cannot be added to its equations")]
    NotADocument,
    /// The controller within the model cannot be followed.
    #[error("{0}")]
    Controller(ControllerFault),
    /// The equations with the disturbances have too many operations.
    #[error("the model has too many operations for its disturbances")]
    TooLarge,
}

/// A plant whose outputs are expectations. Its inputs are those of the model and behind them the
/// measured outputs, SI, where what is not a number was not measured. Its parameters are those of
/// the model, then for each disturbance the strength `[unit·√s]` (for white noise and walks that
/// of the rate's unit and of the quantity's unit per √s) and with memory the time constant `[s]`,
/// then the standard deviation of each output's sensor. Its outputs are the model's as they are
/// expected from all samples before, then for each of them the variance of its error; where the
/// filter is traced, what a smoother needs stands behind them.
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
        let noise = layout.noise_parameters(n_model_parameters);
        let time_constant = |noise: &NoiseParameters| noise.time_constant;
        let time_constants: Vec<Option<usize>> = noise.iter().map(time_constant).collect();
        let program = program
            .disturbed(
                &layout.disturbances,
                &time_constants,
                &layout.sizes,
                layout.controller,
            )
            .ok_or(LayoutFault::TooLarge)?;
        Ok(FilteredPlant {
            program,
            layout: layout.clone(),
            n_model_parameters,
        })
    }
}

impl Plant for FilteredPlant {
    fn n_outputs(&self) -> usize {
        let n_outputs = self.program.n_outputs();
        if !self.layout.is_traced {
            return 2 * n_outputs;
        }
        let trace = TraceLayout {
            n_states: self.layout.n_states(),
            n_outputs,
        };
        trace.n_columns()
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
        let equations = FilterEquations {
            program: &self.program,
            layout: &self.layout,
            n_model_parameters: self.n_model_parameters,
        };
        Box::new(FilterBlock::new(equations, excitation, candidates))
    }
}
