//! A list of instructions as rows of lanes run through it: neighbours joined, equal ones together.
//!
//! Reading an instruction costs as much as doing it, so a program has few: an operation whose
//! result only one other needs is done with it, and what is ready at the same time and of the same
//! kind stands in one run, entered once. Every operation stays what it was, rounded as before, so
//! a program gives the bits of the list.

use super::instruction::{Instruction, Register};
use crate::language::graph::MAX_NODES;
use crate::language::operation::{self, LookupTable, Operation};
use greybox_numerics::lanes::Real;
use std::collections::HashMap;

/// What the instructions of a run do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum JoinedKind {
    /// One operation.
    Single(Operation),
    /// An operation on a and b, another on its result and c.
    Pair(First, Second),
    /// a/(a² + b)^¼
    SignedRoot,
    /// min(max(a, b), c)
    Clip,
}

/// The first operation of a pair, on a and b.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum First {
    Add,
    Subtract,
    Multiply,
    Divide,
}

/// The second operation of a pair, on the result r of the first and on c.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Second {
    /// r + c
    Add,
    /// r − c
    Subtract,
    /// c − r
    SubtractFrom,
    /// r·c
    Multiply,
    /// r/c
    DivideBy,
    /// c/r
    Divide,
}

/// Where an instruction writes and what it reads.
#[derive(Clone, Copy, Debug)]
struct Operands {
    to: Register,
    on: [Register; 3],
}

/// Instructions of one kind, none of which needs another.
#[derive(Clone, Copy, Debug)]
struct JoinedRun {
    kind: JoinedKind,
    length: usize,
}

/// The runs, and the places of their instructions one after the other.
#[derive(Debug, Default)]
pub struct Joined {
    runs: Vec<JoinedRun>,
    operands: Vec<Operands>,
}

/// A step of the program before it has its place.
#[derive(Clone, Copy, Debug)]
struct JoinedStep {
    kind: JoinedKind,
    operands: Operands,
}

impl Joined {
    /// A program that leaves every register as the list does.
    #[must_use]
    pub fn all(list: &[Instruction]) -> Joined {
        let single = |instruction: &Instruction| JoinedStep {
            kind: JoinedKind::Single(instruction.operation),
            operands: Operands {
                to: instruction.to,
                on: instruction.on,
            },
        };
        Joined::scheduled(list.iter().map(single).collect())
    }

    /// A program that leaves the registers `wanted` as the list does; others may stay untouched.
    #[must_use]
    pub fn new(list: &[Instruction], wanted: impl IntoIterator<Item = Register>) -> Joined {
        Joined::scheduled(Joiner::new(list, wanted).steps())
    }

    /// Puts steps of one kind together as far as they do not need each other: again and again
    /// all that is ready of a kind that this exhausts, or else of the kind that is readiest.
    fn scheduled(steps: Vec<JoinedStep>) -> Joined {
        let mut program = Joined::default();
        let mut kinds: Vec<JoinedKind> = Vec::new();
        let mut numbers = HashMap::new();
        let mut unmade = vec![false; MAX_NODES];
        let mut waiting: Vec<(usize, Operands)> = Vec::with_capacity(steps.len());
        for JoinedStep { kind, operands } in steps {
            let number = *numbers.entry(kind).or_insert_with(|| {
                kinds.push(kind);
                kinds.len() - 1
            });
            unmade[usize::from(operands.to)] = true;
            waiting.push((number, operands));
        }
        while !waiting.is_empty() {
            let is_ready =
                |operands: &Operands| !operands.on.iter().any(|r| unmade[usize::from(*r)]);
            let mut counts = vec![(0, 0); kinds.len()];
            for (number, operands) in &waiting {
                counts[*number].0 += 1;
                counts[*number].1 += usize::from(is_ready(operands));
            }
            let readiness = |number: &usize| {
                let (all, ready) = counts[*number];
                (ready > 0, all == ready, ready)
            };
            let best = (0..kinds.len()).max_by_key(readiness).unwrap_or(0);
            let first = program.operands.len();
            let run = waiting.extract_if(.., |(number, operands)| {
                *number == best && is_ready(operands)
            });
            program.operands.extend(run.map(|(_, operands)| operands));
            let now = &program.operands[first..];
            assert!(!now.is_empty(), "a list is in an order of computation");
            now.iter()
                .for_each(|operands| unmade[usize::from(operands.to)] = false);
            program.runs.push(JoinedRun {
                kind: kinds[best],
                length: now.len(),
            });
        }
        program
    }

    /// Runs the program.
    #[inline(always)]
    pub fn run<R: Real>(&self, registers: &mut [R; MAX_NODES], tables: &[LookupTable]) {
        let mut operands = &self.operands[..];
        for run in &self.runs {
            let Some((now, rest)) = operands.split_at_checked(run.length) else {
                return;
            };
            operands = rest;
            match run.kind {
                JoinedKind::Single(operation) => singles(operation, registers, now, tables),
                JoinedKind::Pair(first, second) => pairs(first, second, registers, now),
                JoinedKind::SignedRoot => {
                    each(registers, now, |a, b, _| a / (a * a + b).sqrt().sqrt())
                }
                JoinedKind::Clip => each(registers, now, |a, b, c| Real::min(Real::max(a, b), c)),
            }
        }
    }
}

/// Writes a function of up to three registers, place after place. The mask says to the compiler
/// that no place is out of range.
#[inline(always)]
fn each<R: Real>(
    registers: &mut [R; MAX_NODES],
    operands: &[Operands],
    function: impl Fn(R, R, R) -> R,
) {
    let place = |register: Register| usize::from(register) & (MAX_NODES - 1);
    for Operands { to, on: [a, b, c] } in operands {
        let (a, b, c) = (
            registers[place(*a)],
            registers[place(*b)],
            registers[place(*c)],
        );
        registers[place(*to)] = function(a, b, c);
    }
}

#[inline(always)]
fn singles<R: Real>(
    operation: Operation,
    registers: &mut [R; MAX_NODES],
    operands: &[Operands],
    tables: &[LookupTable],
) {
    let r = registers;
    match operation {
        Operation::Add => each(r, operands, |a, b, _| a + b),
        Operation::Subtract => each(r, operands, |a, b, _| a - b),
        Operation::Multiply => each(r, operands, |a, b, _| a * b),
        Operation::Divide => each(r, operands, |a, b, _| a / b),
        Operation::Minimum => each(r, operands, |a, b, _| Real::min(a, b)),
        Operation::Maximum => each(r, operands, |a, b, _| Real::max(a, b)),
        Operation::Select => each(r, operands, |a, b, c| a.select_ge(R::splat(0.5), b, c)),
        _ => {
            for Operands { to, on } in operands {
                operation::execute(operation, r, *on, *to, tables);
            }
        }
    }
}

#[inline(always)]
fn pairs<R: Real>(
    first: First,
    second: Second,
    registers: &mut [R; MAX_NODES],
    operands: &[Operands],
) {
    let r = registers;
    match (first, second) {
        (First::Add, Second::Add) => each(r, operands, |a, b, c| (a + b) + c),
        (First::Add, Second::Subtract) => each(r, operands, |a, b, c| (a + b) - c),
        (First::Add, Second::SubtractFrom) => each(r, operands, |a, b, c| c - (a + b)),
        (First::Add, Second::Multiply) => each(r, operands, |a, b, c| (a + b) * c),
        (First::Add, Second::DivideBy) => each(r, operands, |a, b, c| (a + b) / c),
        (First::Add, Second::Divide) => each(r, operands, |a, b, c| c / (a + b)),
        (First::Subtract, Second::Add) => each(r, operands, |a, b, c| (a - b) + c),
        (First::Subtract, Second::Subtract) => each(r, operands, |a, b, c| (a - b) - c),
        (First::Subtract, Second::SubtractFrom) => each(r, operands, |a, b, c| c - (a - b)),
        (First::Subtract, Second::Multiply) => each(r, operands, |a, b, c| (a - b) * c),
        (First::Subtract, Second::DivideBy) => each(r, operands, |a, b, c| (a - b) / c),
        (First::Subtract, Second::Divide) => each(r, operands, |a, b, c| c / (a - b)),
        (First::Multiply, Second::Add) => each(r, operands, |a, b, c| (a * b) + c),
        (First::Multiply, Second::Subtract) => each(r, operands, |a, b, c| (a * b) - c),
        (First::Multiply, Second::SubtractFrom) => each(r, operands, |a, b, c| c - (a * b)),
        (First::Multiply, Second::Multiply) => each(r, operands, |a, b, c| (a * b) * c),
        (First::Multiply, Second::DivideBy) => each(r, operands, |a, b, c| (a * b) / c),
        (First::Multiply, Second::Divide) => each(r, operands, |a, b, c| c / (a * b)),
        (First::Divide, Second::Add) => each(r, operands, |a, b, c| (a / b) + c),
        (First::Divide, Second::Subtract) => each(r, operands, |a, b, c| (a / b) - c),
        (First::Divide, Second::SubtractFrom) => each(r, operands, |a, b, c| c - (a / b)),
        (First::Divide, Second::Multiply) => each(r, operands, |a, b, c| (a / b) * c),
        (First::Divide, Second::DivideBy) => each(r, operands, |a, b, c| (a / b) / c),
        (First::Divide, Second::Divide) => each(r, operands, |a, b, c| c / (a / b)),
    }
}

/// Joins operations to the one that alone needs their result.
struct Joiner {
    steps: Vec<Option<JoinedStep>>,
    /// The step that writes a register.
    made_by: HashMap<Register, usize>,
    /// How often a register is read, by steps or from outside.
    uses: HashMap<Register, usize>,
}

impl Joiner {
    fn new(list: &[Instruction], wanted: impl IntoIterator<Item = Register>) -> Joiner {
        let mut joiner = Joiner {
            steps: Vec::new(),
            made_by: HashMap::new(),
            uses: HashMap::new(),
        };
        for register in wanted {
            *joiner.uses.entry(register).or_default() += 1;
        }
        for (index, instruction) in list.iter().enumerate() {
            let Instruction { operation, to, on } = *instruction;
            for register in &on[..operation.arguments()] {
                *joiner.uses.entry(*register).or_default() += 1;
            }
            joiner.made_by.insert(to, index);
            joiner.steps.push(Some(JoinedStep {
                kind: JoinedKind::Single(operation),
                operands: Operands { to, on },
            }));
        }
        joiner
    }

    fn steps(mut self) -> Vec<JoinedStep> {
        self.join_all(Joiner::signed_root);
        self.join_all(Joiner::clip);
        self.join_all(Joiner::pair);
        self.steps.into_iter().flatten().collect()
    }

    /// Joins wherever `join` finds a step and those that it swallows.
    fn join_all(&mut self, join: impl Fn(&Joiner, usize) -> Option<(JoinedStep, Vec<usize>)>) {
        for index in 0..self.steps.len() {
            if let Some((step, swallowed)) = join(self, index) {
                self.replace(index, step, &swallowed);
            }
        }
    }

    /// Puts a step in the place of one that it does together with the `swallowed`.
    fn replace(&mut self, index: usize, step: JoinedStep, swallowed: &[usize]) {
        self.steps[index] = Some(step);
        for &index in swallowed {
            self.steps[index] = None;
        }
    }

    /// The operation of a step that is still alone, and its places.
    fn single(&self, index: usize) -> Option<(Operation, Operands)> {
        match self.steps[index] {
            Some(JoinedStep {
                kind: JoinedKind::Single(operation),
                operands,
            }) => Some((operation, operands)),
            _ => None,
        }
    }

    /// The step that does `operation` for the register, where nobody else reads it `uses` times.
    fn maker(&self, register: Register, operation: Operation) -> Option<(usize, Operands)> {
        let index = *self.made_by.get(&register)?;
        let (made, operands) = self.single(index)?;
        (made == operation && self.uses.get(&register) == Some(&1)).then_some((index, operands))
    }

    fn signed_root(&self, index: usize) -> Option<(JoinedStep, Vec<usize>)> {
        let (
            Operation::Divide,
            Operands {
                to,
                on: [drop, root, _],
            },
        ) = self.single(index)?
        else {
            return None;
        };
        let (outer, operands) = self.maker(root, Operation::SquareRoot)?;
        let (inner, operands) = self.maker(operands.on[0], Operation::SquareRoot)?;
        let (sum, operands) = self.maker(operands.on[0], Operation::Add)?;
        let [left, right, _] = operands.on;
        let squared = |register| {
            let (index, operands) = self.maker(register, Operation::Multiply)?;
            (operands.on[0] == drop && operands.on[1] == drop).then_some(index)
        };
        let (square, width) = match (squared(left), squared(right)) {
            (Some(square), _) => (square, right),
            (None, Some(square)) => (square, left),
            (None, None) => return None,
        };
        let step = JoinedStep {
            kind: JoinedKind::SignedRoot,
            operands: Operands {
                to,
                on: [drop, width, drop],
            },
        };
        Some((step, vec![outer, inner, sum, square]))
    }

    fn clip(&self, index: usize) -> Option<(JoinedStep, Vec<usize>)> {
        let (
            Operation::Minimum,
            Operands {
                to,
                on: [above, upper, _],
            },
        ) = self.single(index)?
        else {
            return None;
        };
        let (inner, operands) = self.maker(above, Operation::Maximum)?;
        let [a, lower, _] = operands.on;
        let operands = Operands {
            to,
            on: [a, lower, upper],
        };
        let kind = JoinedKind::Clip;
        Some((JoinedStep { kind, operands }, vec![inner]))
    }

    fn pair(&self, index: usize) -> Option<(JoinedStep, Vec<usize>)> {
        let (
            operation,
            Operands {
                to,
                on: [left, right, _],
            },
        ) = self.single(index)?;
        let (as_left, as_right) = match operation {
            Operation::Add => (Second::Add, Second::Add),
            Operation::Subtract => (Second::Subtract, Second::SubtractFrom),
            Operation::Multiply => (Second::Multiply, Second::Multiply),
            Operation::Divide => (Second::DivideBy, Second::Divide),
            _ => return None,
        };
        let of_left = self.first(left).map(|inner| (inner, as_left, right));
        let of_right = || self.first(right).map(|inner| (inner, as_right, left));
        let ((inner, first, [a, b, _]), second, c) = of_left.or_else(of_right)?;
        let step = JoinedStep {
            kind: JoinedKind::Pair(first, second),
            operands: Operands { to, on: [a, b, c] },
        };
        Some((step, vec![inner]))
    }

    /// The step that makes a register for one reader alone, where it can be the first of a pair.
    fn first(&self, register: Register) -> Option<(usize, First, [Register; 3])> {
        [
            (Operation::Add, First::Add),
            (Operation::Subtract, First::Subtract),
            (Operation::Multiply, First::Multiply),
            (Operation::Divide, First::Divide),
        ]
        .into_iter()
        .find_map(|(operation, first)| {
            let (index, operands) = self.maker(register, operation)?;
            Some((index, first, operands.on))
        })
    }
}

#[cfg(test)]
mod tests;
