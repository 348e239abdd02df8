//! Plants whose equations are a document's: checked equations as instructions over registers.
//!
//! `rewrite` makes the graph of the equations shorter, `lists` lays it out as straight lists of
//! instructions, `joined` makes few of many, `tangents` takes their derivatives, `row` is what the
//! integrator drives, and `disturbed` adds the states of quantities that wander. No code is made at run time; every size is bounded.

mod disturbed;
mod instruction;
mod joined;
mod lists;
mod rewrite;
mod row;
mod tangents;

pub use disturbed::{ActsOn, Disturbance, DisturbanceKind};
pub use rewrite::{EquationGraph, Roots};

use super::block::SimulationBlock;
use super::equations::{Equations, HeldQuantities, System};
use super::{BlockSimulator, CandidateBlock, DrivingInputs, Plant};
use crate::language::graph::Leaf;
use crate::language::operation::LookupTable;
use greybox_numerics::eigenvalues::spectral_radius;
use greybox_numerics::lanes::{LANES, Real};
use greybox_numerics::width::Width;
use instruction::Register;
use lists::Lists;
use row::ProgramRow;
use std::sync::Arc;
use tangents::Tangents;

/// The size that errors of a state are measured against at least, as a share of where the state
/// starts at the default parameters (of 1 where it starts at 0), where the document does not give
/// a size. What is smaller counts as rounding.
const LEAST_SHARE: f64 = 1e-9;

/// The equations, ready to run.
#[derive(Debug)]
pub struct Program {
    /// With nothing fixed.
    equations: EquationGraph,
    lists: Lists,
    wiring: Wiring,
    tangents: Tangents,
    output_tangents: Tangents,
    /// What an error of each state is measured against at least.
    sizes: Vec<f64>,
    /// Whether inputs move in straight lines from sample to sample.
    moving_inputs: bool,
}

/// The registers of what comes from outside, where the equations use it.
#[derive(Debug, Default)]
struct Wiring {
    parameters: Vec<Option<Register>>,
    sample_time: Option<Register>,
    recorded: Vec<Option<Register>>,
    previous: Vec<Option<Register>>,
    inputs: Vec<Option<Register>>,
    sampled: Vec<Option<Register>>,
    states: Vec<Option<Register>>,
}

impl Wiring {
    fn new(lists: &Lists, n_parameters: usize) -> Wiring {
        let mut wiring = Wiring {
            parameters: vec![None; n_parameters],
            previous: vec![None; lists.roots.sampled.len()],
            sampled: vec![None; lists.roots.sampled.len()],
            states: vec![None; lists.roots.rates.len()],
            ..Wiring::default()
        };
        for (leaf, register) in lists.leaves() {
            match leaf {
                Leaf::SampleTime => wiring.sample_time = Some(*register),
                Leaf::Parameter(index) => put(&mut wiring.parameters, *index, *register),
                Leaf::Recorded(index) => put(&mut wiring.recorded, *index, *register),
                Leaf::Previous(index) => put(&mut wiring.previous, *index, *register),
                Leaf::Input(index) => put(&mut wiring.inputs, *index, *register),
                Leaf::Sampled(index) => put(&mut wiring.sampled, *index, *register),
                Leaf::State(index) => put(&mut wiring.states, *index, *register),
            }
        }
        wiring
    }
}

fn put(places: &mut Vec<Option<Register>>, index: u16, register: Register) {
    let index = usize::from(index);
    if places.len() <= index {
        places.resize(index + 1, None);
    }
    places[index] = Some(register);
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
        let mut program = Program::of_equations(equations, tables, defaults.len(), moving_inputs);
        let starts = program.row(defaults, 1.0).initial_states();
        let start_size = |start: &f64| {
            let size = start.abs();
            let is_size = size > 0.0 && size.is_finite();
            LEAST_SHARE * if is_size { size } else { 1.0 }
        };
        let sizes = sizes.iter().zip(&starts);
        program.sizes = sizes
            .map(|(given, start)| given.unwrap_or_else(|| start_size(start)))
            .collect();
        program
    }

    /// The equations with nothing fixed, before the sizes of their states are told.
    fn of_equations(
        equations: EquationGraph,
        tables: Vec<LookupTable>,
        n_parameters: usize,
        moving_inputs: bool,
    ) -> Program {
        let lists = Lists::new(&equations.with_fixed(&[]), tables, moving_inputs);
        Program::of_lists(equations, lists, n_parameters, moving_inputs)
    }

    /// The program for candidates that have these parameters in common.
    #[must_use]
    pub fn with_fixed(&self, fixed: &[Option<f64>]) -> Program {
        let left = self.equations.with_fixed(fixed);
        let lists = Lists::new(&left, self.lists.tables().to_vec(), self.moving_inputs);
        let equations = self.equations.clone();
        let n_parameters = self.wiring.parameters.len();
        let program = Program::of_lists(equations, lists, n_parameters, self.moving_inputs);
        Program {
            sizes: self.sizes.clone(),
            ..program
        }
    }

    fn of_lists(
        equations: EquationGraph,
        lists: Lists,
        n_parameters: usize,
        moving_inputs: bool,
    ) -> Program {
        let wiring = Wiring::new(&lists, n_parameters);
        let (states, inputs) = (&wiring.states, &wiring.inputs);
        let tangents = Tangents::new(lists.differentiated_rates(), states, inputs);
        let output_tangents = Tangents::new(lists.differentiated_outputs(), states, inputs);
        Program {
            equations,
            lists,
            wiring,
            tangents,
            output_tangents,
            sizes: Vec::new(),
            moving_inputs,
        }
    }
}

impl System for Program {
    const HAS_SMALL_BLOCKS: bool = false;
    type Row<'a, R: Real> = ProgramRow<'a, R>;

    fn row<R: Real>(&self, parameters: &[R], sample_time: f64) -> ProgramRow<'_, R> {
        ProgramRow::new(self, parameters, sample_time)
    }
}

impl Plant for Program {
    fn n_outputs(&self) -> usize {
        self.lists.roots.outputs.len()
    }

    /// What the document hints at.
    fn work_rate(&self, parameters: &[f64]) -> f64 {
        if self.lists.roots.fastest_rate.is_none() {
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

    fn specialised(&self, fixed: &[Option<f64>]) -> Option<Arc<dyn Plant>> {
        Some(Arc::new(self.with_fixed(fixed)))
    }

    fn simulator<'a>(
        &'a self,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
    ) -> Box<dyn BlockSimulator + 'a> {
        let width = Width::widest();
        Box::new(SimulationBlock::<_, f64, LANES>::new(
            self, excitation, candidates, width,
        ))
    }
}
