//! Equations made shorter before they are laid out: divisions by what stands still become
//! products, and parameters that a job fixes become numbers, with which effects that are off go.

use crate::language::graph::{Full, Graph, GraphNode, Leaf, NodeId};
use crate::language::operation::Operation;

/// What the equations are made of, as nodes of a graph.
#[derive(Clone, Debug, Default)]
pub struct Roots {
    /// The rates of change of the states.
    pub rates: Vec<NodeId>,
    /// The outputs.
    pub outputs: Vec<NodeId>,
    /// Where the states start.
    pub initial: Vec<NodeId>,
    /// The sampled quantities, and what each was before the first sample.
    pub sampled: Vec<(NodeId, Option<NodeId>)>,
    /// The delay.
    pub delay: Option<NodeId>,
    /// The fastest rate that a step must resolve.
    pub fastest_rate: Option<NodeId>,
    /// Whether the equations hold.
    pub valid: Option<NodeId>,
}

impl Roots {
    /// The roots under other names: `names` has one for each node.
    pub fn renamed(&self, names: &[NodeId]) -> Roots {
        let name = |node: &NodeId| names[usize::from(*node)];
        let all = |nodes: &[NodeId]| nodes.iter().map(name).collect();
        Roots {
            rates: all(&self.rates),
            outputs: all(&self.outputs),
            initial: all(&self.initial),
            sampled: self
                .sampled
                .iter()
                .map(|(node, initial)| (name(node), initial.as_ref().map(name)))
                .collect(),
            delay: self.delay.as_ref().map(name),
            fastest_rate: self.fastest_rate.as_ref().map(name),
            valid: self.valid.as_ref().map(name),
        }
    }
}

/// What a node depends on.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Dependence {
    /// On parameters alone.
    Setup,
    /// On held quantities.
    Held,
    /// On states, or on inputs that move between the samples.
    Moving,
}

/// What each node depends on.
pub fn levels(graph: &Graph, moving_inputs: bool) -> Vec<Dependence> {
    let mut levels: Vec<Dependence> = Vec::with_capacity(graph.nodes().len());
    for node in graph.nodes() {
        let level = match node {
            GraphNode::Constant(_) => Dependence::Setup,
            GraphNode::Leaf(leaf) => match leaf {
                Leaf::SampleTime | Leaf::Parameter(_) => Dependence::Setup,
                Leaf::Input(_) if !moving_inputs => Dependence::Held,
                Leaf::Sampled(_) => Dependence::Held,
                _ => Dependence::Moving,
            },
            GraphNode::Compute(_, on) => {
                let levels = on.iter().map(|node| levels[usize::from(*node)]);
                levels.max().unwrap_or(Dependence::Setup)
            }
        };
        levels.push(level);
    }
    levels
}

/// Equations as a graph and what is asked of it.
#[derive(Clone, Debug)]
pub struct EquationGraph {
    /// The numbers.
    pub graph: Graph,
    /// Which of them are rates, outputs and so on.
    pub roots: Roots,
}

impl EquationGraph {
    /// The equations with `x·(1/p)` for `x/p` where `x` moves with the states and `p` does not: the
    /// reciprocal is taken once a candidate, or once a sample. What would have too many nodes
    /// stays as it is.
    #[must_use]
    pub fn with_reciprocals(&self, moving_inputs: bool) -> EquationGraph {
        let levels = levels(&self.graph, moving_inputs);
        let moves = |node: NodeId| levels[usize::from(node)] == Dependence::Moving;
        let rewritten = self.rewritten(|graph, (node, places), on| match node {
            GraphNode::Compute(Operation::Divide, [above, below, _])
                if moves(*above) && !moves(*below) =>
            {
                let one = graph.constant(1.0)?;
                let reciprocal = graph.compute(Operation::Divide, &[one, on[1]])?;
                graph.compute(Operation::Multiply, &[on[0], reciprocal])
            }
            _ => copied(graph, node, &on[..places]),
        });
        rewritten.unwrap_or_else(|_| self.clone())
    }

    /// The equations with numbers in place of fixed parameters. What is multiplied by 0 is gone
    /// (also where it would have been no number), what is added to 0 or multiplied by 1 stays
    /// alone, and of a choice that is settled one side stays. Everything else keeps its bits.
    #[must_use]
    pub fn with_fixed(&self, fixed: &[Option<f64>]) -> EquationGraph {
        let value = |index: u16| fixed.get(usize::from(index)).copied().flatten();
        let rewritten = self.rewritten(|graph, (node, places), on| match node {
            GraphNode::Leaf(Leaf::Parameter(index)) => match value(*index) {
                Some(value) => graph.constant(value),
                None => graph.leaf(Leaf::Parameter(*index)),
            },
            GraphNode::Compute(operation, _) => match simpler(graph, *operation, on) {
                Some(node) => node,
                None => graph.compute(*operation, &on[..places]),
            },
            _ => copied(graph, node, &on[..places]),
        });
        rewritten.unwrap_or_else(|_| self.clone())
    }

    /// The equations as they are.
    pub fn copied(&self) -> Result<EquationGraph, Full> {
        self.continued(Graph::default(), Graph::leaf)
    }

    /// The equations behind those that `graph` has already. `rule` says what each leaf becomes.
    pub fn continued(
        &self,
        graph: Graph,
        rule: impl Fn(&mut Graph, Leaf) -> Result<NodeId, Full>,
    ) -> Result<EquationGraph, Full> {
        self.rewritten_into(graph, |graph, (node, places), on| match node {
            GraphNode::Leaf(leaf) => rule(graph, *leaf),
            _ => copied(graph, node, &on[..places]),
        })
    }

    /// A new graph, node after node. `rule` makes each from the old one, how many places it has,
    /// and what has become of the nodes that stand there.
    fn rewritten(
        &self,
        rule: impl Fn(&mut Graph, (&GraphNode, usize), [NodeId; 3]) -> Result<NodeId, Full>,
    ) -> Result<EquationGraph, Full> {
        self.rewritten_into(Graph::default(), rule)
    }

    /// The nodes behind those that `graph` has already.
    fn rewritten_into(
        &self,
        mut graph: Graph,
        rule: impl Fn(&mut Graph, (&GraphNode, usize), [NodeId; 3]) -> Result<NodeId, Full>,
    ) -> Result<EquationGraph, Full> {
        let mut now: Vec<NodeId> = Vec::with_capacity(self.graph.nodes().len());
        for node in self.graph.nodes() {
            let (places, on) = match node {
                GraphNode::Compute(operation, on) => (
                    operation.arguments(),
                    on.map(|place| now[usize::from(place)]),
                ),
                GraphNode::Constant(_) | GraphNode::Leaf(_) => (0, [0; 3]),
            };
            now.push(rule(&mut graph, (node, places), on)?);
        }
        Ok(EquationGraph {
            graph,
            roots: self.roots.renamed(&now),
        })
    }
}

fn copied(graph: &mut Graph, node: &GraphNode, on: &[NodeId]) -> Result<NodeId, Full> {
    match node {
        GraphNode::Constant(value) => graph.constant(*value),
        GraphNode::Leaf(leaf) => graph.leaf(*leaf),
        GraphNode::Compute(operation, _) => graph.compute(*operation, on),
    }
}

/// What an operation comes to without being done; none where it has to be done.
fn simpler(
    graph: &mut Graph,
    operation: Operation,
    [a, b, c]: [NodeId; 3],
) -> Option<Result<NodeId, Full>> {
    let is = |node: NodeId, value: f64| graph.as_constant(node) == Some(value);
    let same = |node: NodeId| Some(Ok(node));
    match operation {
        Operation::Add if is(a, 0.0) => same(b),
        Operation::Add if is(b, 0.0) => same(a),
        Operation::Add => parts_of_one(graph, a, b).map(Ok),
        Operation::Subtract if is(b, 0.0) => same(a),
        Operation::Multiply if is(a, 0.0) || is(b, 1.0) => same(a),
        Operation::Multiply if is(b, 0.0) || is(a, 1.0) => same(b),
        Operation::Divide if is(a, 0.0) && !is(b, 0.0) => same(a),
        Operation::Divide if is(b, 1.0) => same(a),
        Operation::Select if b == c => same(b),
        Operation::Select => {
            let condition = graph.as_constant(a)?;
            same(if condition >= 0.5 { b } else { c })
        }
        _ => None,
    }
}

/// x, where the terms are max(x, 0) and min(x, 0): a dead band of no width.
fn parts_of_one(graph: &Graph, left: NodeId, right: NodeId) -> Option<NodeId> {
    let part = |node: NodeId| match graph.nodes()[usize::from(node)] {
        GraphNode::Compute(operation @ (Operation::Maximum | Operation::Minimum), [x, zero, _])
            if graph.as_constant(zero) == Some(0.0) =>
        {
            Some((operation, x))
        }
        _ => None,
    };
    let ((first, x), (second, same)) = (part(left)?, part(right)?);
    (first != second && x == same).then_some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations of one rate.
    fn of(build: impl Fn(&mut Graph) -> Result<NodeId, Full>) -> EquationGraph {
        let mut graph = Graph::default();
        let rate = build(&mut graph).expect("there is room");
        let roots = Roots {
            rates: vec![rate],
            ..Roots::default()
        };
        EquationGraph { graph, roots }
    }

    fn rate(equations: &EquationGraph) -> GraphNode {
        equations.graph.nodes()[usize::from(equations.roots.rates[0])]
    }

    #[test]
    fn an_effect_that_is_off_is_gone_and_what_is_left_stays() {
        // x − k·tanh(x) with the dead band w of x.
        let equations = of(|graph| {
            let x = graph.leaf(Leaf::State(0))?;
            let k = graph.leaf(Leaf::Parameter(0))?;
            let w = graph.leaf(Leaf::Parameter(1))?;
            let zero = graph.constant(0.0)?;
            let above = graph.compute(Operation::Subtract, &[x, w])?;
            let above = graph.compute(Operation::Maximum, &[above, zero])?;
            let below = graph.compute(Operation::Add, &[x, w])?;
            let below = graph.compute(Operation::Minimum, &[below, zero])?;
            let banded = graph.compute(Operation::Add, &[above, below])?;
            let bent = graph.compute(Operation::HyperbolicTangent, &[x])?;
            let friction = graph.compute(Operation::Multiply, &[k, bent])?;
            graph.compute(Operation::Subtract, &[banded, friction])
        });
        let left = equations.with_fixed(&[Some(0.0), Some(0.0)]);
        assert_eq!(rate(&left), GraphNode::Leaf(Leaf::State(0)));
        let left = equations.with_fixed(&[Some(2.0), None]);
        let needed = left.graph.needed(left.roots.rates.iter().copied());
        let leaves = left.graph.nodes().iter().zip(needed);
        let leaves: Vec<&GraphNode> = leaves
            .filter_map(|(node, needed)| {
                (needed && matches!(node, GraphNode::Leaf(_))).then_some(node)
            })
            .collect();
        let expected = [Leaf::State(0), Leaf::Parameter(1)].map(GraphNode::Leaf);
        assert_eq!(leaves, expected.iter().collect::<Vec<_>>());
    }

    #[test]
    fn only_a_division_by_what_stands_still_becomes_a_product() {
        let by = |below: Leaf| {
            let equations = of(|graph| {
                let x = graph.leaf(Leaf::State(0))?;
                let below = graph.leaf(below)?;
                graph.compute(Operation::Divide, &[x, below])
            });
            rate(&equations.with_reciprocals(false))
        };
        let is_product = |node| matches!(node, GraphNode::Compute(Operation::Multiply, _));
        assert!(is_product(by(Leaf::Parameter(0))));
        assert!(is_product(by(Leaf::Input(0))));
        assert!(!is_product(by(Leaf::State(1))));
    }
}
