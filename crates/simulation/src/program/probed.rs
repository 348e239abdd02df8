//! Equations with effects that they leave out, and equations whose states and rates are outputs.

use super::rewrite::{EquationGraph, Roots};
use crate::language::graph::{Full, Leaf};
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

impl EquationGraph {
    /// The equations with losses. The parameters of a state's constant and quadratic loss stand side by side
    /// from `first_parameter` on, in the order of `losses`.
    ///
    /// # Errors
    /// Where there would be too many nodes.
    pub(super) fn with_losses(
        &self,
        losses: &[Losses],
        first_parameter: usize,
    ) -> Result<EquationGraph, Full> {
        let EquationGraph {
            mut graph,
            mut roots,
        } = self.copied()?;
        for (place, loss) in losses.iter().enumerate() {
            let parameter =
                |offset: usize| Leaf::Parameter((first_parameter + 2 * place + offset) as u16);
            let state = graph.leaf(Leaf::State(loss.state as u16))?;
            let size = graph.constant(loss.size)?;
            let share = graph.compute(Operation::Divide, &[state, size])?;
            let slow = graph.constant(SLOW)?;
            let shape = graph.compute(Operation::Divide, &[share, slow])?;
            let shape = graph.compute(Operation::HyperbolicTangent, &[shape])?;
            let constant = graph.leaf(parameter(0))?;
            let constant = graph.compute(Operation::Multiply, &[constant, shape])?;
            let square = graph.compute(Operation::Absolute, &[share])?;
            let square = graph.compute(Operation::Multiply, &[square, share])?;
            let quadratic = graph.leaf(parameter(1))?;
            let quadratic = graph.compute(Operation::Multiply, &[quadratic, square])?;
            let rate = &mut roots.rates[loss.state];
            for lost in [constant, quadratic] {
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
