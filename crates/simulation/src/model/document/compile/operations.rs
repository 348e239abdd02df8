//! Operators, calls and tables: what stands between names, with the units that fit.

use super::super::expansion;
use super::{Compiler, Operand, Site, Symbol};
use crate::language::function;
use crate::language::graph::Leaf;
use crate::language::operation::Operation;
use crate::language::syntax::{Expression, Operator, TextSpan};
use crate::language::unit::ValueUnit;
use greybox_numerics::parsing::reader::did_you_mean;

impl Compiler<'_> {
    /// A sampled quantity in its own expression is its value at the sample before.
    pub(super) fn previous(
        &mut self,
        place: Site<'_>,
        span: TextSpan,
        symbol: Symbol,
    ) -> Option<Operand> {
        let Symbol::Sampled(index) = symbol else {
            return None;
        };
        let sampled = &self.definition.sampled[index];
        let name = &sampled.formula.declared.name;
        if sampled.initial.is_none() {
            let detail = format!(
                "`{name}` depends on itself: an algebraic loop; with `initial` it means its value \
                 at the sample before"
            );
            self.fault(place, span, "algebraic_loop", detail);
            return None;
        }
        let node = self.graph.leaf(Leaf::Previous(index as u16));
        self.built(place, span, node, sampled.formula.declared.unit)
    }

    pub(super) fn binary(
        &mut self,
        place: Site<'_>,
        span: TextSpan,
        operator: Operator,
        sides: &[Expression; 2],
    ) -> Option<Operand> {
        let [left, right] = sides;
        let values = (self.value(place, left), self.value(place, right));
        let (a, b) = (values.0?, values.1?);
        if matches!(operator, Operator::And | Operator::Or) {
            let conditions = (
                self.expect_condition(place, left, a),
                self.expect_condition(place, right, b),
            );
            let operation = match operator {
                Operator::And => Operation::Minimum,
                _ => Operation::Maximum,
            };
            let node = self
                .graph
                .compute(operation, &[conditions.0?, conditions.1?]);
            return self.truth(place, span, node);
        }
        let numbers = (
            self.expect_number(place, left, a),
            self.expect_number(place, right, b),
        );
        let (a, b) = (numbers.0?, numbers.1?);
        let pair = [(left, a), (right, b)];
        let (operation, on) = match operator {
            Operator::Power => return self.power(place, span, pair),
            Operator::Multiply => (Operation::Multiply, [a.node, b.node]),
            Operator::Divide => (Operation::Divide, [a.node, b.node]),
            Operator::Add => (Operation::Add, [a.node, b.node]),
            Operator::Subtract => (Operation::Subtract, [a.node, b.node]),
            Operator::Greater => (Operation::Above, [a.node, b.node]),
            Operator::Less => (Operation::Above, [b.node, a.node]),
            Operator::GreaterOrEqual => (Operation::AtLeast, [a.node, b.node]),
            _ => (Operation::AtLeast, [b.node, a.node]),
        };
        let unit = match operator {
            Operator::Multiply => a.unit.times(b.unit),
            Operator::Divide => a.unit.over(b.unit),
            _ => self.joined(place, pair, operator.symbol())?,
        };
        let node = self.graph.compute(operation, &on);
        match operation {
            Operation::Above | Operation::AtLeast => self.truth(place, span, node),
            _ => self.built(place, span, node, unit),
        }
    }

    /// The common unit of two values; a fault with both spelled out where there is none.
    pub fn joined(
        &self,
        place: Site<'_>,
        [(left, a), (right, b)]: [(&Expression, Operand); 2],
        by: &str,
    ) -> Option<ValueUnit> {
        let unit = a.unit.joined(b.unit);
        if unit.is_none() {
            let detail = format!(
                "`{}` is in {} and `{}` is in {}: they cannot be joined by `{by}`",
                Self::shown(place, left.span),
                a.unit,
                Self::shown(place, right.span),
                b.unit
            );
            self.fault(place, right.span, "units_do_not_fit", detail);
        }
        unit
    }

    pub(super) fn call(
        &mut self,
        place: Site<'_>,
        span: TextSpan,
        name: &str,
        arguments: &[Expression],
    ) -> Option<Operand> {
        let values: Vec<Option<Operand>> = arguments
            .iter()
            .map(|argument| self.value(place, argument))
            .collect();
        let table = match self.names.get(name) {
            Some(&Symbol::Table(index)) => Some(index),
            _ => None,
        };
        let function = function::find(name);
        let expected: &[&str] = match (&table, &function) {
            (Some(_), _) => &["x"],
            (None, Some((_, arguments))) => arguments,
            (None, None) if self.faults.are_full() => return None,
            (None, None) => {
                let tables = self
                    .definition
                    .tables
                    .iter()
                    .map(|table| table.name.as_str());
                let functions = function::ALL.iter().map(|(name, ..)| *name);
                let hint = did_you_mean(name, functions.chain(tables));
                let detail = format!("`{name}` is not a function{hint}");
                self.fault(place, span, "unknown_function", detail);
                return None;
            }
        };
        if arguments.len() != expected.len() {
            let detail = format!(
                "`{name}` takes {} arguments, `{name}({})`, not {}",
                expected.len(),
                expected.join(", "),
                arguments.len()
            );
            self.fault(place, span, "wrong_number_of_arguments", detail);
            return None;
        }
        let values: Vec<Operand> = values.into_iter().collect::<Option<_>>()?;
        let arguments: Vec<(&Expression, Operand)> = arguments.iter().zip(values).collect();
        match (table, function) {
            (Some(index), _) => self.look_up(place, span, index, &arguments),
            (_, Some((function, _))) => expansion::call(self, place, span, function, &arguments),
            _ => None,
        }
    }

    fn look_up(
        &mut self,
        place: Site<'_>,
        span: TextSpan,
        index: usize,
        arguments: &[(&Expression, Operand)],
    ) -> Option<Operand> {
        let (tree, value) = arguments[0];
        let value = self.expect_number(place, tree, value)?;
        let table = &self.definition.tables[index];
        let [x, y] = table.units;
        if value.unit.joined(x).is_none() {
            let detail = format!("the table `{}` is over {x}, not {}", table.name, value.unit);
            self.fault(place, tree.span, "units_do_not_fit", detail);
        }
        self.used.insert(Symbol::Table(index));
        let operation = Operation::Table(index as u8);
        let node = self.graph.compute(operation, &[value.node]);
        self.built(place, span, node, y)
    }
}
