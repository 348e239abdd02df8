//! A document that can run: its definition, its expressions in one graph, and the program of both.

use super::compile::{Compiler, Timing};
use super::definition::{Definition, Initial, Written};
use crate::language::graph::NodeId;
use crate::language::unit::ValueUnit;
use crate::model::Model;
use crate::program::{EquationGraph, Program, Roots};
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{Faults, Field};
use serde_json::Value;

/// A document that can run.
#[derive(Debug)]
pub struct Read {
    /// The model.
    pub model: Model,
    /// Warnings for the author: parameters that nothing uses.
    pub warnings: Vec<Fault>,
}

/// Reads a document into a model.
///
/// # Errors
/// Everything that is wrong with it, each fault with a JSON pointer, and in an expression with
/// line and column.
pub fn read(document: &Value) -> Result<Read, Vec<Fault>> {
    let faults = Faults::default();
    let read = read_into(document, &faults);
    let faults = faults.into_vec();
    match read {
        Some(read) if faults.is_empty() => Ok(read),
        _ => Err(faults),
    }
}

fn read_into(document: &Value, faults: &Faults) -> Option<Read> {
    let definition = super::reading::read(&Field::root(document, faults), faults)?;
    let mut compiler = Compiler::new(&definition, faults);
    compiler.quantities();
    let roots = roots(&definition, &mut compiler);
    let description = super::describe::describe(&definition, faults);
    let warnings = compiler.unused_parameters().map(|parameter| {
        let detail = format!("no expression uses `{}`", parameter.name);
        Fault::new(&parameter.pointer, "unused_parameter", detail)
    });
    let kinks = definition.options.kinks.as_ref().map(|_| {
        let detail = "steps follow from their errors: kinks need not be listed".to_owned();
        Fault::new("/options/kinks", "not_needed", detail)
    });
    let warnings = warnings.chain(kinks).collect();
    if faults.count() > 0 {
        return None;
    }
    let roots = roots?;
    let moving_inputs = definition.options.first_order_hold;
    let tables = definition.tables.iter().map(|named| named.table.clone());
    let equations = EquationGraph {
        graph: compiler.graph,
        roots,
    };
    let sizes: Vec<Option<f64>> = definition.states.iter().map(|state| state.scale).collect();
    let plant = Program::new(
        &equations,
        tables.collect(),
        &sizes,
        &description.defaults(),
        moving_inputs,
    );
    Some(Read {
        model: Model::of_program(description, plant),
        warnings,
    })
}

/// Every expression of the document; none where one of them is wrong.
fn roots(definition: &Definition, compiler: &mut Compiler<'_>) -> Option<Roots> {
    let second = ValueUnit::Known(greybox_numerics::dimension::Dimension::SECOND);
    let options = &definition.options;
    let mut setup = |text: &Option<Written>, unit| {
        text.as_ref()
            .map(|text| compiler.number(text, Timing::Setup, unit))
    };
    let delay = setup(&options.delay, second);
    let per_second = second.power(-1.0).unwrap_or(ValueUnit::Any);
    let fastest_rate = setup(&options.fastest_rate, per_second);
    let mut initial = Vec::new();
    let mut rates = Vec::new();
    for state in &definition.states {
        let unit = state.declared.unit;
        rates.push(compiler.number(&state.derivative, Timing::Plant, unit.per_second()));
        initial.push(match &state.initial {
            Initial::Computed(text) => compiler.number(text, Timing::Setup, unit),
            Initial::Measured {
                otherwise: Some(text),
                ..
            } => compiler.number(text, Timing::Setup, unit),
            Initial::Measured { .. } => compiler.graph.constant(0.0).ok(),
        });
    }
    let outputs: Vec<Option<NodeId>> = definition
        .outputs
        .iter()
        .map(|output| compiler.number(&output.text, Timing::Plant, output.declared.unit))
        .collect();
    let mut sampled = Vec::new();
    for (index, quantity) in definition.sampled.iter().enumerate() {
        let unit = quantity.formula.declared.unit;
        let initial = quantity.initial.as_ref();
        let initial = initial.map(|text| compiler.number(text, Timing::Setup, unit));
        sampled.push((compiler.sampled(index), initial));
    }
    let valid = options.valid_while.as_ref();
    let valid = valid.map(|text| compiler.condition(text));
    Some(Roots {
        rates: rates.into_iter().collect::<Option<_>>()?,
        outputs: outputs.into_iter().collect::<Option<_>>()?,
        initial: initial.into_iter().collect::<Option<_>>()?,
        sampled: sampled
            .into_iter()
            .map(|(node, initial)| {
                let initial = match initial {
                    Some(initial) => Some(initial?),
                    None => None,
                };
                Some((node?, initial))
            })
            .collect::<Option<_>>()?,
        delay: present(delay)?,
        fastest_rate: present(fastest_rate)?,
        valid: present(valid)?,
    })
}

/// An option that is not there is fine; one that is wrong is not.
fn present(option: Option<Option<NodeId>>) -> Option<Option<NodeId>> {
    match option {
        None => Some(None),
        Some(node) => node.map(Some),
    }
}
