//! The equations as a graph of numbers: each sub-expression stands once, constants are folded.
//!
//! A node's arguments stand before it, so the order of the nodes is an order of computation.
//! Nothing is rearranged that would change a bit of a result: `x + 0` stays, `2·3` becomes 6.

use super::operation::{self, Operation};
use std::collections::HashMap;

/// The nodes of one model at the most.
pub const MAX_NODES: usize = 1024;

/// A node, by its place in the graph.
pub type NodeId = u16;

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GraphNode {
    /// A fixed number.
    Constant(f64),
    /// What comes from outside.
    Leaf(Leaf),
    /// An operation on up to three nodes; the places that it does not use repeat the first.
    Compute(Operation, [NodeId; 3]),
}

/// What comes from outside the graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Leaf {
    /// The time from one sample to the next.
    SampleTime,
    /// A parameter.
    Parameter(u16),
    /// An input as it stands at the sample, for what is computed once a sample.
    Recorded(u16),
    /// The value that a sampled quantity had at the sample before.
    Previous(u16),
    /// An input as it acts on the plant.
    Input(u16),
    /// A sampled quantity as it acts on the plant.
    Sampled(u16),
    /// A state.
    State(u16),
}

/// Too many nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

/// A graph under construction, then finished.
#[derive(Clone, Debug, Default)]
pub struct Graph {
    nodes: Vec<GraphNode>,
    ids: HashMap<NodeKey, NodeId>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum NodeKey {
    Constant(u64),
    Leaf(Leaf),
    Compute(Operation, [NodeId; 3]),
}

impl Graph {
    /// The nodes, in an order of computation.
    #[must_use]
    pub fn nodes(&self) -> &[GraphNode] {
        &self.nodes
    }

    /// The number of a node that is a constant.
    #[must_use]
    pub fn as_constant(&self, node: NodeId) -> Option<f64> {
        match self.nodes[usize::from(node)] {
            GraphNode::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// A fixed number.
    pub fn constant(&mut self, value: f64) -> Result<NodeId, Full> {
        self.insert(
            NodeKey::Constant(value.to_bits()),
            GraphNode::Constant(value),
        )
    }

    /// What comes from outside.
    pub fn leaf(&mut self, leaf: Leaf) -> Result<NodeId, Full> {
        self.insert(NodeKey::Leaf(leaf), GraphNode::Leaf(leaf))
    }

    /// An operation on as many nodes as it takes.
    pub fn compute(&mut self, operation: Operation, on: &[NodeId]) -> Result<NodeId, Full> {
        let mut places = [on[0]; 3];
        places[..on.len()].copy_from_slice(on);
        let values = places.map(|node| self.as_constant(node));
        if let [Some(a), Some(b), Some(c)] = values
            && !matches!(operation, Operation::Table(_))
        {
            return self.constant(operation::apply(operation, [a, b, c], &[]));
        }
        if operation.is_symmetric() {
            places[..2].sort_unstable();
            places[2] = places[0];
        }
        let key = NodeKey::Compute(operation, places);
        self.insert(key, GraphNode::Compute(operation, places))
    }

    fn insert(&mut self, key: NodeKey, node: GraphNode) -> Result<NodeId, Full> {
        if let Some(&id) = self.ids.get(&key) {
            return Ok(id);
        }
        if self.nodes.len() >= MAX_NODES {
            return Err(Full);
        }
        let id = self.nodes.len() as NodeId;
        self.nodes.push(node);
        self.ids.insert(key, id);
        Ok(id)
    }

    /// The value of a node, with a value for each leaf before it. The values of all nodes before it are left in
    /// `computed`.
    #[must_use]
    pub fn value(&self, node: NodeId, leaf: impl Fn(Leaf) -> f64, computed: &mut Vec<f64>) -> f64 {
        computed.clear();
        for node in &self.nodes[..=usize::from(node)] {
            computed.push(match node {
                GraphNode::Constant(value) => *value,
                GraphNode::Leaf(outside) => leaf(*outside),
                GraphNode::Compute(operation, on) => {
                    operation::apply(*operation, on.map(|node| computed[usize::from(node)]), &[])
                }
            });
        }
        computed[usize::from(node)]
    }

    /// For each node, whether any node of `wanted` needs its value.
    #[must_use]
    pub fn needed(&self, wanted: impl IntoIterator<Item = NodeId>) -> Vec<bool> {
        let mut needed = vec![false; self.nodes.len()];
        for node in wanted {
            needed[usize::from(node)] = true;
        }
        for (index, node) in self.nodes.iter().enumerate().rev() {
            if let (true, GraphNode::Compute(_, on)) = (needed[index], node) {
                on.iter().for_each(|node| needed[usize::from(*node)] = true);
            }
        }
        needed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_parts_stand_once_and_constants_are_folded() {
        let mut graph = Graph::default();
        let x = graph.leaf(Leaf::State(0)).unwrap();
        let two = graph.constant(2.0).unwrap();
        let three = graph.constant(3.0).unwrap();
        let six = graph.compute(Operation::Multiply, &[two, three]).unwrap();
        assert_eq!(graph.as_constant(six), Some(6.0));
        let one = graph.compute(Operation::Add, &[x, six]).unwrap();
        let other = graph.compute(Operation::Add, &[six, x]).unwrap();
        assert_eq!(
            one, other,
            "a sum does not depend on the order of its two terms"
        );
        let less = graph.compute(Operation::Subtract, &[x, six]).unwrap();
        let more = graph.compute(Operation::Subtract, &[six, x]).unwrap();
        assert_ne!(less, more);
    }

    #[test]
    fn what_nobody_needs_is_not_needed() {
        let mut graph = Graph::default();
        let x = graph.leaf(Leaf::State(0)).unwrap();
        let root = graph.compute(Operation::SquareRoot, &[x]).unwrap();
        let unused = graph.compute(Operation::Exponential, &[x]).unwrap();
        let needed = graph.needed([root]);
        assert!(needed[usize::from(x)] && needed[usize::from(root)]);
        assert!(!needed[usize::from(unused)]);
    }
}
