//! Names, units and functions: the trees of a model's expressions become one graph of numbers.
//!
//! Every fault of every expression is found, each with its line and column. A name that was
//! faulted once is not faulted again through the names that use it.

use super::definition::{Declared, Definition, Written};
use crate::language::graph::{Full, Graph, Leaf, MAX_NODES, NodeId};
use crate::language::operation::Operation;
use crate::language::syntax::{Expression, Syntax, TextSpan};
use crate::language::unit::ValueUnit;
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{Faults, did_you_mean};
use std::collections::{BTreeMap, HashMap, HashSet};

mod operations;

/// Faults among which an unknown name is compared with those that there are.
const MAX_HINTS: usize = 20;

/// How deep trees may stand in each other, also through the names in them.
const MAX_DEPTH: usize = 300;

/// When an expression is computed, which decides what its names may mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Timing {
    /// The plant between the samples, and its outputs.
    Plant,
    /// What is computed once a sample.
    Sample,
    /// What follows from the parameters alone.
    Setup,
}

/// What a name means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Symbol {
    SampleTime,
    Pi,
    Parameter(usize),
    Constant(usize),
    Input(usize),
    Quantity(usize),
    Sampled(usize),
    State(usize),
    Table(usize),
}

/// The value of an expression, ready for an operation.
#[derive(Clone, Copy, Debug)]
pub struct Operand {
    pub node: NodeId,
    pub unit: ValueUnit,
    /// A truth and not a number.
    pub is_condition: bool,
}

/// How far the value of a named quantity has been worked out for one timing.
#[derive(Clone, Copy, Debug)]
enum SymbolValue {
    InWork,
    Failed,
    Done(Operand),
}

/// Puts expressions together.
pub struct Compiler<'d> {
    definition: &'d Definition,
    faults: &'d Faults,
    names: BTreeMap<&'d str, Symbol>,
    values: HashMap<(Timing, Symbol), SymbolValue>,
    used: HashSet<Symbol>,
    depth: usize,
    /// The graph so far.
    pub graph: Graph,
}

/// Where an expression stands that is being read.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    text: &'a Written,
    timing: Timing,
    /// The sampled quantity whose expression it is.
    sampled: Option<usize>,
}

impl<'d> Compiler<'d> {
    /// A compiler that knows the names of a document; two things of one name are faults.
    pub fn new(definition: &'d Definition, faults: &'d Faults) -> Self {
        let mut compiler = Compiler {
            definition,
            faults,
            names: BTreeMap::from([("sample_time", Symbol::SampleTime), ("pi", Symbol::Pi)]),
            values: HashMap::new(),
            used: HashSet::new(),
            depth: 0,
            graph: Graph::default(),
        };
        compiler.declare_all();
        compiler
    }

    fn declare_all(&mut self) {
        let Definition {
            inputs,
            parameters,
            constants,
            tables,
            quantities,
            sampled,
            states,
            ..
        } = self.definition;
        for (index, input) in inputs.iter().enumerate() {
            self.declare(input, Symbol::Input(index));
        }
        for (index, parameter) in parameters.iter().enumerate() {
            self.declare(&parameter.declared, Symbol::Parameter(index));
        }
        for (index, (constant, _)) in constants.iter().enumerate() {
            self.declare(constant, Symbol::Constant(index));
        }
        for (index, table) in tables.iter().enumerate() {
            self.name(&table.name, Symbol::Table(index), &table.pointer);
        }
        for (index, quantity) in quantities.iter().enumerate() {
            self.declare(&quantity.declared, Symbol::Quantity(index));
        }
        for (index, sampled) in sampled.iter().enumerate() {
            self.declare(&sampled.formula.declared, Symbol::Sampled(index));
        }
        for (index, state) in states.iter().enumerate() {
            self.declare(&state.declared, Symbol::State(index));
        }
    }

    fn declare(&mut self, declared: &'d Declared, symbol: Symbol) {
        self.name(&declared.name, symbol, &declared.pointer);
        if let Some(alias) = declared
            .symbol
            .as_ref()
            .filter(|symbol| **symbol != declared.name)
        {
            self.name(alias, symbol, &declared.pointer);
        }
    }

    fn name(&mut self, name: &'d str, symbol: Symbol, pointer: &str) {
        // A function is told from a quantity of its name by the parenthesis behind it.
        let is_function = crate::language::function::find(name).is_some();
        if is_function && matches!(symbol, Symbol::Table(_)) || matches!(name, "and" | "or" | "not")
        {
            let detail = format!("`{name}` is a word of the language");
            self.faults.add(pointer, "name_taken", detail);
        } else if self.names.insert(name, symbol).is_some() {
            let detail = format!("`{name}` means something else already");
            self.faults.add(pointer, "name_taken", detail);
        }
    }

    /// The parameters that no expression uses.
    pub fn unused_parameters(&self) -> impl Iterator<Item = &'d Declared> {
        let parameters = self.definition.parameters.iter().enumerate();
        parameters
            .filter(|(index, _)| !self.used.contains(&Symbol::Parameter(*index)))
            .map(|(_, parameter)| &parameter.declared)
    }

    /// A number in a unit; faults where it has another.
    pub fn number(&mut self, text: &Written, timing: Timing, unit: ValueUnit) -> Option<NodeId> {
        let place = Site {
            text,
            timing,
            sampled: None,
        };
        self.number_at(place, unit)
    }

    /// Reads every named quantity, also one that nothing uses.
    pub fn quantities(&mut self) {
        for index in 0..self.definition.quantities.len() {
            self.symbol_value(Timing::Plant, Symbol::Quantity(index));
        }
    }

    /// The value of a sampled quantity at the sample.
    pub fn sampled(&mut self, index: usize) -> Option<NodeId> {
        let value = self.symbol_value(Timing::Sample, Symbol::Sampled(index))?;
        Some(value.node)
    }

    /// A condition.
    pub fn condition(&mut self, text: &Written) -> Option<NodeId> {
        let place = Site {
            text,
            timing: Timing::Plant,
            sampled: None,
        };
        let tree = text.tree.as_ref()?;
        let value = self.value(place, tree)?;
        self.expect_condition(place, tree, value)
    }

    fn number_at(&mut self, place: Site<'_>, unit: ValueUnit) -> Option<NodeId> {
        let tree = place.text.tree.as_ref()?;
        let value = self.value(place, tree)?;
        let value = self.expect_number(place, tree, value)?;
        if value.unit.joined(unit).is_none() {
            let detail = format!(
                "the expression is in {}, but {unit} is needed here",
                value.unit
            );
            self.fault(place, tree.span, "units_do_not_fit", detail);
        }
        Some(value.node)
    }

    /// Records a fault within an expression.
    pub fn fault(&self, place: Site<'_>, span: TextSpan, code: &'static str, detail: String) {
        if !self.faults.are_full() {
            let fault = Fault::new(&place.text.pointer, code, detail);
            self.faults.push(fault.within(span.place(&place.text.text)));
        }
    }

    /// The text of a part of an expression, short.
    pub fn shown(place: Site<'_>, span: TextSpan) -> String {
        let text = place
            .text
            .text
            .get(span.start..span.end)
            .unwrap_or_default();
        if text.chars().count() <= 40 {
            return text.to_owned();
        }
        let start: String = text.chars().take(37).collect();
        format!("{start}…")
    }

    /// The value of a tree.
    fn value(&mut self, place: Site<'_>, tree: &Expression) -> Option<Operand> {
        if self.depth >= MAX_DEPTH {
            let detail = "nested too deeply through names; define quantities before their use";
            self.fault(place, tree.span, "too_deep", detail.to_owned());
            return None;
        }
        self.depth += 1;
        let value = self.value_of_kind(place, tree);
        self.depth -= 1;
        value
    }

    fn value_of_kind(&mut self, place: Site<'_>, tree: &Expression) -> Option<Operand> {
        match &tree.kind {
            Syntax::Number(value) => {
                let node = self.graph.constant(*value);
                self.built(place, tree.span, node, ValueUnit::Number)
            }
            Syntax::Name(name) => self.named(place, tree.span, name),
            Syntax::Negative(inner) => {
                let value = self.value(place, inner);
                let value = self.expect_number(place, inner, value?)?;
                let node = self.graph.compute(Operation::Negate, &[value.node]);
                self.built(place, tree.span, node, value.unit)
            }
            Syntax::Not(inner) => {
                let value = self.value(place, inner);
                let node = self.expect_condition(place, inner, value?)?;
                let one = self.graph.constant(1.0).ok()?;
                let node = self.graph.compute(Operation::Subtract, &[one, node]);
                self.truth(place, tree.span, node)
            }
            Syntax::Binary(operator, sides) => self.binary(place, tree.span, *operator, sides),
            Syntax::Call(name, arguments) => self.call(place, tree.span, name, arguments),
        }
    }

    /// What an operation made, or the fault that the graph is full.
    pub fn built(
        &self,
        place: Site<'_>,
        span: TextSpan,
        node: Result<NodeId, Full>,
        unit: ValueUnit,
    ) -> Option<Operand> {
        if node.is_err() {
            let detail = format!("the model has more than {MAX_NODES} operations");
            self.fault(place, span, "too_large", detail);
        }
        let node = node.ok()?;
        Some(Operand {
            node,
            unit,
            is_condition: false,
        })
    }

    fn truth(
        &self,
        place: Site<'_>,
        span: TextSpan,
        node: Result<NodeId, Full>,
    ) -> Option<Operand> {
        let value = self.built(place, span, node, ValueUnit::Number)?;
        Some(Operand {
            is_condition: true,
            ..value
        })
    }

    /// Answers the value where it is a number.
    pub fn expect_number(
        &self,
        place: Site<'_>,
        tree: &Expression,
        value: Operand,
    ) -> Option<Operand> {
        if value.is_condition {
            let shown = Self::shown(place, tree.span);
            let detail = format!(
                "`{shown}` is a condition where a number is needed; write `if({shown}, 1, 0)`"
            );
            self.fault(place, tree.span, "condition_not_number", detail);
            return None;
        }
        Some(value)
    }

    /// Answers the node where it is a condition.
    pub fn expect_condition(
        &self,
        place: Site<'_>,
        tree: &Expression,
        value: Operand,
    ) -> Option<NodeId> {
        if !value.is_condition {
            let shown = Self::shown(place, tree.span);
            let detail =
                format!("`{shown}` is a number where a condition is needed, e.g. `{shown} > 0`");
            self.fault(place, tree.span, "number_not_condition", detail);
            return None;
        }
        Some(value.node)
    }

    fn named(&mut self, place: Site<'_>, span: TextSpan, name: &str) -> Option<Operand> {
        let Some(&symbol) = self.names.get(name) else {
            if self.faults.are_full() {
                return None;
            }
            let hint = self.hint(name);
            let detail = format!("`{name}` is not a name here{hint}");
            self.fault(place, span, "unknown_name", detail);
            return None;
        };
        self.used.insert(symbol);
        if let Some(why) = self.forbidden(place.timing, symbol) {
            self.fault(
                place,
                span,
                "name_not_possible_here",
                format!("`{name}` {why}"),
            );
            return None;
        }
        if place
            .sampled
            .is_some_and(|sampled| symbol == Symbol::Sampled(sampled))
        {
            return self.previous(place, span, symbol);
        }
        if matches!(
            self.values.get(&(place.timing, symbol)),
            Some(SymbolValue::InWork)
        ) {
            let detail = format!("`{name}` depends on itself: an algebraic loop");
            self.fault(place, span, "algebraic_loop", detail);
            return None;
        }
        self.symbol_value(place.timing, symbol)
    }

    /// The name that an author may have meant by an unknown one. The search is dear: not among very many faults.
    fn hint(&self, name: &str) -> String {
        if self.faults.count() >= MAX_HINTS {
            return String::new();
        }
        did_you_mean(name, self.names.keys().copied())
    }

    fn forbidden(&self, timing: Timing, symbol: Symbol) -> Option<&'static str> {
        match symbol {
            Symbol::Table(_) => Some("is a table: write its argument behind it, in parentheses"),
            Symbol::Input(_) | Symbol::State(_) | Symbol::Sampled(_) if timing == Timing::Setup => {
                Some("changes with time; only parameters and constants can stand here")
            }
            _ => None,
        }
    }

    fn symbol_value(&mut self, timing: Timing, symbol: Symbol) -> Option<Operand> {
        match self.values.get(&(timing, symbol)) {
            Some(SymbolValue::Done(value)) => return Some(*value),
            Some(_) => return None,
            None => {}
        }
        self.values.insert((timing, symbol), SymbolValue::InWork);
        let value = self.new_value(timing, symbol);
        let outcome = value.map_or(SymbolValue::Failed, SymbolValue::Done);
        self.values.insert((timing, symbol), outcome);
        value
    }

    fn new_value(&mut self, timing: Timing, symbol: Symbol) -> Option<Operand> {
        let definition = self.definition;
        let number = |node: Result<NodeId, Full>, unit| {
            let node = node.ok()?;
            let is_condition = false;
            Some(Operand {
                node,
                unit,
                is_condition,
            })
        };
        match symbol {
            Symbol::Table(_) => None,
            Symbol::Pi => number(self.graph.constant(std::f64::consts::PI), ValueUnit::Number),
            Symbol::SampleTime => {
                let second = ValueUnit::Known(greybox_numerics::dimension::Dimension::SECOND);
                number(self.graph.leaf(Leaf::SampleTime), second)
            }
            Symbol::Constant(index) => {
                let (declared, value) = &definition.constants[index];
                number(self.graph.constant(*value), declared.unit)
            }
            Symbol::Parameter(index) => {
                let unit = definition.parameters[index].declared.unit;
                number(self.graph.leaf(Leaf::Parameter(index as u16)), unit)
            }
            Symbol::Input(index) => {
                let leaf = match timing {
                    Timing::Sample => Leaf::Recorded(index as u16),
                    _ => Leaf::Input(index as u16),
                };
                number(self.graph.leaf(leaf), definition.inputs[index].unit)
            }
            Symbol::State(index) => {
                let unit = definition.states[index].declared.unit;
                number(self.graph.leaf(Leaf::State(index as u16)), unit)
            }
            Symbol::Sampled(index) if timing != Timing::Sample => {
                let unit = definition.sampled[index].formula.declared.unit;
                number(self.graph.leaf(Leaf::Sampled(index as u16)), unit)
            }
            Symbol::Sampled(index) => {
                let formula = &definition.sampled[index].formula;
                self.formula(&formula.text, &formula.declared, timing, Some(index))
            }
            Symbol::Quantity(index) => {
                let formula = &definition.quantities[index];
                self.formula(&formula.text, &formula.declared, timing, None)
            }
        }
    }

    fn formula(
        &mut self,
        text: &'d Written,
        declared: &Declared,
        timing: Timing,
        sampled: Option<usize>,
    ) -> Option<Operand> {
        let place = Site {
            text,
            timing,
            sampled,
        };
        let tree = text.tree.as_ref()?;
        let value = self.value(place, tree)?;
        if value.is_condition {
            return Some(value);
        }
        let Some(joined) = value.unit.joined(declared.unit) else {
            let (name, declared_unit) = (&declared.name, declared.unit);
            let detail = format!(
                "`{name}` is declared in {declared_unit}, but its expression is in {}",
                value.unit
            );
            self.fault(place, tree.span, "units_do_not_fit", detail);
            return None;
        };
        // A formula without a declared unit has that of its expression.
        let unit = if declared.unit_text.is_empty() {
            value.unit
        } else {
            joined
        };
        Some(Operand { unit, ..value })
    }
}
