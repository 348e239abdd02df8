//! Effects that a document has no term for, each taken as absent within a small tolerance.
//!
//! White innovations certify little: a disturbance makes up for a friction that the equations lack, and the
//! damping pays for it. The residuals' pull at a constant and a quadratic loss of each state that a force moves
//! tells such a model from a right one.

use crate::estimation::problem::{Assumed, Assumption, Problem, Target};
use crate::estimation::trajectory;
use greybox_numerics::statistics;
use greybox_simulation::model::ParameterDescription;
use greybox_simulation::program::Losses;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// One standard deviation of what is not known of a loss, as a share of the rate's root mean square.
const TOLERANCE: f64 = 0.003;

/// The problem with the losses of its driven states among its assumptions; as it is where the model is no
/// document. Answers nothing when `stop` was raised.
pub(super) fn probed(problem: &Problem, positions: &[f64], stop: &AtomicBool) -> Option<Problem> {
    let driven = problem.model.driven_states();
    let Some(watching) = problem.model.watching(&driven) else {
        return Some(problem.clone());
    };
    let watched = Problem {
        model: Arc::new(watching),
        ..problem.clone()
    };
    let Ok(paths) = trajectory::simulate(&watched, positions, stop)? else {
        return Some(problem.clone());
    };
    let size = |output: usize| {
        let samples = paths.iter().flat_map(|outputs| &outputs[output]);
        let mean = statistics::mean(samples.map(|value| value * value));
        mean.map(f64::sqrt)
            .filter(|size| *size > 0.0 && size.is_finite())
    };
    let mut losses = Vec::new();
    let mut rates = Vec::new();
    for (place, state) in driven.iter().enumerate() {
        if let (Some(of_state), Some(of_rate)) = (size(place), size(driven.len() + place)) {
            losses.push(Losses {
                state: *state,
                size: of_state,
            });
            rates.push(of_rate);
        }
    }
    let Some(model) = problem.model.with_losses(&losses) else {
        return Some(problem.clone());
    };
    let mut next = problem.clone();
    let first = problem.parameters.len();
    let described = &model.description().parameters[first..];
    let assumption = |(place, parameter): (usize, &ParameterDescription)| Assumption {
        name: parameter.name.to_string(),
        unit: parameter.unit.to_string(),
        target: Assumed::Probe(Target::Parameter(first + place)),
        value: 0.0,
        taken: 0.0,
        tolerance: TOLERANCE * rates[place / 2],
        is_absent_effect: true,
        limits: [None, None],
    };
    // Numbers of the model stand before those of sensors and of the clock.
    let assumed = problem.assumptions.iter();
    let (simulated, measured): (Vec<_>, Vec<_>) = assumed
        .cloned()
        .partition(|own| own.target.simulated().is_some());
    let probes = described.iter().enumerate().map(assumption);
    next.assumptions = Arc::new(
        simulated
            .into_iter()
            .chain(probes)
            .chain(measured)
            .collect(),
    );
    next.parameters
        .extend(described.iter().map(|parameter| parameter.default));
    next.model = Arc::new(model);
    Some(next)
}
