//! Quantities that are calculated from recorded ones, sample by sample: `area*sqrt(2*dp/density)`.

use super::compile::{Compiler, Timing};
use super::definition::{Declared, Definition, Written};
use crate::language::graph::{Graph, GraphNode, Leaf, NodeId};
use crate::language::syntax;
use crate::language::unit::ValueUnit;
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::Faults;

/// A quantity that an equation may use.
#[derive(Clone, Copy, Debug)]
pub struct Quantity<'a> {
    /// The name that the equation has for it.
    pub name: &'a str,
    /// The SI unit; empty where it is not checked.
    pub unit: &'a str,
}

/// An equation, ready to be calculated at each sample.
#[derive(Debug)]
pub struct Calculation {
    graph: Graph,
    result: NodeId,
    /// The quantities that the result needs, by their places.
    used: Vec<usize>,
}

impl Calculation {
    /// Reads an equation for a result in the SI unit `unit`, which is empty where it is not checked.
    ///
    /// # Errors
    /// Everything that is wrong with the text, each fault with line and column.
    pub fn compile(
        text: &str,
        pointer: &str,
        quantities: &[Quantity<'_>],
        unit: &str,
    ) -> Result<Self, Vec<Fault>> {
        let tree = syntax::parse(text).map_err(|error| {
            let fault = Fault::new(pointer, "expression_not_understood", error.detail);
            vec![fault.within(error.span.place(text))]
        })?;
        let definition = Definition {
            inputs: quantities
                .iter()
                .map(|quantity| Declared {
                    unit: unit_of(quantity.unit),
                    unit_text: quantity.unit.to_owned(),
                    ..Declared::of_any_unit(quantity.name, pointer)
                })
                .collect(),
            ..Definition::default()
        };
        let faults = Faults::default();
        let mut compiler = Compiler::new(&definition, &faults);
        let written = Written {
            pointer: pointer.to_owned(),
            text: text.to_owned(),
            tree: Some(tree),
        };
        let result = compiler.number(&written, Timing::Plant, unit_of(unit));
        let graph = compiler.graph;
        match (result, faults.into_vec()) {
            (Some(result), faults) if faults.is_empty() => Ok(Self {
                used: used(&graph, result),
                graph,
                result,
            }),
            (_, faults) => Err(faults),
        }
    }

    /// The quantities that the result needs, by their places among those that the equation might use.
    #[must_use]
    pub fn used(&self) -> &[usize] {
        &self.used
    }

    /// The result where quantity `k` is `quantity(k)`, and samples are `sample_time` `[s]` apart. NaN where a
    /// quantity that the result needs is NaN. `computed` is memory for the work.
    #[must_use]
    pub fn value(
        &self,
        quantity: impl Fn(usize) -> f64,
        sample_time: f64,
        computed: &mut Vec<f64>,
    ) -> f64 {
        if self.used.iter().any(|place| quantity(*place).is_nan()) {
            return f64::NAN;
        }
        let leaf = |leaf| match leaf {
            Leaf::Input(place) => quantity(usize::from(place)),
            Leaf::SampleTime => sample_time,
            _ => f64::NAN,
        };
        self.graph.value(self.result, leaf, computed)
    }
}

/// A unit that the language does not know is not checked.
fn unit_of(unit: &str) -> ValueUnit {
    ValueUnit::parse(unit).unwrap_or(ValueUnit::Any)
}

fn used(graph: &Graph, result: NodeId) -> Vec<usize> {
    let nodes = graph.nodes().iter().zip(graph.needed([result]));
    let places = nodes.filter_map(|(node, needed)| match node {
        GraphNode::Leaf(Leaf::Input(place)) if needed => Some(usize::from(*place)),
        _ => None,
    });
    places.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUANTITIES: [Quantity<'_>; 3] = [
        Quantity {
            name: "dp",
            unit: "Pa",
        },
        Quantity {
            name: "speed",
            unit: "m/s",
        },
        Quantity {
            name: "level",
            unit: "",
        },
    ];

    fn value(text: &str, unit: &str, values: [f64; 3]) -> f64 {
        let calculation = Calculation::compile(text, "/equation", &QUANTITIES, unit).unwrap();
        calculation.value(|place| values[place], 0.5, &mut Vec::new())
    }

    #[test]
    fn an_equation_is_calculated_from_the_quantities_that_it_needs() {
        assert_eq!(value("dp*speed", "W/m^2", [3.0, 4.0, f64::NAN]), 12.0);
        assert_eq!(
            value("if(level > 2, speed, 0)", "m/s", [f64::NAN, 4.0, 3.0]),
            4.0
        );
        assert_eq!(value("speed*sample_time", "", [0.0, 4.0, 0.0]), 2.0);
        assert!(value("max(dp, 1)", "Pa", [f64::NAN, 0.0, 0.0]).is_nan());
    }

    #[test]
    fn an_equation_that_makes_no_sense_is_refused_at_its_place() {
        for (text, unit, code, column) in [
            ("dp + speed", "Pa", "units_do_not_fit", "6"),
            ("dp*speed", "Pa", "units_do_not_fit", "1"),
            ("dp +", "Pa", "expression_not_understood", "5"),
            ("presure", "Pa", "unknown_name", "1"),
            ("dp > 3", "", "condition_not_number", "1"),
        ] {
            let faults = Calculation::compile(text, "/equation", &QUANTITIES, unit).unwrap_err();
            assert_eq!(faults[0].code, code, "{text}: {faults:?}");
            assert_eq!(
                faults[0].column.as_deref(),
                Some(column),
                "{text}: {faults:?}"
            );
        }
    }
}
