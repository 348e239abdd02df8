//! A program leaves what its list leaves, to the last bit.

use super::*;
use greybox_numerics::lanes::{LANES, Lanes};
use proptest::prelude::*;

const OPERATIONS: [Operation; 10] = [
    Operation::Add,
    Operation::Subtract,
    Operation::Multiply,
    Operation::Divide,
    Operation::Minimum,
    Operation::Maximum,
    Operation::SquareRoot,
    Operation::AtLeast,
    Operation::Select,
    Operation::HyperbolicTangent,
];

/// Registers that hold numbers before the list begins.
const GIVEN: u16 = 6;

/// A list in an order of computation, and a signed root and a clip at its end.
fn list(choices: &[(usize, [u16; 3])]) -> Vec<Instruction> {
    let mut list: Vec<Instruction> = Vec::new();
    let push = |list: &mut Vec<Instruction>, operation: Operation, on: [u16; 3]| {
        let to = GIVEN + list.len() as u16;
        list.push(Instruction { operation, to, on });
        to
    };
    for (operation, on) in choices {
        let made = GIVEN + list.len() as u16;
        push(
            &mut list,
            OPERATIONS[operation % 10],
            on.map(|place| place % made),
        );
    }
    let square = push(&mut list, Operation::Multiply, [0, 0, 0]);
    let sum = push(&mut list, Operation::Add, [1, square, 1]);
    let inner = push(&mut list, Operation::SquareRoot, [sum; 3]);
    let outer = push(&mut list, Operation::SquareRoot, [inner; 3]);
    let root = push(&mut list, Operation::Divide, [0, outer, 0]);
    let above = push(&mut list, Operation::Maximum, [root, 2, root]);
    push(&mut list, Operation::Minimum, [above, 3, above]);
    list
}

fn run(program: &Joined) -> Vec<Lanes> {
    let mut registers = Box::new([Lanes::splat(f64::NAN); MAX_NODES]);
    for (place, register) in registers[..usize::from(GIVEN)].iter_mut().enumerate() {
        let number = |lane: usize| (place as f64 - 2.25) * (1.0 + 0.5 * lane as f64);
        *register = Lanes(std::array::from_fn(number));
    }
    program.run(&mut registers, &[]);
    registers.to_vec()
}

fn one_by_one(list: &[Instruction]) -> Vec<Lanes> {
    let mut program = Joined::default();
    for instruction in list {
        program.runs.push(JoinedRun {
            kind: JoinedKind::Single(instruction.operation),
            length: 1,
        });
        program.operands.push(Operands {
            to: instruction.to,
            on: instruction.on,
        });
    }
    run(&program)
}

fn bits(row: &Lanes) -> [u64; LANES] {
    row.0
        .map(|number| if number.is_nan() { f64::NAN } else { number }.to_bits())
}

proptest! {
    #[test]
    fn a_program_leaves_the_bits_that_its_list_leaves(
        choices in prop::collection::vec((0..10usize, [0..1000u16, 0..1000, 0..1000]), 1..60),
        wanted in prop::collection::vec(0..60usize, 0..5),
    ) {
        let list = list(&choices);
        let expected = one_by_one(&list);
        let all = run(&Joined::all(&list));
        for instruction in &list {
            let place = usize::from(instruction.to);
            prop_assert_eq!(bits(&all[place]), bits(&expected[place]));
        }
        let last = list.len() - 1;
        let wanted = wanted.iter().map(|at| list[at % list.len()].to).chain([list[last].to]);
        let wanted: Vec<u16> = wanted.collect();
        let joined = run(&Joined::new(&list, wanted.iter().copied()));
        for place in wanted.into_iter().map(usize::from) {
            prop_assert_eq!(bits(&joined[place]), bits(&expected[place]));
        }
    }
}

#[test]
fn what_belongs_together_is_one_instruction() {
    let list = list(&[]);
    let last = list.len() - 1;
    let program = Joined::new(&list, [list[last].to]);
    let kinds: Vec<JoinedKind> = program.runs.iter().map(|run| run.kind).collect();
    assert_eq!(kinds, [JoinedKind::SignedRoot, JoinedKind::Clip]);
}
