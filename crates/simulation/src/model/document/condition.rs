//! Conditions on the parameters of a model: `tau1 < tau2`, `k1 + k2 <= 1`.

use super::compile::{Compiler, Timing};
use super::definition::{Declared, Definition, Parameter, Written};
use crate::language::graph::{Graph, GraphNode, Leaf, NodeId};
use crate::language::syntax::{self, Expression, Operator, Syntax};
use crate::language::unit::ValueUnit;
use crate::model::{ModelDescription, ParameterDescription};
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{Faults, Field};
use std::sync::Arc;

/// What comes with `<` and with `<=` is the same to a number: on the border it holds.
const NO_COMPARISON: &str = "a condition compares two expressions with <, <=, > or >=";

/// A condition on the parameters of a model: an expression of them is at most another.
#[derive(Clone, Debug)]
pub struct Condition {
    /// As it was written; several of one text share it.
    text: Arc<str>,
    graph: Arc<Graph>,
    /// The larger side less the smaller one.
    slack: NodeId,
    /// The parameters on its sides, by their places.
    parameters: Vec<usize>,
}

impl Condition {
    /// Reads a text: a comparison, a chain of them (`0 < a < b`), or several joined by `and`.
    /// Faults go to the field.
    #[must_use]
    pub fn read(field: &Field<'_>, model: &ModelDescription) -> Vec<Condition> {
        let Some(text) = field.text() else {
            return Vec::new();
        };
        let conditions = Condition::compile(text, &field.pointer, model);
        conditions.unwrap_or_else(|faults| {
            faults.into_iter().for_each(|fault| field.push(fault));
            Vec::new()
        })
    }

    /// The conditions that a text stands for.
    ///
    /// # Errors
    /// Everything that is wrong with it, each fault with line and column.
    pub fn compile(
        text: &str,
        pointer: &str,
        model: &ModelDescription,
    ) -> Result<Vec<Condition>, Vec<Fault>> {
        let fault = |code: &'static str, detail: String, span: syntax::TextSpan| {
            vec![Fault::new(pointer, code, detail).within(span.place(text))]
        };
        let tree = syntax::parse(text);
        let tree =
            tree.map_err(|error| fault("expression_not_understood", error.detail, error.span))?;
        let mut compared = Vec::new();
        if comparisons(&tree, &mut compared).is_none() {
            return Err(fault(
                "not_a_condition",
                NO_COMPARISON.to_owned(),
                tree.span,
            ));
        }
        let faults = Faults::default();
        let definition = definition_of(model);
        let mut compiler = Compiler::new(&definition, &faults);
        let spelled = |tree| Written {
            pointer: pointer.to_owned(),
            text: text.to_owned(),
            tree: Some(tree),
        };
        let nodes: Vec<Option<NodeId>> = compared
            .into_iter()
            .map(|sides| {
                // What does not fit together is told of the comparison, not of the difference.
                compiler.condition(&spelled(sides.comparison))?;
                compiler.number(&spelled(sides.difference), Timing::Setup, ValueUnit::Any)
            })
            .collect();
        let graph = Arc::new(compiler.graph);
        let conditions = nodes.into_iter().flatten().map(|slack| Condition {
            text: text.into(),
            parameters: parameters(&graph, slack),
            graph: Arc::clone(&graph),
            slack,
        });
        let conditions: Vec<Condition> = conditions.collect();
        let faults = faults.into_vec();
        if !faults.is_empty() {
            return Err(faults);
        }
        if conditions
            .iter()
            .any(|condition| condition.parameters.is_empty())
        {
            let detail = "no parameter of the model stands in it".to_owned();
            return Err(fault("not_a_condition", detail, tree.span));
        }
        Ok(conditions)
    }

    /// As it was written.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The parameters on its sides, by their places in the model's description.
    #[must_use]
    pub fn parameters(&self) -> &[usize] {
        &self.parameters
    }

    /// The larger side less the smaller one, with a value for each parameter: it holds where this
    /// is at least 0.
    #[must_use]
    pub fn slack(&self, values: &[f64]) -> f64 {
        let leaf = |leaf| match leaf {
            Leaf::Parameter(place) => values[usize::from(place)],
            _ => f64::NAN,
        };
        self.graph.value(self.slack, leaf, &mut Vec::new())
    }
}

/// One comparison of a text.
struct ComparedSides {
    comparison: Expression,
    /// The larger side less the smaller one.
    difference: Expression,
}

/// The comparisons of a tree; the last operand of a chain is what the next comparison goes on from.
/// None where it is something else.
fn comparisons(tree: &Expression, compared: &mut Vec<ComparedSides>) -> Option<()> {
    let Syntax::Binary(operator, sides) = &tree.kind else {
        return None;
    };
    let [left, right] = sides.as_ref();
    if *operator == Operator::And {
        comparisons(left, compared)?;
        return comparisons(right, compared);
    }
    let left = match &left.kind {
        Syntax::Binary(inner, sides) if is_comparison(*inner) => {
            comparisons(left, compared)?;
            &sides[1]
        }
        _ => left,
    };
    let (larger, smaller) = match operator {
        Operator::Less | Operator::LessOrEqual => (right, left),
        Operator::Greater | Operator::GreaterOrEqual => (left, right),
        _ => return None,
    };
    let span = left.span.to(right.span);
    let joined = |operator: Operator, sides: [&Expression; 2]| Expression {
        span,
        kind: Syntax::Binary(operator, Box::new(sides.map(Expression::clone))),
    };
    compared.push(ComparedSides {
        comparison: joined(*operator, [left, right]),
        difference: joined(Operator::Subtract, [larger, smaller]),
    });
    Some(())
}

fn is_comparison(operator: Operator) -> bool {
    matches!(
        operator,
        Operator::Less | Operator::LessOrEqual | Operator::Greater | Operator::GreaterOrEqual
    )
}

/// The parameters that a node needs.
fn parameters(graph: &Graph, node: NodeId) -> Vec<usize> {
    let needed = graph.needed([node]);
    let nodes = graph.nodes().iter().zip(needed);
    let places = nodes.filter_map(|(node, needed)| match node {
        GraphNode::Leaf(Leaf::Parameter(place)) if needed => Some(usize::from(*place)),
        _ => None,
    });
    let mut places: Vec<usize> = places.collect();
    places.sort_unstable();
    places
}

/// The names that a condition may use: the parameters of the model.
fn definition_of(model: &ModelDescription) -> Definition {
    let parameter = |described: &ParameterDescription| Parameter {
        declared: Declared {
            name: described.name.to_string(),
            symbol: None,
            unit: ValueUnit::parse(&described.unit).unwrap_or(ValueUnit::Any),
            unit_text: described.unit.to_string(),
            meaning: String::new(),
            pointer: String::new(),
        },
        default: described.default,
        bounds: [described.lower, described.upper],
        scale: described.scale,
        unknown: described.unknown_by_default,
        limits: [described.minimum, described.maximum],
        tolerance: described.tolerance,
    };
    Definition {
        name: model.name.to_string(),
        parameters: model.parameters.iter().map(parameter).collect(),
        ..Definition::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Catalogue;

    fn servo() -> ModelDescription {
        let catalogue = Catalogue::built_in();
        let servo = catalogue.get("single_rod_servo").unwrap();
        servo.description().clone()
    }

    fn slacks(text: &str, changed: &[(&str, f64)]) -> Vec<f64> {
        let model = servo();
        let mut values = model.defaults();
        for (name, value) in changed {
            values[model.parameter_index(name).unwrap()] = *value;
        }
        let conditions = Condition::compile(text, "/constraints/0", &model).unwrap();
        conditions.iter().map(|own| own.slack(&values)).collect()
    }

    #[test]
    fn the_slack_is_what_the_larger_side_has_more() {
        let changed = [("mass", 60.0)];
        for (text, expected) in [
            ("mass < 70", vec![10.0]),
            ("mass >= 70", vec![-10.0]),
            ("10 < mass < 65", vec![50.0, 5.0]),
            ("mass > 50 and mass <= 55", vec![10.0, -5.0]),
            ("2*mass + 1 <= min(200, 3*mass)", vec![59.0]),
        ] {
            assert_eq!(slacks(text, &changed), expected, "{text}");
        }
    }

    #[test]
    fn what_is_no_condition_is_refused_at_its_place() {
        for (text, code, column) in [
            ("mass + 1", "not_a_condition", "1"),
            ("mass <", "expression_not_understood", "7"),
            ("mass < 60 or mass > 70", "not_a_condition", "1"),
            ("mas < 60", "unknown_name", "1"),
            ("mass < supply_pressure", "units_do_not_fit", "8"),
            ("1 < 2", "not_a_condition", "1"),
        ] {
            let faults = Condition::compile(text, "/constraints/0", &servo()).unwrap_err();
            assert_eq!(faults[0].code, code, "{text}: {faults:?}");
            assert_eq!(
                faults[0].column.as_deref(),
                Some(column),
                "{text}: {faults:?}"
            );
        }
    }
}
