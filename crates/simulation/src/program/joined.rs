//! A list of instructions as rows of lanes run through it: neighbours joined, equal ones together.
//!
//! Reading an instruction costs as much as doing it, so a program has few: an operation whose
//! result only one other needs is done with it, and what is ready at the same time and of the same
//! kind stands in one run, entered once. Every operation stays what it was, rounded as before, so
//! a program gives the bits of the list.

use super::instruction::{Instruction, Register};
use crate::language::graph::MAX_NODES;
use crate::language::operation::{self, Operation, Table};
use greybox_numerics::lanes::Real;
use std::collections::HashMap;

/// What the instructions of a run do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Kind {
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
struct Places {
    to: Register,
    on: [Register; 3],
}

/// Instructions of one kind, none of which needs another.
#[derive(Clone, Copy, Debug)]
struct Run {
    kind: Kind,
    length: usize,
}

/// The runs, and the places of their instructions one after the other.
#[derive(Debug, Default)]
pub struct Joined {
    runs: Vec<Run>,
    places: Vec<Places>,
}

/// A step of the program before it has its place.
#[derive(Clone, Copy, Debug)]
struct Step {
    kind: Kind,
    places: Places,
}

impl Joined {
    /// A program that leaves every register as the list does.
    #[must_use]
    pub fn all(list: &[Instruction]) -> Joined {
        let single = |instruction: &Instruction| Step {
            kind: Kind::Single(instruction.operation),
            places: Places {
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
    fn scheduled(steps: Vec<Step>) -> Joined {
        let mut program = Joined::default();
        let mut kinds: Vec<Kind> = Vec::new();
        let mut known = HashMap::new();
        let mut unmade = vec![false; MAX_NODES];
        let mut waiting: Vec<(usize, Places)> = Vec::with_capacity(steps.len());
        for Step { kind, places } in steps {
            let number = *known.entry(kind).or_insert_with(|| {
                kinds.push(kind);
                kinds.len() - 1
            });
            unmade[usize::from(places.to)] = true;
            waiting.push((number, places));
        }
        while !waiting.is_empty() {
            let is_ready = |places: &Places| !places.on.iter().any(|r| unmade[usize::from(*r)]);
            let mut counts = vec![(0, 0); kinds.len()];
            for (number, places) in &waiting {
                counts[*number].0 += 1;
                counts[*number].1 += usize::from(is_ready(places));
            }
            let readiness = |number: &usize| {
                let (all, ready) = counts[*number];
                (ready > 0, all == ready, ready)
            };
            let best = (0..kinds.len()).max_by_key(readiness).unwrap_or(0);
            let first = program.places.len();
            let run =
                waiting.extract_if(.., |(number, places)| *number == best && is_ready(places));
            program.places.extend(run.map(|(_, places)| places));
            let now = &program.places[first..];
            assert!(!now.is_empty(), "a list is in an order of computation");
            now.iter()
                .for_each(|places| unmade[usize::from(places.to)] = false);
            program.runs.push(Run {
                kind: kinds[best],
                length: now.len(),
            });
        }
        program
    }

    /// Runs the program.
    #[inline(always)]
    pub fn run<R: Real>(&self, registers: &mut [R; MAX_NODES], tables: &[Table]) {
        let mut places = &self.places[..];
        for run in &self.runs {
            let Some((now, rest)) = places.split_at_checked(run.length) else {
                return;
            };
            places = rest;
            match run.kind {
                Kind::Single(operation) => singles(operation, registers, now, tables),
                Kind::Pair(first, second) => pairs((first, second), registers, now),
                Kind::SignedRoot => each(registers, now, |a, b, _| a / (a * a + b).sqrt().sqrt()),
                Kind::Clip => each(registers, now, |a, b, c| Real::min(Real::max(a, b), c)),
            }
        }
    }
}

/// Writes a function of up to three registers, place after place. The mask says to the compiler
/// that no place is out of range.
#[inline(always)]
fn each<R: Real>(
    registers: &mut [R; MAX_NODES],
    places: &[Places],
    function: impl Fn(R, R, R) -> R,
) {
    let place = |register: Register| usize::from(register) & (MAX_NODES - 1);
    for Places { to, on: [a, b, c] } in places {
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
    places: &[Places],
    tables: &[Table],
) {
    let r = registers;
    match operation {
        Operation::Add => each(r, places, |a, b, _| a + b),
        Operation::Subtract => each(r, places, |a, b, _| a - b),
        Operation::Multiply => each(r, places, |a, b, _| a * b),
        Operation::Divide => each(r, places, |a, b, _| a / b),
        Operation::Minimum => each(r, places, |a, b, _| Real::min(a, b)),
        Operation::Maximum => each(r, places, |a, b, _| Real::max(a, b)),
        Operation::Select => each(r, places, |a, b, c| a.select_ge(R::splat(0.5), b, c)),
        _ => {
            for Places { to, on } in places {
                operation::execute(operation, r, (*on, *to), tables);
            }
        }
    }
}

#[inline(always)]
fn pairs<R: Real>(kind: (First, Second), registers: &mut [R; MAX_NODES], places: &[Places]) {
    let r = registers;
    match kind {
        (First::Add, Second::Add) => each(r, places, |a, b, c| (a + b) + c),
        (First::Add, Second::Subtract) => each(r, places, |a, b, c| (a + b) - c),
        (First::Add, Second::SubtractFrom) => each(r, places, |a, b, c| c - (a + b)),
        (First::Add, Second::Multiply) => each(r, places, |a, b, c| (a + b) * c),
        (First::Add, Second::DivideBy) => each(r, places, |a, b, c| (a + b) / c),
        (First::Add, Second::Divide) => each(r, places, |a, b, c| c / (a + b)),
        (First::Subtract, Second::Add) => each(r, places, |a, b, c| (a - b) + c),
        (First::Subtract, Second::Subtract) => each(r, places, |a, b, c| (a - b) - c),
        (First::Subtract, Second::SubtractFrom) => each(r, places, |a, b, c| c - (a - b)),
        (First::Subtract, Second::Multiply) => each(r, places, |a, b, c| (a - b) * c),
        (First::Subtract, Second::DivideBy) => each(r, places, |a, b, c| (a - b) / c),
        (First::Subtract, Second::Divide) => each(r, places, |a, b, c| c / (a - b)),
        (First::Multiply, Second::Add) => each(r, places, |a, b, c| (a * b) + c),
        (First::Multiply, Second::Subtract) => each(r, places, |a, b, c| (a * b) - c),
        (First::Multiply, Second::SubtractFrom) => each(r, places, |a, b, c| c - (a * b)),
        (First::Multiply, Second::Multiply) => each(r, places, |a, b, c| (a * b) * c),
        (First::Multiply, Second::DivideBy) => each(r, places, |a, b, c| (a * b) / c),
        (First::Multiply, Second::Divide) => each(r, places, |a, b, c| c / (a * b)),
        (First::Divide, Second::Add) => each(r, places, |a, b, c| (a / b) + c),
        (First::Divide, Second::Subtract) => each(r, places, |a, b, c| (a / b) - c),
        (First::Divide, Second::SubtractFrom) => each(r, places, |a, b, c| c - (a / b)),
        (First::Divide, Second::Multiply) => each(r, places, |a, b, c| (a / b) * c),
        (First::Divide, Second::DivideBy) => each(r, places, |a, b, c| (a / b) / c),
        (First::Divide, Second::Divide) => each(r, places, |a, b, c| c / (a / b)),
    }
}

/// Joins operations to the one that alone needs their result.
struct Joiner {
    steps: Vec<Option<Step>>,
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
            joiner.steps.push(Some(Step {
                kind: Kind::Single(operation),
                places: Places { to, on },
            }));
        }
        joiner
    }

    fn steps(mut self) -> Vec<Step> {
        self.join_all(Joiner::signed_root);
        self.join_all(Joiner::clip);
        self.join_all(Joiner::pair);
        self.steps.into_iter().flatten().collect()
    }

    /// Joins wherever `join` finds a step and those that it swallows.
    fn join_all(&mut self, join: impl Fn(&Joiner, usize) -> Option<(Step, Vec<usize>)>) {
        for index in 0..self.steps.len() {
            if let Some((step, swallowed)) = join(self, index) {
                self.replace(index, step, &swallowed);
            }
        }
    }

    /// Puts a step in the place of one that it does together with the `swallowed`.
    fn replace(&mut self, index: usize, step: Step, swallowed: &[usize]) {
        self.steps[index] = Some(step);
        for &index in swallowed {
            self.steps[index] = None;
        }
    }

    /// The operation of a step that is still alone, and its places.
    fn single(&self, index: usize) -> Option<(Operation, Places)> {
        match self.steps[index] {
            Some(Step {
                kind: Kind::Single(operation),
                places,
            }) => Some((operation, places)),
            _ => None,
        }
    }

    /// The step that does `operation` for the register, where nobody else reads it `uses` times.
    fn maker(&self, register: Register, operation: Operation) -> Option<(usize, Places)> {
        let index = *self.made_by.get(&register)?;
        let (own, places) = self.single(index)?;
        (own == operation && self.uses.get(&register) == Some(&1)).then_some((index, places))
    }

    fn signed_root(&self, index: usize) -> Option<(Step, Vec<usize>)> {
        let (
            Operation::Divide,
            Places {
                to,
                on: [drop, root, _],
            },
        ) = self.single(index)?
        else {
            return None;
        };
        let (outer, places) = self.maker(root, Operation::SquareRoot)?;
        let (inner, places) = self.maker(places.on[0], Operation::SquareRoot)?;
        let (sum, places) = self.maker(places.on[0], Operation::Add)?;
        let [one, other, _] = places.on;
        let squared = |register| {
            let (index, places) = self.maker(register, Operation::Multiply)?;
            (places.on[0] == drop && places.on[1] == drop).then_some(index)
        };
        let (square, width) = match (squared(one), squared(other)) {
            (Some(square), _) => (square, other),
            (None, Some(square)) => (square, one),
            (None, None) => return None,
        };
        let step = Step {
            kind: Kind::SignedRoot,
            places: Places {
                to,
                on: [drop, width, drop],
            },
        };
        Some((step, vec![outer, inner, sum, square]))
    }

    fn clip(&self, index: usize) -> Option<(Step, Vec<usize>)> {
        let (
            Operation::Minimum,
            Places {
                to,
                on: [above, upper, _],
            },
        ) = self.single(index)?
        else {
            return None;
        };
        let (inner, places) = self.maker(above, Operation::Maximum)?;
        let [a, lower, _] = places.on;
        let places = Places {
            to,
            on: [a, lower, upper],
        };
        let kind = Kind::Clip;
        Some((Step { kind, places }, vec![inner]))
    }

    fn pair(&self, index: usize) -> Option<(Step, Vec<usize>)> {
        let (
            operation,
            Places {
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
        let of_left = self.first(left).map(|found| (found, as_left, right));
        let of_right = || self.first(right).map(|found| (found, as_right, left));
        let ((inner, first, [a, b, _]), second, c) = of_left.or_else(of_right)?;
        let step = Step {
            kind: Kind::Pair(first, second),
            places: Places { to, on: [a, b, c] },
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
            let (index, places) = self.maker(register, operation)?;
            Some((index, first, places.on))
        })
    }
}

#[cfg(test)]
mod tests;
