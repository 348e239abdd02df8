//! Exact first derivatives of the rates by the states and by inputs that move.
//!
//! They are taken forward through the instructions, one direction at a time, over the
//! instructions alone that the direction reaches.

use super::instruction::{Instruction, Register, Registers, zeros};
use super::lists::Lists;
use crate::language::graph::MAX_NODES;
use crate::language::operation;
use greybox_numerics::lanes::Real;
use greybox_numerics::width::{Wide, Width};

/// Which instructions of the rates a direction reaches, by their place in the list.
#[derive(Debug)]
struct Reach {
    /// The registers that the direction starts from.
    from: Vec<Register>,
    instructions: Vec<usize>,
    /// The rates that it reaches.
    rates: Vec<usize>,
}

/// The directions of the states, and that of all inputs together.
#[derive(Debug)]
pub struct Tangents {
    states: Vec<Reach>,
    inputs: Reach,
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

impl Reach {
    fn of(lists: &Lists, from: Vec<Register>) -> Reach {
        let mut is_reached = vec![false; MAX_NODES];
        for register in &from {
            is_reached[usize::from(*register)] = true;
        }
        let mut instructions = Vec::new();
        for (place, instruction) in lists.rates.instructions().iter().enumerate() {
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
        let rates = lists.roots.rates.iter().enumerate();
        let rates = rates.filter(|(_, register)| is_reached[usize::from(**register)]);
        Reach {
            from,
            instructions,
            rates: rates.map(|(rate, _)| rate).collect(),
        }
    }
}

impl Tangents {
    /// What the states and the inputs, by their registers, reach.
    pub fn new(
        lists: &Lists,
        states: &[Option<Register>],
        inputs: &[Option<Register>],
    ) -> Tangents {
        let of_state =
            |register: &Option<Register>| Reach::of(lists, register.iter().copied().collect());
        let states: Vec<Reach> = states.iter().map(of_state).collect();
        let inputs_reach = Reach::of(lists, inputs.iter().copied().flatten().collect());
        let instructions = lists.rates.instructions();
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

    /// ∂rate/∂state at the states in the registers: `matrix[rate · n + state]`.
    pub fn by_states<R: Real>(
        &self,
        lists: &Lists,
        (registers, room): (&mut Registers<R>, &mut Room<R>),
        (matrix, width): (&mut [R], Width),
    ) {
        width.does(ByStates {
            tangents: self,
            lists,
            registers,
            room,
            matrix,
        });
    }

    #[inline(always)]
    fn write_by_states<R: Real>(
        &self,
        lists: &Lists,
        (registers, room): (&mut Registers<R>, &mut Room<R>),
        matrix: &mut [R],
    ) {
        let n = self.states.len();
        room.partials.clear();
        let instructions = lists.rates.instructions().iter();
        for (Instruction { operation, to, on }, second) in instructions.zip(&self.reaches_second) {
            operation::execute(*operation, registers, (*on, *to), lists.tables());
            let values = on.map(|register| registers[usize::from(register)]);
            let result = registers[usize::from(*to)];
            let at = (values, result);
            let partials = operation::partials(*operation, at, *second, lists.tables());
            room.partials.push(partials);
        }
        matrix.fill(R::splat(0.0));
        for (column, reach) in self.states.iter().enumerate() {
            for register in &reach.from {
                room.along[usize::from(*register)] = R::splat(1.0);
            }
            reach.follow(lists, room);
            for rate in &reach.rates {
                let register = lists.roots.rates[*rate];
                matrix[rate * n + column] = room.along[usize::from(register)];
            }
            reach.clear(lists, room);
        }
    }

    /// The rates' own rates of change through inputs that move, where the derivatives by the
    /// states were taken last.
    pub fn by_inputs<R: Real>(
        &self,
        lists: &Lists,
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
        self.inputs.follow(lists, room);
        for rate in &self.inputs.rates {
            by_time[*rate] = room.along[usize::from(lists.roots.rates[*rate])];
        }
        self.inputs.clear(lists, room);
    }
}

/// The derivatives by the states as work that is compiled for each width of registers.
struct ByStates<'a, R> {
    tangents: &'a Tangents,
    lists: &'a Lists,
    registers: &'a mut Registers<R>,
    room: &'a mut Room<R>,
    matrix: &'a mut [R],
}

impl<R: Real> Wide for ByStates<'_, R> {
    type Output = ();
    #[inline(always)]
    fn work(self) {
        let rows = (self.registers, self.room);
        self.tangents.write_by_states(self.lists, rows, self.matrix);
    }
}

impl Reach {
    /// Carries the derivatives from the registers that the direction starts from to the rates.
    #[inline(always)]
    fn follow<R: Real>(&self, lists: &Lists, room: &mut Room<R>) {
        let least = R::splat(f64::from(f32::MIN_POSITIVE));
        for place in &self.instructions {
            let Instruction { operation, to, on } = lists.rates.instructions()[*place];
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
    fn clear<R: Real>(&self, lists: &Lists, room: &mut Room<R>) {
        let zero = R::splat(0.0);
        for register in &self.from {
            room.along[usize::from(*register)] = zero;
        }
        for place in &self.instructions {
            room.along[usize::from(lists.rates.instructions()[*place].to)] = zero;
        }
    }
}
