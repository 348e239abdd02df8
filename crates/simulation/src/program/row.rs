//! A document's equations over a row of candidates.

use super::compiled::CompiledProgram;
use super::instruction::{Register, Registers};
use super::lists::List;
use super::tangents::{Room, StateDerivatives};
use crate::equations::{Equations, HeldQuantities, Sample, Shares};
use greybox_numerics::lanes::Real;
use greybox_numerics::width::Width;

/// The equations with their registers.
pub struct ProgramRow<'a, R> {
    program: &'a CompiledProgram,
    width: Width,
    registers: Registers<R>,
    /// The inputs when the held quantities began to act, and how fast they move.
    inputs: Vec<R>,
    slopes: Vec<R>,
    /// The sampled quantities as they were computed last.
    previous: Vec<R>,
    /// Room for derivatives of the rates, once they are asked for.
    tangents: Option<Room<R>>,
    /// Room for derivatives of the outputs, once they are asked for.
    output_tangents: Option<Room<R>>,
    /// Room for derivatives of what is computed once a sample, once they are asked for.
    sampled_tangents: Option<Room<R>>,
}

impl<'a, R: Real> ProgramRow<'a, R> {
    /// Registers for the given parameters, with all that follows from them.
    pub fn new(program: &'a CompiledProgram, parameters: &[R], sample_time: f64) -> Self {
        let mut row = ProgramRow {
            program,
            width: Width::widest(),
            registers: program.lists.registers(),
            inputs: Vec::new(),
            slopes: Vec::new(),
            previous: Vec::new(),
            tangents: None,
            output_tangents: None,
            sampled_tangents: None,
        };
        for (register, value) in program.wiring.parameters.iter().zip(parameters) {
            row.set(*register, *value);
        }
        row.set(program.wiring.sample_time, R::splat(sample_time));
        row.run(&program.lists.setup);
        let before = program.lists.roots.sampled.iter();
        let before = before.map(|(_, initial)| initial.map_or(R::splat(0.0), |r| row.get(r)));
        row.previous = before.collect();
        row
    }

    /// The fastest rate that the document hints at [1/s]; 0 where it does not.
    pub fn rate_hint(&self) -> f64 {
        let hint = self.program.lists.roots.fastest_rate;
        hint.map_or(0.0, |register| self.get(register).lane(0))
    }

    #[inline(always)]
    fn set(&mut self, register: Option<Register>, value: R) {
        if let Some(register) = register {
            self.registers[usize::from(register)] = value;
        }
    }

    #[inline(always)]
    fn get(&self, register: Register) -> R {
        self.registers[usize::from(register)]
    }

    fn run(&mut self, list: &List) {
        self.program
            .lists
            .run(list, &mut self.registers, self.width);
    }

    /// The quantities that are computed once a sample, as they were computed last.
    pub fn sampled(&self) -> &[R] {
        &self.previous
    }

    /// Computes what is computed once a sample from what stands in the registers.
    fn sample(&mut self) {
        let lists = &self.program.lists;
        self.run(&lists.sample);
        self.previous.clear();
        for (register, _) in &lists.roots.sampled {
            self.previous.push(self.registers[usize::from(*register)]);
        }
    }

    /// Computes what is computed once a sample again, for other states at the sample that was held last.
    pub fn sample_again(&mut self, states: &[R]) {
        self.load(states, R::splat(0.0));
        self.sample();
    }

    /// ∂quantity/∂state of what was computed last, `matrix[quantity · n + state]`.
    pub fn sampled_jacobian(&mut self, matrix: &mut [R]) {
        let CompiledProgram {
            lists,
            sampled_tangents,
            ..
        } = self.program;
        let room = self
            .sampled_tangents
            .get_or_insert_with(|| sampled_tangents.room());
        self.width.does(StateDerivatives {
            tangents: sampled_tangents,
            list: lists.differentiated_sampled(),
            tables: lists.tables(),
            registers: &mut self.registers,
            room,
            matrix,
        });
    }

    /// Writes states and inputs, `elapsed` after these began to act, to their registers.
    #[inline(always)]
    fn load(&mut self, states: &[R], elapsed: R) {
        let wiring = &self.program.wiring;
        for (register, value) in wiring.states.iter().zip(states) {
            self.set(*register, *value);
        }
        for (index, slope) in self.slopes.iter().enumerate() {
            if let Some(Some(register)) = wiring.inputs.get(index) {
                self.registers[usize::from(*register)] = self.inputs[index] + *slope * elapsed;
            }
        }
    }
}

impl<R: Real> Equations<R> for ProgramRow<'_, R> {
    type States = Vec<R>;
    const SIZES_ARE_FIXED: bool = false;
    const MAY_BE_SMOOTH: bool = true;

    fn initial_states(&self) -> Vec<R> {
        let initial = self.program.lists.roots.initial.iter();
        initial.map(|register| self.get(*register)).collect()
    }

    fn sizes(&self) -> Vec<R> {
        self.program
            .sizes
            .iter()
            .map(|size| R::splat(*size))
            .collect()
    }

    fn input_delay(&self) -> Option<R> {
        let delay = self.program.lists.roots.delay;
        delay.map(|register| self.get(register))
    }

    /// What starts once and is then left alone keeps every error, and most where nothing damps it:
    /// with these shares six digits hold in the test set for initial value problems. What is driven
    /// forgets its errors or takes them from its inputs: outputs of the documents in
    /// `tests/documents` err by less than a ten-millionth of their range.
    fn shares(&self) -> Shares {
        match self.n_held() {
            0 => Shares {
                fourth: 0.05,
                eighth: 0.01,
            },
            _ => Shares {
                fourth: 0.5,
                eighth: 1.0,
            },
        }
    }

    fn n_held(&self) -> usize {
        self.program.wiring.inputs.len() + self.program.wiring.sampled.len()
    }

    /// The inputs, and behind them what is computed once a sample.
    fn hold(&mut self, sample: &Sample<'_>, states: &Vec<R>, held: &mut HeldQuantities<R>) {
        let wiring = &self.program.wiring;
        self.load(states, R::splat(0.0));
        for (input, register) in wiring.recorded.iter().enumerate() {
            if register.is_some() {
                self.set(*register, R::splat(sample.input(input)));
            }
        }
        for (index, register) in wiring.previous.iter().enumerate() {
            self.set(*register, self.previous[index]);
        }
        self.sample();
        let n_inputs = wiring.inputs.len();
        let inputs = (0..n_inputs).map(|input| R::splat(sample.input(input)));
        held.values.clear();
        held.values
            .extend(inputs.chain(self.previous.iter().copied()));
        if self.program.moving_inputs {
            let slopes = (0..n_inputs).map(|input| R::splat(sample.slope(input)));
            held.slopes.clear();
            held.slopes.extend(slopes);
        }
    }

    fn act(&mut self, held: &HeldQuantities<R>) {
        let CompiledProgram { lists, wiring, .. } = self.program;
        let (inputs, sampled) = held.values.split_at(wiring.inputs.len());
        for (register, value) in wiring.inputs.iter().zip(inputs) {
            self.set(*register, *value);
        }
        for (register, value) in wiring.sampled.iter().zip(sampled) {
            self.set(*register, *value);
        }
        self.inputs.clear();
        self.inputs.extend_from_slice(inputs);
        self.slopes.clone_from(&held.slopes);
        self.run(&lists.held);
    }

    fn rates(&mut self, states: &Vec<R>, elapsed: R, rates: &mut Vec<R>) {
        self.load(states, elapsed);
        let lists = &self.program.lists;
        self.run(&lists.rates);
        for (rate, register) in rates.iter_mut().zip(&lists.roots.rates) {
            *rate = self.registers[usize::from(*register)];
        }
    }

    fn jacobian(&mut self, states: &Vec<R>, elapsed: R, _rates: &Vec<R>, matrix: &mut [R]) {
        self.load(states, elapsed);
        let CompiledProgram {
            lists, tangents, ..
        } = self.program;
        let room = self.tangents.get_or_insert_with(|| tangents.room());
        self.width.does(StateDerivatives {
            tangents,
            list: lists.differentiated_rates(),
            tables: lists.tables(),
            registers: &mut self.registers,
            room,
            matrix,
        });
    }

    fn rates_by_time(&mut self, by_time: &mut [R]) -> bool {
        let Some(room) = self.tangents.as_mut().filter(|_| !self.slopes.is_empty()) else {
            return false;
        };
        let CompiledProgram {
            lists, tangents, ..
        } = self.program;
        tangents.by_inputs(lists.differentiated_rates(), room, &self.slopes, by_time);
        true
    }

    fn outputs(&mut self, states: &Vec<R>, outputs: &mut [R]) {
        self.load(states, R::splat(0.0));
        let lists = &self.program.lists;
        self.run(&lists.output);
        for (output, register) in outputs.iter_mut().zip(&lists.roots.outputs) {
            *output = self.registers[usize::from(*register)];
        }
    }

    fn output_jacobian(&mut self, states: &Vec<R>, _outputs: &[R], matrix: &mut [R]) {
        self.load(states, R::splat(0.0));
        let CompiledProgram {
            lists,
            output_tangents,
            ..
        } = self.program;
        let room = self
            .output_tangents
            .get_or_insert_with(|| output_tangents.room());
        self.width.does(StateDerivatives {
            tangents: output_tangents,
            list: lists.differentiated_outputs(),
            tables: lists.tables(),
            registers: &mut self.registers,
            room,
            matrix,
        });
    }

    fn validity(&mut self, _states: &Vec<R>) -> R {
        let holds = self.program.lists.roots.valid;
        holds.map_or(R::splat(0.0), |register| self.get(register) - R::splat(0.5))
    }
}
