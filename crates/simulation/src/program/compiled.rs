//! The lists of a program, the registers that drive them and their derivatives: what a row of
//! candidates runs.

use super::instruction::Register;
use super::lists::Lists;
use super::tangents::Tangents;
use crate::language::graph::Leaf;

/// What every row of candidates shares.
#[derive(Debug)]
pub struct CompiledProgram {
    /// The equations as straight lists of instructions.
    pub lists: Lists,
    /// The registers of what comes from outside.
    pub wiring: Wiring,
    /// The derivatives of the rates.
    pub tangents: Tangents,
    /// The derivatives of the outputs.
    pub output_tangents: Tangents,
    /// The derivatives of what is computed once a sample.
    pub sampled_tangents: Tangents,
    /// What an error of each state is measured against at least.
    pub sizes: Vec<f64>,
    /// Whether inputs move in straight lines from sample to sample.
    pub moving_inputs: bool,
}

impl CompiledProgram {
    /// A program of these lists whose states have no sizes yet.
    pub fn new(lists: Lists, n_parameters: usize, moving_inputs: bool) -> CompiledProgram {
        let wiring = Wiring::new(&lists, n_parameters);
        let (states, inputs) = (&wiring.states, &wiring.inputs);
        CompiledProgram {
            tangents: Tangents::new(lists.differentiated_rates(), states, inputs),
            output_tangents: Tangents::new(lists.differentiated_outputs(), states, inputs),
            sampled_tangents: Tangents::new(lists.differentiated_sampled(), states, inputs),
            lists,
            wiring,
            sizes: Vec::new(),
            moving_inputs,
        }
    }
}

/// The registers of what comes from outside, where the equations use it.
#[derive(Debug, Default)]
pub struct Wiring {
    pub parameters: Vec<Option<Register>>,
    pub sample_time: Option<Register>,
    pub recorded: Vec<Option<Register>>,
    pub previous: Vec<Option<Register>>,
    pub inputs: Vec<Option<Register>>,
    pub sampled: Vec<Option<Register>>,
    pub states: Vec<Option<Register>>,
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
