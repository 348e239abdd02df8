//! Equations with effects that they leave out and inputs that are not exact, and equations whose states and
//! rates are outputs.

use super::rewrite::{EquationGraph, Roots};
use crate::language::graph::{Full, Graph, GraphNode, Leaf, NodeId};
use crate::language::operation::Operation;

/// Below this share of its typical size the state's constant loss goes over into its opposite.
const SLOW: f64 = 0.05;

/// Two losses of a state that its rate may leave out: a constant one against the state's direction, such as dry
/// friction or a leak, and one with the state's square, such as drag. Each is the rate that is lost at the
/// state's typical size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Losses {
    /// The state, by its place.
    pub state: usize,
    /// The typical size of the state, above zero, in its unit.
    pub size: f64,
}

/// What equations take as exact or leave out, each with parameters of its own behind those of the model: for
/// each input a gain and an offset, then for each state a constant and a quadratic loss.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Probes {
    /// The inputs, by their places: `gain·u + offset` acts on the plant for an input u.
    pub inputs: Vec<usize>,
    /// The states with losses.
    pub losses: Vec<Losses>,
}

impl EquationGraph {
    /// The inputs that act on the plant, by their places, but for those that decide between cases: a signal
    /// that is compared with a number has no gain.
    pub(super) fn acting_inputs(&self) -> Vec<usize> {
        let EquationGraph { graph, roots } = self;
        let acting = graph.needed(roots.rates.iter().chain(&roots.outputs).copied());
        let compared = graph.nodes().iter().filter_map(|node| match node {
            GraphNode::Compute(Operation::AtLeast | Operation::Above, on) => Some(on[..2].to_vec()),
            _ => None,
        });
        let deciding = graph.needed(compared.flatten());
        let nodes = graph.nodes().iter().enumerate();
        let inputs = nodes.filter_map(|(place, node)| match node {
            GraphNode::Leaf(Leaf::Input(input)) if acting[place] && !deciding[place] => {
                Some(usize::from(*input))
            }
            _ => None,
        });
        let mut inputs: Vec<usize> = inputs.collect();
        inputs.sort_unstable();
        inputs
    }

    /// The equations with probes, whose parameters stand from `first_parameter` on.
    ///
    /// # Errors
    /// Where there would be too many nodes.
    pub(super) fn with_probes(
        &self,
        probes: &Probes,
        first_parameter: usize,
    ) -> Result<EquationGraph, Full> {
        let parameter = |place: usize| Leaf::Parameter((first_parameter + place) as u16);
        let EquationGraph {
            mut graph,
            mut roots,
        } = self.continued(Graph::default(), |graph, leaf| {
            let node = graph.leaf(leaf)?;
            let mut inputs = probes.inputs.iter();
            let is_leaf = |input: &usize| leaf == Leaf::Input(*input as u16);
            let Some(place) = inputs.position(is_leaf) else {
                return Ok(node);
            };
            let gain = graph.leaf(parameter(2 * place))?;
            let offset = graph.leaf(parameter(2 * place + 1))?;
            let amplified = graph.compute(Operation::Multiply, &[gain, node])?;
            graph.compute(Operation::Add, &[amplified, offset])
        })?;
        for (place, loss) in losses_after(probes) {
            let rate = &mut roots.rates[loss.state];
            let [constant, quadratic] = [parameter(place), parameter(place + 1)];
            for lost in lost_rates(&mut graph, loss, [constant, quadratic])? {
                *rate = graph.compute(Operation::Subtract, &[*rate, lost])?;
            }
        }
        Ok(EquationGraph { graph, roots })
    }

    /// The equations whose outputs are these states, then their rates.
    pub(super) fn watching(&self, states: &[usize]) -> Result<EquationGraph, Full> {
        let EquationGraph { mut graph, roots } = self.copied()?;
        let mut outputs = Vec::with_capacity(2 * states.len());
        for state in states {
            outputs.push(graph.leaf(Leaf::State(*state as u16))?);
        }
        outputs.extend(states.iter().map(|state| roots.rates[*state]));
        let roots = Roots { outputs, ..roots };
        Ok(EquationGraph { graph, roots })
    }
}

/// Each state with losses and the place of its first parameter, behind those of the inputs.
fn losses_after(probes: &Probes) -> impl Iterator<Item = (usize, &Losses)> {
    let first = 2 * probes.inputs.len();
    let losses = probes.losses.iter().enumerate();
    losses.map(move |(place, loss)| (first + 2 * place, loss))
}

/// The rates that a state loses by its constant and by its quadratic loss, whose sizes are parameters.
fn lost_rates(
    graph: &mut Graph,
    loss: &Losses,
    [constant, quadratic]: [Leaf; 2],
) -> Result<[NodeId; 2], Full> {
    let state = graph.leaf(Leaf::State(loss.state as u16))?;
    let size = graph.constant(loss.size)?;
    let share = graph.compute(Operation::Divide, &[state, size])?;
    let slow = graph.constant(SLOW)?;
    let shape = graph.compute(Operation::Divide, &[share, slow])?;
    let shape = graph.compute(Operation::HyperbolicTangent, &[shape])?;
    let constant = graph.leaf(constant)?;
    let square = graph.compute(Operation::Absolute, &[share])?;
    let square = graph.compute(Operation::Multiply, &[square, share])?;
    let quadratic = graph.leaf(quadratic)?;
    Ok([
        graph.compute(Operation::Multiply, &[constant, shape])?,
        graph.compute(Operation::Multiply, &[quadratic, square])?,
    ])
}
