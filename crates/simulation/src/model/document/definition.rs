//! A model document as its author wrote it: the names, units and texts, before the equations are
//! put together.

use crate::language::operation::LookupTable;
use crate::language::syntax::Expression;
use crate::language::unit::ValueUnit;
use crate::model::{Scale, Tolerance};

/// A document, read.
#[derive(Debug, Default)]
pub struct Definition {
    pub name: String,
    pub title: String,
    pub summary: String,
    pub source: String,
    pub inputs: Vec<Declared>,
    pub parameters: Vec<Parameter>,
    pub constants: Vec<(Declared, f64)>,
    pub tables: Vec<NamedTable>,
    pub quantities: Vec<Formula>,
    pub sampled: Vec<Sampled>,
    pub states: Vec<StateDefinition>,
    pub outputs: Vec<Formula>,
    pub options: ModelOptions,
}

/// A name with its unit.
#[derive(Clone, Debug)]
pub struct Declared {
    pub name: String,
    pub symbol: Option<String>,
    pub unit: ValueUnit,
    pub unit_text: String,
    pub meaning: String,
    pub pointer: String,
}

impl Declared {
    /// The symbol, or the name where there is no symbol.
    pub fn written_as(&self) -> &str {
        self.symbol.as_deref().unwrap_or(&self.name)
    }

    /// A name that takes any unit.
    pub fn of_any_unit(name: &str, pointer: &str) -> Declared {
        Declared {
            name: name.to_owned(),
            symbol: None,
            unit: ValueUnit::Any,
            unit_text: String::new(),
            meaning: String::new(),
            pointer: pointer.to_owned(),
        }
    }
}

#[derive(Debug)]
pub struct Parameter {
    pub declared: Declared,
    pub default: f64,
    pub bounds: [f64; 2],
    pub scale: Scale,
    pub unknown: bool,
    pub limits: [Option<f64>; 2],
    pub tolerance: Option<Tolerance>,
}

#[derive(Debug)]
pub struct NamedTable {
    pub name: String,
    pub table: LookupTable,
    pub units: [ValueUnit; 2],
    pub pointer: String,
}

/// The text of an expression, and its tree where it has one.
#[derive(Debug)]
pub struct Written {
    pub pointer: String,
    pub text: String,
    pub tree: Option<Expression>,
}

#[derive(Debug)]
pub struct Formula {
    pub declared: Declared,
    pub text: Written,
}

/// What is computed once a sample and held.
#[derive(Debug)]
pub struct Sampled {
    pub formula: Formula,
    /// What the quantity was before the first sample, where it remembers itself.
    pub initial: Option<Written>,
}

#[derive(Debug)]
pub struct StateDefinition {
    pub declared: Declared,
    pub derivative: Written,
    pub initial: Initial,
    pub scale: Option<f64>,
}

#[derive(Debug)]
pub enum Initial {
    /// What follows from the parameters.
    Computed(Written),
    /// Read off an output.
    Measured {
        kind: Measured,
        output: String,
        pointer: String,
        /// Where the state starts when the output is not recorded.
        otherwise: Option<Written>,
    },
}

/// How a state starts that an output shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measured {
    /// At the first sample.
    First,
    /// Estimated near the first sample.
    Near,
    /// Estimated near the first slope.
    NearSlope,
}

#[derive(Debug, Default)]
pub struct ModelOptions {
    pub first_order_hold: bool,
    pub delay: Option<Written>,
    pub fastest_rate: Option<Written>,
    pub valid_while: Option<Written>,
    /// Where the author lists kinks of the rates: read for documents that have the list, though
    /// steps follow from their errors and need no mention of kinks.
    pub kinks: Option<Vec<Written>>,
}
