//! Exact first derivatives of rates and outputs by the states, and of rates by inputs that move.
//!
//! They are taken forward through the instructions, one direction at a time, over the
//! instructions alone that the direction reaches.

use super::instruction::{Instruction, Register, Registers, zeros};
use crate::language::graph::MAX_NODES;
use crate::language::operation::{self, LookupTable};
use greybox_numerics::lanes::Real;
use greybox_numerics::width::Wide;

/// Which instructions of a list a direction reaches, by their place in the list.
#[derive(Debug)]
struct DirectionReach {
    /// The registers that the direction starts from.
    from: Vec<Register>,
    instructions: Vec<usize>,
    /// The roots that it reaches.
    roots: Vec<usize>,
}

/// A list of instructions and the registers of what it computes.
#[derive(Clone, Copy, Debug)]
pub struct Differentiated<'a> {
    /// The instructions, in an order of computation.
    pub instructions: &'a [Instruction],
    /// The registers of the rates or outputs.
    pub roots: &'a [Register],
}

/// The directions of the states, and that of all inputs together.
#[derive(Debug)]
pub struct Tangents {
    states: Vec<DirectionReach>,
    inputs: DirectionReach,
    /// For each instruction whether a direction reaches its second number.
    reaches_second: Vec<bool>,
    /// The register of each input, where the equations use it.
    input_registers: Vec<Option<Register>>,
}

/// Room for the derivatives of each instruction, and for those along a direction.
pub struct Room<R> {
    partials: Vec<[R; 3]>,
    along: Registers<R>,
}

impl DirectionReach {
    fn of(list: Differentiated<'_>, from: Vec<Register>) -> DirectionReach {
        let mut is_reached = vec![false; MAX_NODES];
        for register in &from {
            is_reached[usize::from(*register)] = true;
        }
        let mut instructions = Vec::new();
        for (place, instruction) in list.instructions.iter().enumerate() {
            let Instruction { operation, to, on } = instruction;
            let read = &on[..operation.arguments()];
            if read
                .iter()
                .any(|register| is_reached[usize::from(*register)])
            {
                is_reached[usize::from(*to)] = true;
                instructions.push(place);
            }
        }
        let roots = list.roots.iter().enumerate();
        let roots = roots.filter(|(_, register)| is_reached[usize::from(**register)]);
        DirectionReach {
            from,
            instructions,
            roots: roots.map(|(root, _)| root).collect(),
        }
    }
}

impl Tangents {
    /// What the states and the inputs, by their registers, reach.
    pub fn new(
        list: Differentiated<'_>,
        states: &[Option<Register>],
        inputs: &[Option<Register>],
    ) -> Tangents {
        let of_state = |register: &Option<Register>| {
            DirectionReach::of(list, register.iter().copied().collect())
        };
        let states: Vec<DirectionReach> = states.iter().map(of_state).collect();
        let inputs_reach = DirectionReach::of(list, inputs.iter().copied().flatten().collect());
        let instructions = list.instructions;
        let mut is_reached = vec![false; MAX_NODES];
        for reach in states.iter().chain([&inputs_reach]) {
            let written = reach
                .instructions
                .iter()
                .map(|place| instructions[*place].to);
            for register in written.chain(reach.from.iter().copied()) {
                is_reached[usize::from(register)] = true;
            }
        }
        let seconds = instructions.iter().map(|instruction| instruction.on[1]);
        Tangents {
            states,
            inputs: inputs_reach,
            reaches_second: seconds
                .map(|register| is_reached[usize::from(register)])
                .collect(),
            input_registers: inputs.to_vec(),
        }
    }

    /// Room for derivatives.
    pub fn room<R: Real>(&self) -> Room<R> {
        Room {
            partials: Vec::new(),
            along: zeros(),
        }
    }

    /// The rates' own rates of change through inputs that move, where the derivatives by the
    /// states were taken last.
    pub fn by_inputs<R: Real>(
        &self,
        list: Differentiated<'_>,
        room: &mut Room<R>,
        slopes: &[R],
        by_time: &mut [R],
    ) {
        by_time.fill(R::splat(0.0));
        for (register, slope) in self.input_registers.iter().zip(slopes) {
            if let Some(register) = register {
                room.along[usize::from(*register)] = *slope;
            }
        }
        self.inputs.follow(list, room);
        for rate in &self.inputs.roots {
            by_time[*rate] = room.along[usize::from(list.roots[*rate])];
        }
        self.inputs.clear(list, room);
    }
}

/// The derivatives of rates or outputs by the states, as work that is compiled for each width of
/// registers.
pub struct StateDerivatives<'a, R> {
    /// Which instructions the states reach.
    pub tangents: &'a Tangents,
    /// The instructions of the rates, or those of the outputs.
    pub list: Differentiated<'a>,
    /// The tables, by number.
    pub tables: &'a [LookupTable],
    /// Registers that hold the states at which the derivatives are taken.
    pub registers: &'a mut Registers<R>,
    /// Room for the derivatives of each instruction.
    pub room: &'a mut Room<R>,
    /// The result, ∂root/∂state: `matrix[root · n + state]`.
    pub matrix: &'a mut [R],
}

impl<R: Real> Wide for StateDerivatives<'_, R> {
    type Output = ();
    #[inline(always)]
    fn work(self) {
        let StateDerivatives {
            tangents,
            list,
            tables,
            registers,
            room,
            matrix,
        } = self;
        let n = tangents.states.len();
        room.partials.clear();
        let instructions = list.instructions.iter();
        let instructions = instructions.zip(&tangents.reaches_second);
        for (Instruction { operation, to, on }, second) in instructions {
            operation::execute(*operation, registers, *on, *to, tables);
            let values = on.map(|register| registers[usize::from(register)]);
            let result = registers[usize::from(*to)];
            let partials = operation::partials(*operation, values, result, *second, tables);
            room.partials.push(partials);
        }
        matrix.fill(R::splat(0.0));
        for (column, reach) in tangents.states.iter().enumerate() {
            for register in &reach.from {
                room.along[usize::from(*register)] = R::splat(1.0);
            }
            reach.follow(list, room);
            for root in &reach.roots {
                let register = list.roots[*root];
                matrix[root * n + column] = room.along[usize::from(register)];
            }
            reach.clear(list, room);
        }
    }
}

impl DirectionReach {
    /// Carries the derivatives from the registers that the direction starts from to the roots.
    #[inline(always)]
    fn follow<R: Real>(&self, list: Differentiated<'_>, room: &mut Room<R>) {
        let least = R::splat(f64::from(f32::MIN_POSITIVE));
        for place in &self.instructions {
            let Instruction { operation, to, on } = list.instructions[*place];
            let mut sum = R::splat(0.0);
            for (partial, register) in room.partials[*place]
                .iter()
                .zip(&on[..operation.arguments()])
            {
                let part = *partial * room.along[usize::from(*register)];
                // A derivative of 0 hides what is infinite behind it, e.g. the branch not taken.
                sum += partial.abs().select_ge(least, part, R::splat(0.0));
            }
            room.along[usize::from(to)] = sum;
        }
    }

    /// Leaves zeros for the next direction.
    #[inline(always)]
    fn clear<R: Real>(&self, list: Differentiated<'_>, room: &mut Room<R>) {
        let zero = R::splat(0.0);
        for register in &self.from {
            room.along[usize::from(*register)] = zero;
        }
        for place in &self.instructions {
            room.along[usize::from(list.instructions[*place].to)] = zero;
        }
    }
}
