//! Equations with quantities that wander: each disturbance with memory is a state more, which acts
//! on a parameter, on the rate of a state or on an output.

use super::Program;
use super::rewrite::{EquationGraph, Roots};
use crate::language::graph::{Full, GraphNode, Leaf, NodeId};
use crate::language::operation::Operation;

/// What a disturbance acts on, by its place in the model's description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActsOn {
    /// A parameter, which wanders about its value.
    Parameter(usize),
    /// The rate of a state.
    Rate(usize),
    /// An output: its sensor drifts.
    Output(usize),
}

/// How a disturbance moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DisturbanceKind {
    /// It forgets its value at once.
    White,
    /// It forgets its value within a time constant.
    Memory,
    /// It keeps its value but for what is added.
    Walk,
}

/// A quantity that nobody recorded and that moves the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Disturbance {
    /// What it acts on.
    pub acts_on: ActsOn,
    /// How it moves.
    pub kind: DisturbanceKind,
}

impl Program {
    /// The program with a state more for each disturbance, in their order behind the model's
    /// states. A disturbance with memory τ decays by −d/τ, where τ is the parameter
    /// `time_constants[disturbance]`; white noise has a state that stays 0, through which the
    /// Jacobian says what the noise drives. `sizes` are typical sizes of the disturbances, in
    /// their units. Answers nothing where the equations would have too many nodes.
    #[must_use]
    pub fn disturbed(
        &self,
        disturbances: &[Disturbance],
        time_constants: &[Option<usize>],
        sizes: &[f64],
    ) -> Option<Program> {
        let equations = disturbed(&self.equations, disturbances, time_constants).ok()?;
        let n_parameters = self.wiring.parameters.len();
        let last = time_constants.iter().flatten().max();
        let n_parameters = last.map_or(n_parameters, |last| n_parameters.max(last + 1));
        let tables = self.lists.tables().to_vec();
        let mut program =
            Program::of_equations(equations, tables, n_parameters, self.moving_inputs);
        program.sizes = self.sizes.iter().chain(sizes).copied().collect();
        Some(program)
    }

    /// Whether what is computed once a sample reads a state: a controller within the model.
    #[must_use]
    pub fn samples_its_states(&self) -> bool {
        let EquationGraph { graph, roots } = &self.equations;
        let needed = graph.needed(roots.sampled.iter().map(|(node, _)| *node));
        let is_state = |node: &GraphNode| matches!(node, GraphNode::Leaf(Leaf::State(_)));
        graph
            .nodes()
            .iter()
            .zip(needed)
            .any(|(node, needed)| needed && is_state(node))
    }
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
