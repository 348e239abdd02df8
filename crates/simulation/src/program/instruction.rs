//! What a program is made of: instructions over registers.

use crate::language::graph::MAX_NODES;
use crate::language::operation::Operation;
use greybox_numerics::lanes::Real;

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
    /// The operation of the instruction.
    pub operation: Operation,
    /// Where the result goes.
    pub to: Register,
    /// The registers that the operation reads; those that the operation does not use repeat the first.
    pub on: [Register; 3],
}
