//! Equations with quantities that wander: each disturbance with memory is a state more, which acts
//! on a parameter, on the rate of a state or on an output.

use super::controller::{ControllerLayout, RecordedQuantity};
use super::rewrite::{EquationGraph, Roots};
use crate::language::graph::{Full, Graph, GraphNode, Leaf, NodeId};
use crate::language::operation::Operation;

/// What a disturbance acts on, by its place in the model's description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActsOn {
    /// A parameter, which wanders about its value.
    Parameter(usize),
    /// The rate of a state.
    Rate(usize),
    /// A quantity that a controller within the model computes once a sample.
    Sampled(usize),
    /// An output: its sensor drifts.
    Output(usize),
}

/// How a disturbance moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisturbanceKind {
    /// The disturbance forgets its value at once.
    White,
    /// The disturbance forgets its value within a time constant.
    Memory,
    /// The disturbance keeps its value but for what is added.
    Walk,
}

/// A quantity that nobody recorded and that moves the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disturbance {
    /// The quantity that the disturbance acts on.
    pub acts_on: ActsOn,
    /// How the disturbance moves.
    pub kind: DisturbanceKind,
}

impl EquationGraph {
    /// Whether what is computed once a sample reads a state.
    pub(super) fn samples_its_states(&self) -> bool {
        let EquationGraph { graph, roots } = self;
        let needed = graph.needed(roots.sampled.iter().map(|(node, _)| *node));
        let is_state = |node: &GraphNode| matches!(node, GraphNode::Leaf(Leaf::State(_)));
        let mut nodes = graph.nodes().iter().zip(needed);
        nodes.any(|(node, needed)| needed && is_state(node))
    }

    /// The states whose rate reads an input, and those that are the rate of another state.
    pub(super) fn driven_states(&self) -> Vec<usize> {
        let EquationGraph { graph, roots } = self;
        let reads_input = |rate: NodeId| {
            let needed = graph.needed([rate]);
            let mut nodes = graph.nodes().iter().zip(needed);
            nodes.any(|(node, needed)| {
                let is_input = |leaf| matches!(leaf, Leaf::Input(_) | Leaf::Sampled(_));
                needed && matches!(node, GraphNode::Leaf(leaf) if is_input(*leaf))
            })
        };
        let is_rate = |state: usize| {
            let leaf = GraphNode::Leaf(Leaf::State(state as u16));
            let mut rates = roots.rates.iter();
            rates.any(|rate| graph.nodes()[usize::from(*rate)] == leaf)
        };
        let states = roots.rates.iter().copied().enumerate();
        states
            .filter(|(state, rate)| reads_input(*rate) || is_rate(*state))
            .map(|(state, _)| state)
            .collect()
    }

    /// For each output the state that it shows, where it shows nothing else.
    pub(super) fn shown_states(&self) -> Vec<Option<usize>> {
        let nodes = self.graph.nodes();
        let shown = |root: &NodeId| match nodes[usize::from(*root)] {
            GraphNode::Leaf(Leaf::State(state)) => Some(usize::from(state)),
            _ => None,
        };
        self.roots.outputs.iter().map(shown).collect()
    }

    /// The outputs that show what is computed once a sample, and nothing else.
    pub(super) fn recorded_quantities(&self) -> Vec<RecordedQuantity> {
        let nodes = self.graph.nodes();
        let shown = |(output, root): (usize, &NodeId)| match nodes[usize::from(*root)] {
            GraphNode::Leaf(Leaf::Sampled(quantity)) => Some(RecordedQuantity {
                output,
                quantity: usize::from(quantity),
            }),
            _ => None,
        };
        self.roots
            .outputs
            .iter()
            .enumerate()
            .filter_map(shown)
            .collect()
    }

    /// Whether a quantity that is computed once a sample follows from a parameter.
    pub(super) fn computes_from(&self, quantity: usize, parameter: usize) -> bool {
        let EquationGraph { graph, roots } = self;
        let needed = graph.needed([roots.sampled[quantity].0]);
        let leaf = GraphNode::Leaf(Leaf::Parameter(parameter as u16));
        let mut nodes = graph.nodes().iter().zip(needed);
        nodes.any(|(node, needed)| needed && *node == leaf)
    }

    /// Whether the delay follows from constants and the sample time alone.
    pub(super) fn has_constant_delay(&self) -> bool {
        let EquationGraph { graph, roots } = self;
        let needed = graph.needed(roots.delay);
        let is_parameter = |node: &GraphNode| matches!(node, GraphNode::Leaf(Leaf::Parameter(_)));
        let mut nodes = graph.nodes().iter().zip(needed);
        !nodes.any(|(node, needed)| needed && is_parameter(node))
    }

    /// The equations with a state more for each disturbance, behind the states that there are, and behind
    /// these the states of the controller. `time_constants` are the parameters by which disturbances with
    /// memory decay.
    ///
    /// # Errors
    /// Where there would be too many nodes.
    pub(super) fn disturbed(
        &self,
        disturbances: &[Disturbance],
        time_constants: &[Option<usize>],
        controller: Option<ControllerLayout>,
    ) -> Result<EquationGraph, Full> {
        let controlled = match controller {
            None => self.clone(),
            Some(controller) => {
                let first = self.roots.rates.len() + disturbances.len();
                carried(self, controller, first)?
            }
        };
        let mut whole = disturbed(&controlled, disturbances, time_constants)?;
        let EquationGraph { graph, roots } = &mut whole;
        let of_controller = controller.map_or(0, ControllerLayout::n_states);
        for places in [&mut roots.rates, &mut roots.initial] {
            let last = places.len() + of_controller;
            places.resize(last, graph.constant(0.0)?);
        }
        Ok(whole)
    }
}

/// The equations with the quantities that a controller computes as states, which begin with `first`.
fn carried(
    equations: &EquationGraph,
    controller: ControllerLayout,
    first: usize,
) -> Result<EquationGraph, Full> {
    equations.continued(Graph::default(), |graph, leaf| {
        let state = match leaf {
            Leaf::Sampled(quantity) => controller.acting(first, usize::from(quantity)),
            Leaf::Previous(quantity) => controller.previous(first, usize::from(quantity)),
            _ => return graph.leaf(leaf),
        };
        graph.leaf(Leaf::State(state as u16))
    })
}

/// The graph with the disturbances' states.
fn disturbed(
    equations: &EquationGraph,
    disturbances: &[Disturbance],
    time_constants: &[Option<usize>],
) -> Result<EquationGraph, Full> {
    let n_states = equations.roots.rates.len();
    let state_of = |disturbance: usize| Leaf::State((n_states + disturbance) as u16);
    let on_parameter = |parameter: u16| {
        let acts_on = ActsOn::Parameter(usize::from(parameter));
        (0..disturbances.len()).filter(move |index| disturbances[*index].acts_on == acts_on)
    };
    // What follows from the parameters alone, and what is computed once a sample, takes the
    // parameters as they stand.
    let standing = equations.copied()?;
    let wandering = equations.continued(standing.graph, |graph, leaf| {
        let mut node = graph.leaf(leaf)?;
        if let Leaf::Parameter(parameter) = leaf {
            for disturbance in on_parameter(parameter) {
                let state = graph.leaf(state_of(disturbance))?;
                node = graph.compute(Operation::Add, &[node, state])?;
            }
        }
        Ok(node)
    })?;
    let mut graph = wandering.graph;
    let mut roots = Roots {
        initial: standing.roots.initial,
        sampled: standing.roots.sampled,
        delay: standing.roots.delay,
        fastest_rate: standing.roots.fastest_rate,
        ..wandering.roots
    };
    for (index, disturbance) in disturbances.iter().enumerate() {
        let state = graph.leaf(state_of(index))?;
        let driven: Option<&mut NodeId> = match disturbance.acts_on {
            ActsOn::Parameter(_) => None,
            ActsOn::Rate(of) => Some(&mut roots.rates[of]),
            ActsOn::Output(of) => Some(&mut roots.outputs[of]),
            ActsOn::Sampled(of) => Some(&mut roots.sampled[of].0),
        };
        if let Some(driven) = driven {
            *driven = graph.compute(Operation::Add, &[*driven, state])?;
        }
        let rate = match (disturbance.kind, time_constants[index]) {
            (DisturbanceKind::Memory, Some(parameter)) => {
                let time_constant = graph.leaf(Leaf::Parameter(parameter as u16))?;
                let decay = graph.compute(Operation::Negate, &[state])?;
                graph.compute(Operation::Divide, &[decay, time_constant])?
            }
            _ => graph.constant(0.0)?,
        };
        roots.rates.push(rate);
        roots.initial.push(graph.constant(0.0)?);
    }
    Ok(EquationGraph { graph, roots })
}
