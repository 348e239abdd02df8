//! The graph as straight lists of instructions over registers, one list for each occasion.
//!
//! A register holds a row of candidates, so that one instruction works on all of a block. What
//! depends on the parameters alone is computed once a candidate, what depends on held quantities
//! once a sample, and only the rest with every derivative.

use super::instruction::{Instruction, Register, Registers, zeros};
use super::joined::Joined;
use super::rewrite::{Dependence, EquationGraph, Roots, levels};
use super::tangents::Differentiated;
use crate::language::graph::{GraphNode, Leaf};
use crate::language::operation::LookupTable;
use greybox_numerics::lanes::Real;
use greybox_numerics::width::{Wide, Width};

/// A list of instructions, one after the other and joined.
#[derive(Debug, Default)]
pub struct List {
    instructions: Vec<Instruction>,
    joined: Joined,
}

impl List {
    /// The instructions of the list, in an order of computation.
    #[must_use]
    pub fn instructions(&self) -> &[Instruction] {
        &self.instructions
    }
}

/// What follows from the roots: registers and lists of instructions.
#[derive(Debug)]
pub struct Lists {
    constants: Vec<(Register, f64)>,
    leaves: Vec<(Leaf, Register)>,
    tables: Vec<LookupTable>,
    /// What follows from the parameters, once a candidate.
    pub setup: List,
    /// What is computed once a sample.
    pub sample: List,
    /// What follows from the held quantities, once they change.
    pub held: List,
    /// The rates of change.
    pub rates: List,
    /// The outputs.
    pub output: List,
    /// The roots, as registers.
    pub roots: Roots,
    /// The registers of the sampled quantities.
    sampled: Vec<Register>,
}

impl Lists {
    /// Lays equations out. With `moving_inputs` the inputs change between the samples.
    #[must_use]
    pub fn new(equations: &EquationGraph, tables: Vec<LookupTable>, moving_inputs: bool) -> Lists {
        let EquationGraph { graph, roots } = equations;
        let levels = levels(graph, moving_inputs);
        let from_rates = graph.needed(roots.rates.iter().copied());
        let from_output = graph.needed(roots.outputs.iter().chain(&roots.valid).copied());
        let from_sample = graph.needed(roots.sampled.iter().map(|(node, _)| *node));
        let before = roots.sampled.iter().filter_map(|(_, initial)| *initial);
        let once = roots.delay.iter().chain(&roots.fastest_rate).copied();
        let from_setup = graph.needed(roots.initial.iter().copied().chain(before).chain(once));
        let is_needed = |node: usize| {
            let from_plant = from_rates[node] || from_output[node];
            from_plant || from_sample[node] || from_setup[node]
        };
        let mut registers = vec![0; graph.nodes().len()];
        let mut lists = Lists {
            constants: Vec::new(),
            leaves: Vec::new(),
            tables,
            setup: List::default(),
            sample: List::default(),
            held: List::default(),
            rates: List::default(),
            output: List::default(),
            roots: Roots::default(),
            sampled: Vec::new(),
        };
        let needed = (0..graph.nodes().len()).filter(|node| is_needed(*node));
        for (register, node) in (0..).zip(needed) {
            let kind = &graph.nodes()[node];
            registers[node] = register;
            let (operation, on) = match kind {
                GraphNode::Constant(value) => {
                    lists.constants.push((register, *value));
                    continue;
                }
                GraphNode::Leaf(leaf) => {
                    lists.leaves.push((*leaf, register));
                    continue;
                }
                GraphNode::Compute(operation, on) => (*operation, on),
            };
            let instruction = Instruction {
                operation,
                to: register,
                on: on.map(|node| registers[usize::from(node)]),
            };
            match levels[node] {
                Dependence::Setup => lists.setup.instructions.push(instruction),
                Dependence::Held if from_rates[node] || from_output[node] => {
                    lists.held.instructions.push(instruction);
                }
                _ => {}
            }
            if from_sample[node] && levels[node] != Dependence::Setup {
                lists.sample.instructions.push(instruction);
            }
            if from_rates[node] && levels[node] == Dependence::Moving {
                lists.rates.instructions.push(instruction);
            }
            if from_output[node] && levels[node] == Dependence::Moving {
                lists.output.instructions.push(instruction);
            }
        }
        lists.roots = roots.renamed(&registers);
        let sampled = lists.roots.sampled.iter().map(|(register, _)| *register);
        lists.sampled = sampled.collect();
        lists.join();
        lists
    }

    /// Fresh registers with the constants in place.
    #[must_use]
    pub fn registers<R: Real>(&self) -> Registers<R> {
        let mut registers = zeros();
        for (register, value) in &self.constants {
            registers[usize::from(*register)] = R::splat(*value);
        }
        registers
    }

    /// The registers of the leaves.
    #[must_use]
    pub fn leaves(&self) -> &[(Leaf, Register)] {
        &self.leaves
    }

    fn join(&mut self) {
        let lists = [
            &mut self.setup,
            &mut self.sample,
            &mut self.held,
            &mut self.output,
        ];
        for list in lists {
            list.joined = Joined::all(&list.instructions);
        }
        let wanted = self.roots.rates.iter().copied();
        self.rates.joined = Joined::new(&self.rates.instructions, wanted);
    }

    /// Runs a list of instructions over a row. After the rates only the roots are sure to be in
    /// their registers.
    pub fn run<R: Real>(&self, list: &List, registers: &mut Registers<R>, width: Width) {
        width.does(OneList {
            tables: &self.tables,
            list,
            registers,
        });
    }

    /// The rates, for their derivatives.
    #[must_use]
    pub fn differentiated_rates(&self) -> Differentiated<'_> {
        Differentiated {
            instructions: self.rates.instructions(),
            roots: &self.roots.rates,
        }
    }

    /// The outputs, for their derivatives.
    #[must_use]
    pub fn differentiated_outputs(&self) -> Differentiated<'_> {
        Differentiated {
            instructions: self.output.instructions(),
            roots: &self.roots.outputs,
        }
    }

    /// The quantities that are computed once a sample, for their derivatives.
    #[must_use]
    pub fn differentiated_sampled(&self) -> Differentiated<'_> {
        Differentiated {
            instructions: self.sample.instructions(),
            roots: &self.sampled,
        }
    }

    /// The tables, by number.
    #[must_use]
    pub fn tables(&self) -> &[LookupTable] {
        &self.tables
    }
}

/// One list over one row.
struct OneList<'a, R> {
    tables: &'a [LookupTable],
    list: &'a List,
    registers: &'a mut Registers<R>,
}

impl<R: Real> Wide for OneList<'_, R> {
    type Output = ();
    #[inline(always)]
    fn work(self) {
        self.list.joined.run(self.registers, self.tables);
    }
}
