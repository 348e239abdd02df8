//! What the functions of the language become: one or a few operations each.

use super::compile::{Compiler, Operand, Site};
use crate::language::function::Function;
use crate::language::graph::{Full, Graph, NodeId};
use crate::language::operation::Operation;
use crate::language::syntax::{Expression, TextSpan};
use crate::language::unit::ValueUnit;

/// Whole exponents up to this become products.
const LARGEST_PRODUCT: f64 = 8.0;

type Argument<'a> = (&'a Expression, Operand);

/// A call with the right number of arguments.
pub fn call(
    compiler: &mut Compiler<'_>,
    place: Site<'_>,
    span: TextSpan,
    function: Function,
    arguments: &[Argument<'_>],
) -> Option<Operand> {
    let condition = match function {
        Function::If => Some(compiler.expect_condition(place, arguments[0].0, arguments[0].1)?),
        _ => None,
    };
    let numbers = &arguments[usize::from(condition.is_some())..];
    let checked: Vec<Option<Operand>> = numbers
        .iter()
        .map(|(tree, value)| compiler.expect_number(place, tree, *value))
        .collect();
    if checked.iter().any(Option::is_none) {
        return None;
    }
    let unit = unit_of(compiler, place, function, numbers)?;
    let nodes: Vec<NodeId> = numbers.iter().map(|(_, value)| value.node).collect();
    let node = match condition {
        Some(condition) => {
            let on = [condition, nodes[0], nodes[1]];
            compiler.graph.compute(Operation::Select, &on)
        }
        None => spelled_out(&mut compiler.graph, function, &nodes),
    };
    compiler.built(place, span, node, unit)
}

/// The unit of the result; faults where those of the arguments have no meaning together.
fn unit_of(
    compiler: &Compiler<'_>,
    place: Site<'_>,
    function: Function,
    arguments: &[Argument<'_>],
) -> Option<ValueUnit> {
    let (first, value) = arguments[0];
    let name = crate::language::function::ALL
        .iter()
        .find(|(.., entry)| *entry == function)
        .map_or("", |(name, ..)| *name);
    let mut joined = value.unit;
    for argument in &arguments[1..] {
        joined = joined.joined(compiler.joined(place, [arguments[0], *argument], name)?)?;
    }
    match function {
        Function::Exponential
        | Function::Logarithm
        | Function::Sine
        | Function::Cosine
        | Function::Tangent
        | Function::ArcTangent
        | Function::HyperbolicTangent => {
            if !value.unit.is_number() {
                let detail = format!(
                    "`{name}` needs a plain number, but `{}` is in {}",
                    Compiler::shown(place, first.span),
                    value.unit
                );
                compiler.fault(place, first.span, "units_do_not_fit", detail);
                return None;
            }
            Some(ValueUnit::Number)
        }
        Function::Sign | Function::SoftSign | Function::ArcTangent2 => Some(ValueUnit::Number),
        Function::SquareRoot | Function::SignedRoot => {
            Some(joined.power(0.5).unwrap_or(ValueUnit::Any))
        }
        _ => Some(joined),
    }
}

/// The operations of a function.
fn spelled_out(graph: &mut Graph, function: Function, on: &[NodeId]) -> Result<NodeId, Full> {
    let simple = match function {
        Function::Minimum => Operation::Minimum,
        Function::Maximum => Operation::Maximum,
        Function::Absolute => Operation::Absolute,
        Function::Sign => Operation::Sign,
        Function::SquareRoot => Operation::SquareRoot,
        Function::Exponential => Operation::Exponential,
        Function::Logarithm => Operation::Logarithm,
        Function::Sine => Operation::Sine,
        Function::Cosine => Operation::Cosine,
        Function::Tangent => Operation::Tangent,
        Function::ArcTangent => Operation::ArcTangent,
        Function::ArcTangent2 => Operation::ArcTangent2,
        Function::HyperbolicTangent => Operation::HyperbolicTangent,
        Function::If => Operation::Select,
        Function::SoftSign => {
            let ratio = graph.compute(Operation::Divide, &[on[0], on[1]])?;
            return graph.compute(Operation::HyperbolicTangent, &[ratio]);
        }
        Function::SignedRoot => return signed_root(graph, on[0], on[1]),
        Function::DeadBand => return dead_band(graph, on[0], on[1]),
        Function::Clip => {
            let above = graph.compute(Operation::Maximum, &[on[0], on[1]])?;
            return graph.compute(Operation::Minimum, &[above, on[2]]);
        }
    };
    graph.compute(simple, on)
}

/// `d / (d² + w²)^¼`.
fn signed_root(graph: &mut Graph, drop: NodeId, width: NodeId) -> Result<NodeId, Full> {
    let drop_squared = graph.compute(Operation::Multiply, &[drop, drop])?;
    let width_squared = graph.compute(Operation::Multiply, &[width, width])?;
    let sum = graph.compute(Operation::Add, &[drop_squared, width_squared])?;
    let root = graph.compute(Operation::SquareRoot, &[sum])?;
    let root = graph.compute(Operation::SquareRoot, &[root])?;
    graph.compute(Operation::Divide, &[drop, root])
}

/// `max(x − w, 0) + min(x + w, 0)`.
fn dead_band(graph: &mut Graph, x: NodeId, width: NodeId) -> Result<NodeId, Full> {
    let zero = graph.constant(0.0)?;
    let beyond = graph.compute(Operation::Subtract, &[x, width])?;
    let beyond = graph.compute(Operation::Maximum, &[beyond, zero])?;
    let below = graph.compute(Operation::Add, &[x, width])?;
    let below = graph.compute(Operation::Minimum, &[below, zero])?;
    graph.compute(Operation::Add, &[beyond, below])
}

impl Compiler<'_> {
    /// A power: small whole exponents are products, halves are roots.
    pub fn power(
        &mut self,
        place: Site<'_>,
        span: TextSpan,
        [(left, base), (right, exponent)]: [Argument<'_>; 2],
    ) -> Option<Operand> {
        if !exponent.unit.is_number() {
            let detail = format!("an exponent is a plain number, not in {}", exponent.unit);
            self.fault(place, right.span, "units_do_not_fit", detail);
            return None;
        }
        let fixed = self.graph.as_constant(exponent.node);
        let unit = match fixed {
            Some(exponent) => base.unit.power(exponent),
            None => base.unit.is_number().then_some(base.unit),
        };
        if unit.is_none() {
            let detail = format!(
                "`{}` is in {}: this power of it has no unit",
                Self::shown(place, left.span),
                base.unit
            );
            self.fault(place, left.span, "units_do_not_fit", detail);
        }
        let node = match fixed {
            Some(fixed) => fixed_power(&mut self.graph, base.node, fixed),
            None => self
                .graph
                .compute(Operation::Power, &[base.node, exponent.node]),
        };
        self.built(place, span, node, unit?)
    }
}

fn fixed_power(graph: &mut Graph, base: NodeId, exponent: f64) -> Result<NodeId, Full> {
    let size = exponent.abs();
    let power = if size == 0.5 {
        graph.compute(Operation::SquareRoot, &[base])?
    } else if size.fract() == 0.0 && (1.0..=LARGEST_PRODUCT).contains(&size) {
        let mut product = base;
        for _ in 1..size as usize {
            product = graph.compute(Operation::Multiply, &[product, base])?;
        }
        product
    } else {
        let exponent = graph.constant(exponent)?;
        return graph.compute(Operation::Power, &[base, exponent]);
    };
    if exponent > 0.0 {
        return Ok(power);
    }
    let one = graph.constant(1.0)?;
    graph.compute(Operation::Divide, &[one, power])
}
