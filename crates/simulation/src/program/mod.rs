//! Plants whose equations are a document's: checked equations as instructions over registers.
//!
//! `rewrite` makes the graph of the equations shorter, `lists` lays it out as straight lists of
//! instructions, `joined` makes few of many, `tangents` takes their derivatives, `row` is what the
//! integrator drives, and `disturbed` adds the states of quantities that wander. No code is made at run time; every size is bounded.

mod compiled;
mod controller;
mod disturbed;
mod instruction;
mod joined;
mod lists;
mod probed;
mod rewrite;
mod row;
mod tangents;

pub use controller::{ControllerFault, ControllerLayout, RecordedQuantity};
pub use disturbed::{ActsOn, Disturbance, DisturbanceKind};
pub use probed::{Losses, Probes};
pub use rewrite::{EquationGraph, Roots};

use super::batch::WINDOW_SAMPLES;
use super::block::SimulationBlock;
use super::equations::{Equations, HeldQuantities, System};
use super::free_block::FreeBlock;
use super::input_delay::SAME;
use super::{BlockSimulator, CandidateBlock, DrivingInputs, Plant};
use crate::language::operation::LookupTable;
use compiled::CompiledProgram;
use controller::LONGEST_DELAY;
use greybox_numerics::eigenvalues::spectral_radius;
use greybox_numerics::lanes::{LANES, Real};
use greybox_numerics::width::Width;
use lists::Lists;
use row::ProgramRow;
use std::sync::Arc;

/// The size that errors of a state are measured against at least, as a share of where the state
/// starts at the default parameters (of 1 where it starts at 0), where the document does not give
/// a size. What is smaller counts as rounding.
const LEAST_SHARE: f64 = 1e-9;

/// The equations, ready to run.
#[derive(Debug)]
pub struct Program {
    /// With nothing fixed.
    equations: EquationGraph,
    compiled: CompiledProgram,
}

impl Program {
    /// From the equations, their tables and, for each state, the size that its author gave.
    /// `defaults` are the parameters where nothing else is said.
    #[must_use]
    pub fn new(
        equations: &EquationGraph,
        tables: Vec<LookupTable>,
        sizes: &[Option<f64>],
        defaults: &[f64],
        moving_inputs: bool,
    ) -> Program {
        let equations = equations.with_reciprocals(moving_inputs);
        let lists = Lists::new(&equations.with_fixed(&[]), tables, moving_inputs);
        let mut program = Program {
            compiled: CompiledProgram::new(lists, defaults.len(), moving_inputs),
            equations,
        };
        let starts = program.row(defaults, 1.0).initial_states();
        let start_size = |start: &f64| {
            let size = start.abs();
            let is_size = size > 0.0 && size.is_finite();
            LEAST_SHARE * if is_size { size } else { 1.0 }
        };
        let sizes = sizes.iter().zip(&starts);
        program.compiled.sizes = sizes
            .map(|(given, start)| given.unwrap_or_else(|| start_size(start)))
            .collect();
        program
    }

    /// The program with a state more for each disturbance, in their order behind the model's
    /// states, and behind these the states of the controller. A disturbance with memory τ decays by
    /// −d/τ, where τ is the parameter `time_constants[disturbance]`; white noise has a state that stays 0, through which the
    /// Jacobian says what the noise drives. `sizes` are typical sizes of the disturbances, in
    /// their units. Answers nothing where the equations would have too many nodes.
    #[must_use]
    pub fn disturbed(
        &self,
        disturbances: &[Disturbance],
        time_constants: &[Option<usize>],
        sizes: &[f64],
        controller: Option<ControllerLayout>,
    ) -> Option<Program> {
        let equations = self
            .equations
            .disturbed(disturbances, time_constants, controller)
            .ok()?;
        let last = time_constants.iter().flatten().max();
        // What stands still has no error to be measured.
        let of_controller = controller.map_or(0, ControllerLayout::n_states);
        let sizes = [sizes, &vec![1.0; of_controller]].concat();
        Some(self.with_equations(equations, last.map_or(0, |last| last + 1), &sizes))
    }

    /// The program with probes, whose parameters stand from `first_parameter` on. Answers nothing where the
    /// equations would have too many nodes.
    #[must_use]
    pub fn with_probes(&self, probes: &Probes, first_parameter: usize) -> Option<Program> {
        let equations = self.equations.with_probes(probes, first_parameter).ok()?;
        let n_probes = 2 * (probes.inputs.len() + probes.losses.len());
        Some(self.with_equations(equations, first_parameter + n_probes, &[]))
    }

    /// The inputs that act on the plant, by their places, but for those that decide between cases.
    #[must_use]
    pub fn acting_inputs(&self) -> Vec<usize> {
        self.equations.acting_inputs()
    }

    /// The program whose outputs are these states, then their rates. Answers nothing where the equations
    /// would have too many nodes.
    #[must_use]
    pub fn watching(&self, states: &[usize]) -> Option<Program> {
        let equations = self.equations.watching(states).ok()?;
        Some(self.with_equations(equations, 0, &[]))
    }

    /// The program with other equations, of so many parameters at the least, whose further states have these
    /// typical sizes.
    fn with_equations(
        &self,
        equations: EquationGraph,
        n_parameters: usize,
        sizes: &[f64],
    ) -> Program {
        let whole = &self.compiled;
        let n_parameters = n_parameters.max(whole.wiring.parameters.len());
        let tables = whole.lists.tables().to_vec();
        let lists = Lists::new(&equations.with_fixed(&[]), tables, whole.moving_inputs);
        Program {
            equations,
            compiled: CompiledProgram {
                sizes: whole.sizes.iter().chain(sizes).copied().collect(),
                ..CompiledProgram::new(lists, n_parameters, whole.moving_inputs)
            },
        }
    }

    /// The controller within the model: what is computed once a sample and reads a state, or is disturbed.
    /// `sample_time` is that of the recording `[s]`; none where the samples are not evenly spaced.
    ///
    /// # Errors
    /// Where the filter cannot follow the controller.
    pub fn controller(
        &self,
        sample_time: Option<f64>,
        disturbances: &[Disturbance],
    ) -> Result<Option<ControllerLayout>, ControllerFault> {
        let is_computed =
            |disturbance: &&Disturbance| matches!(disturbance.acts_on, ActsOn::Sampled(_));
        let mut disturbed = disturbances.iter().filter(is_computed).peekable();
        if !self.equations.samples_its_states() && disturbed.peek().is_none() {
            return Ok(None);
        }
        if !self.equations.has_constant_delay() {
            return Err(ControllerFault::UnknownDelay);
        }
        let CompiledProgram { lists, wiring, .. } = &self.compiled;
        let interval = sample_time.unwrap_or(1.0);
        let row = self.row(&vec![0.0; wiring.parameters.len()], interval);
        let delay = row.input_delay().unwrap_or(0.0) / interval;
        // A delay that differs from whole samples by rounding alone is one of whole samples.
        let delay = (delay - SAME).ceil().max(0.0);
        if delay > LONGEST_DELAY as f64 {
            return Err(ControllerFault::LongDelay);
        }
        if delay == 0.0 && disturbed.any(|noise| noise.kind == DisturbanceKind::White) {
            return Err(ControllerFault::WhiteAtOnce);
        }
        if delay > 0.0 && sample_time.is_none() {
            return Err(ControllerFault::UnevenSamples);
        }
        Ok(Some(ControllerLayout {
            n_quantities: lists.roots.sampled.len(),
            delay: delay as usize,
        }))
    }

    /// For each output the state that it shows, by its place, where it shows nothing else.
    #[must_use]
    pub fn shown_states(&self) -> Vec<Option<usize>> {
        self.equations.shown_states()
    }

    /// The outputs that show what a controller computes once a sample, and nothing else, where none of these
    /// parameters decides what is computed.
    #[must_use]
    pub fn recorded_quantities(&self, unknown: &[usize]) -> Vec<RecordedQuantity> {
        if !self.equations.samples_its_states() {
            return Vec::new();
        }
        let is_known = |shown: &RecordedQuantity| {
            let mut unknown = unknown.iter();
            !unknown.any(|parameter| self.equations.computes_from(shown.quantity, *parameter))
        };
        let mut shown = self.equations.recorded_quantities();
        shown.retain(is_known);
        shown
    }

    /// The states that a force, an inflow or a current moves, by their places: those whose rate reads an input,
    /// and those that are the rate of another state.
    #[must_use]
    pub fn driven_states(&self) -> Vec<usize> {
        self.equations.driven_states()
    }

    /// The program for candidates that have these parameters in common.
    #[must_use]
    pub fn with_fixed(&self, fixed: &[Option<f64>]) -> Program {
        let left = self.equations.with_fixed(fixed);
        let whole = &self.compiled;
        let lists = Lists::new(&left, whole.lists.tables().to_vec(), whole.moving_inputs);
        let n_parameters = whole.wiring.parameters.len();
        Program {
            equations: self.equations.clone(),
            compiled: CompiledProgram {
                sizes: whole.sizes.clone(),
                ..CompiledProgram::new(lists, n_parameters, whole.moving_inputs)
            },
        }
    }
}

impl System for Program {
    const HAS_SMALL_BLOCKS: bool = false;
    type Row<'a, R: Real> = ProgramRow<'a, R>;

    fn row<R: Real>(&self, parameters: &[R], sample_time: f64) -> ProgramRow<'_, R> {
        ProgramRow::new(&self.compiled, parameters, sample_time)
    }
}

impl Plant for Program {
    fn n_outputs(&self) -> usize {
        self.compiled.lists.roots.outputs.len()
    }

    /// What the document hints at.
    fn work_rate(&self, parameters: &[f64]) -> f64 {
        if self.compiled.lists.roots.fastest_rate.is_none() {
            return 0.0;
        }
        let rate = self.row(parameters, 1.0).rate_hint();
        if rate.is_finite() { rate } else { 0.0 }
    }

    /// What the document hints at, or the largest eigenvalue of its Jacobian.
    fn fastest_rate(&self, parameters: &[f64]) -> f64 {
        let hint = self.work_rate(parameters);
        if hint > 0.0 {
            return hint;
        }
        let mut row = self.row(parameters, 1.0);
        row.act(&HeldQuantities {
            values: vec![0.0; row.n_held()],
            slopes: Vec::new(),
        });
        let states: Vec<f64> = row.initial_states();
        let mut matrix = vec![0.0; states.len() * states.len()];
        row.jacobian(&states, 0.0, &states, &mut matrix);
        spectral_radius(states.len(), &matrix)
    }

    fn runs_freely(&self, samples: usize) -> bool {
        let wiring = &self.compiled.wiring;
        let is_undisturbed = wiring.inputs.is_empty() && wiring.sampled.is_empty();
        let is_delayed = self.compiled.lists.roots.delay.is_some();
        is_undisturbed && !is_delayed && samples <= WINDOW_SAMPLES
    }

    fn specialised(&self, fixed: &[Option<f64>]) -> Option<Arc<dyn Plant>> {
        Some(Arc::new(self.with_fixed(fixed)))
    }

    fn simulator<'a>(
        &'a self,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
    ) -> Box<dyn BlockSimulator + 'a> {
        let width = Width::widest();
        if self.runs_freely(excitation.samples) && !candidates.in_step {
            let members = candidates.members;
            return Box::new(FreeBlock::new(self, excitation, members, width));
        }
        Box::new(SimulationBlock::<_, f64, LANES>::new(
            self, excitation, candidates, width,
        ))
    }
}
