//! The graph as straight lists of instructions over registers, one list for each occasion.
//!
//! A register holds one number, or a row of lanes: then one instruction works on all candidates
//! of a block. What depends on the parameters alone is computed once a candidate, what depends on
//! held quantities once a sample, and only the rest with every derivative.

use super::arithmetic::{self, Operation, Table};
use super::graph::{Graph, Leaf, MAX_NODES, Node, NodeId};
use super::program::Program;
use crate::simulation::lanes::{LANES, Lanes, Real};
use crate::simulation::width::{self, Wide};

/// One number, or one row of lanes, for each node that a graph can have: a fixed size, so that an
/// instruction finds its registers without a check.
pub type Registers<R> = Box<[R; MAX_NODES]>;

/// Registers that hold 0.
pub fn zeros<R: Real>() -> Registers<R> {
    let zeros = vec![R::splat(0.0); MAX_NODES].into_boxed_slice();
    zeros
        .try_into()
        .unwrap_or_else(|_| unreachable!("the vector was made of this length"))
}

/// A register, by its place.
pub type Register = u16;

/// One step of a computation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruction {
    /// What it does.
    pub operation: Operation,
    /// Where the result goes.
    pub to: Register,
    /// What it works on; places that the operation does not use repeat the first.
    pub on: [Register; 3],
}

/// A list of instructions: one after the other for one candidate, and as a program for a row.
#[derive(Debug, Default)]
pub struct List {
    instructions: Vec<Instruction>,
    program: Program,
}

impl List {
    /// How many instructions it has.
    #[must_use]
    pub fn len(&self) -> usize {
        self.instructions.len()
    }
}

/// What the equations are made of, as nodes of a graph.
#[derive(Clone, Debug, Default)]
pub struct Roots {
    /// The rates of change of the states.
    pub rates: Vec<NodeId>,
    /// What changes its sign at a kink of the rates.
    pub switches: Vec<NodeId>,
    /// The outputs.
    pub outputs: Vec<NodeId>,
    /// Where the states start.
    pub initial: Vec<NodeId>,
    /// The sampled quantities, and what each was before the first sample.
    pub sampled: Vec<(NodeId, Option<NodeId>)>,
    /// The delay.
    pub delay: Option<NodeId>,
    /// The fastest rate that a step must resolve.
    pub fastest_rate: Option<NodeId>,
    /// Whether the equations hold.
    pub valid: Option<NodeId>,
}

/// What follows from the roots: registers and lists of instructions.
#[derive(Debug)]
pub struct Tape {
    constants: Vec<(Register, f64)>,
    leaves: Vec<(Leaf, Register)>,
    tables: Vec<Table>,
    /// What follows from the parameters, once a candidate.
    pub setup: List,
    /// What is computed once a sample.
    pub sample: List,
    /// What follows from the held quantities, once they change.
    pub held: List,
    /// The rates of change.
    pub rates: List,
    /// The switches, where the rates were computed last.
    pub switches: List,
    /// The outputs.
    pub output: List,
    /// The roots, as registers.
    pub roots: Roots,
}

/// What a node depends on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Level {
    Setup,
    Held,
    Moving,
}

impl Tape {
    /// Lays a graph out. With `moving_inputs` the inputs change between the samples.
    #[must_use]
    pub fn new(graph: &Graph, roots: &Roots, tables: Vec<Table>, moving_inputs: bool) -> Tape {
        let levels = levels(graph, moving_inputs);
        let from_rates = graph.needed(roots.rates.iter().copied());
        let from_switches = graph.needed(roots.switches.iter().copied());
        let from_output = graph.needed(roots.outputs.iter().chain(&roots.valid).copied());
        let from_sample = graph.needed(roots.sampled.iter().map(|(node, _)| *node));
        let before = roots.sampled.iter().filter_map(|(_, initial)| *initial);
        let once = roots.delay.iter().chain(&roots.fastest_rate).copied();
        let from_setup = graph.needed(roots.initial.iter().copied().chain(before).chain(once));
        let is_needed = |node: usize| {
            let from_plant = from_rates[node] || from_switches[node] || from_output[node];
            from_plant || from_sample[node] || from_setup[node]
        };
        let mut registers = vec![0; graph.nodes().len()];
        let mut tape = Tape {
            constants: Vec::new(),
            leaves: Vec::new(),
            tables,
            setup: List::default(),
            sample: List::default(),
            held: List::default(),
            rates: List::default(),
            switches: List::default(),
            output: List::default(),
            roots: Roots::default(),
        };
        let needed = (0..graph.nodes().len()).filter(|node| is_needed(*node));
        for (register, node) in (0..).zip(needed) {
            let kind = &graph.nodes()[node];
            registers[node] = register;
            let (operation, on) = match kind {
                Node::Constant(value) => {
                    tape.constants.push((register, *value));
                    continue;
                }
                Node::Leaf(leaf) => {
                    tape.leaves.push((*leaf, register));
                    continue;
                }
                Node::Compute(operation, on) => (*operation, on),
            };
            let instruction = Instruction {
                operation,
                to: register,
                on: on.map(|node| registers[usize::from(node)]),
            };
            match levels[node] {
                Level::Setup => tape.setup.instructions.push(instruction),
                Level::Held if from_rates[node] || from_switches[node] || from_output[node] => {
                    tape.held.instructions.push(instruction);
                }
                _ => {}
            }
            if from_sample[node] && levels[node] != Level::Setup {
                tape.sample.instructions.push(instruction);
            }
            if from_rates[node] && levels[node] == Level::Moving {
                tape.rates.instructions.push(instruction);
            } else if from_switches[node] && levels[node] == Level::Moving {
                tape.switches.instructions.push(instruction);
            }
            if from_output[node] && levels[node] == Level::Moving {
                tape.output.instructions.push(instruction);
            }
        }
        tape.roots = roots.renamed(&registers);
        tape.write_programs();
        tape
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

    fn write_programs(&mut self) {
        let lists = [
            &mut self.setup,
            &mut self.sample,
            &mut self.held,
            &mut self.output,
        ];
        for list in lists {
            list.program = Program::new(&list.instructions);
        }
        let roots = self.roots.rates.iter().chain(&self.roots.switches);
        let later = self.switches.instructions.iter().flat_map(|one| &one.on);
        let wanted = roots.chain(later).copied();
        self.rates.program = Program::joined(&self.rates.instructions, wanted);
        let switches = self.roots.switches.iter().copied();
        self.switches.program = Program::joined(&self.switches.instructions, switches);
    }

    /// Runs a list of instructions. After the rates of a row only the roots are sure to be in
    /// their registers.
    pub fn run<R: Row>(&self, list: &List, registers: &mut Registers<R>) {
        R::run(self, list, registers);
    }

    /// Runs a list over a row, as part of work that is compiled for each width.
    #[inline(always)]
    pub fn run_wide(&self, list: &List, registers: &mut Registers<Lanes>) {
        list.program.run(registers, &self.tables);
    }

    /// Runs the derivatives of a list of instructions in up to [`LANES`] directions at once:
    /// `registers` hold the values, `slopes` those of the leaves.
    pub fn run_slopes(
        &self,
        list: &List,
        registers: &Registers<f64>,
        slopes: &mut Registers<Lanes>,
    ) {
        for instruction in &list.instructions {
            let on = instruction.on.map(usize::from);
            let to = usize::from(instruction.to);
            let values = on.map(|register| registers[register]);
            let by = arithmetic::slopes(instruction.operation, values, registers[to], &self.tables);
            let mut slope = Lanes::splat(0.0);
            for (by, register) in by.into_iter().zip(on) {
                // A slope of 0 hides what is infinite behind it, e.g. the branch not taken.
                let matters = by != 0.0;
                let part = matters.then(|| Lanes::splat(by) * slopes[register]);
                slope += part.unwrap_or(Lanes::splat(0.0));
            }
            slopes[to] = slope;
        }
    }
}

/// What a list works on.
pub trait Row: Real {
    /// Runs a list of instructions.
    fn run(tape: &Tape, list: &List, registers: &mut Registers<Self>);
}

impl Row for f64 {
    fn run(tape: &Tape, list: &List, registers: &mut Registers<f64>) {
        for Instruction { operation, to, on } in &list.instructions {
            arithmetic::execute(*operation, registers, (*on, *to), &tape.tables);
        }
    }
}

impl Row for Lanes {
    fn run(tape: &Tape, list: &List, registers: &mut Registers<Lanes>) {
        width::at_full_width(OneList {
            tape,
            list,
            registers,
        });
    }
}

/// One list over one row.
struct OneList<'a> {
    tape: &'a Tape,
    list: &'a List,
    registers: &'a mut Registers<Lanes>,
}

impl Wide for OneList<'_> {
    type Output = ();
    #[inline(always)]
    fn work(self) {
        self.tape.run_wide(self.list, self.registers);
    }
}

/// The directions that one pass over the slopes takes.
pub const DIRECTIONS: usize = LANES;

impl Roots {
    /// The same with a register for each node.
    fn renamed(&self, registers: &[Register]) -> Roots {
        let name = |node: &NodeId| registers[usize::from(*node)];
        let all = |nodes: &[NodeId]| nodes.iter().map(name).collect();
        Roots {
            rates: all(&self.rates),
            switches: all(&self.switches),
            outputs: all(&self.outputs),
            initial: all(&self.initial),
            sampled: self
                .sampled
                .iter()
                .map(|(node, initial)| (name(node), initial.as_ref().map(name)))
                .collect(),
            delay: self.delay.as_ref().map(name),
            fastest_rate: self.fastest_rate.as_ref().map(name),
            valid: self.valid.as_ref().map(name),
        }
    }
}

/// What each node depends on.
fn levels(graph: &Graph, moving_inputs: bool) -> Vec<Level> {
    let mut levels: Vec<Level> = Vec::with_capacity(graph.nodes().len());
    for node in graph.nodes() {
        let level = match node {
            Node::Constant(_) => Level::Setup,
            Node::Leaf(leaf) => match leaf {
                Leaf::SampleTime | Leaf::Parameter(_) => Level::Setup,
                Leaf::Input(_) if !moving_inputs => Level::Held,
                Leaf::Sampled(_) => Level::Held,
                _ => Level::Moving,
            },
            Node::Compute(_, on) => {
                let levels = on.iter().map(|node| levels[usize::from(*node)]);
                levels.max().unwrap_or(Level::Setup)
            }
        };
        levels.push(level);
    }
    levels
}

/// What changes its sign where the rates have a kink: the arguments of comparisons and the like,
/// as far as they move between the samples.
///
/// # Errors
/// When the graph is full.
pub fn switches(
    graph: &mut Graph,
    rates: &[NodeId],
    kinks: &[NodeId],
    moving_inputs: bool,
) -> Result<Vec<NodeId>, super::graph::Full> {
    let needed = graph.needed(rates.iter().copied());
    let levels = levels(graph, moving_inputs);
    let mut pairs = Vec::new();
    let mut tables = Vec::new();
    for (index, node) in graph.nodes().iter().enumerate() {
        let Node::Compute(operation, [a, b, _]) = node else {
            continue;
        };
        if !needed[index] || levels[index] != Level::Moving {
            continue;
        }
        match operation {
            Operation::Absolute | Operation::Sign => pairs.push((*a, None)),
            Operation::Minimum | Operation::Maximum | Operation::AtLeast | Operation::Above => {
                pairs.push((*a, Some(*b)));
            }
            Operation::Table(number) => tables.push((*a, *number)),
            _ => {}
        }
    }
    let smooth = kinks.iter().filter(|node| needed[usize::from(**node)]);
    pairs.extend(smooth.map(|node| (*node, None)));
    let mut switches = Vec::new();
    for (a, b) in pairs {
        let is_truth = |node: NodeId| {
            matches!(
                graph.nodes()[usize::from(node)],
                Node::Compute(Operation::AtLeast | Operation::Above, _)
            )
        };
        // `and` and `or` compare truths, whose own switches stand for themselves.
        if is_truth(a) || b.is_some_and(is_truth) {
            continue;
        }
        let switch = match b {
            None => a,
            Some(b) if graph.as_constant(b) == Some(0.0) => a,
            Some(b) if graph.as_constant(a) == Some(0.0) => b,
            Some(b) => graph.compute(Operation::Subtract, &[a, b])?,
        };
        if !switches.contains(&switch) {
            switches.push(switch);
        }
    }
    for (at, number) in tables {
        switches.push(graph.compute(Operation::Breakpoint(number), &[at])?);
    }
    Ok(switches)
}
