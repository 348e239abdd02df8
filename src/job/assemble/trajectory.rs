//! Measured and simulated outputs of a result, side by side.

use crate::estimation::problem::{Coordinate, Target};
use crate::estimation::{Problem, trajectory};
use crate::job::fault::Fault;
use crate::job::id::DatasetId;
use crate::job::outcome::{Estimate, Outcome};
use crate::job::spec::JobSpec;
use crate::model::Model;
use crate::recording::Recording;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// One experiment of a result.
#[derive(Clone, Debug)]
pub struct ExperimentTrajectory {
    /// The recording.
    pub dataset: DatasetId,
    /// The instants, from the recording's first sample `[s]`.
    pub time: Vec<f64>,
    /// How many of the instants were estimated from; the rest validates.
    pub estimation_samples: usize,
    /// The outputs that are measured.
    pub outputs: Vec<OutputTrajectory>,
}

/// One output of an experiment.
#[derive(Clone, Debug)]
pub struct OutputTrajectory {
    /// Its name.
    pub name: String,
    /// Its SI unit.
    pub unit: String,
    /// Measured samples; NaN where missing.
    pub measured: Vec<f64>,
    /// Simulated samples.
    pub simulated: Vec<f64>,
    /// measured − simulated; NaN where missing.
    pub residual: Vec<f64>,
}

/// Simulates a result over the recordings that it was made from. Answers nothing when `stop` was
/// raised.
///
/// # Errors
/// When the recordings do not fit the specification any more, or the simulation fails.
pub fn trajectory(
    spec: &JobSpec,
    model: &Arc<Model>,
    recordings: &[Recording],
    outcome: &Outcome,
    stop: &AtomicBool,
) -> Result<Option<Vec<ExperimentTrajectory>>, Vec<Fault>> {
    let (problem, positions) = at_estimate(spec, model, recordings, outcome)?;
    let Some(simulated) = trajectory::simulate(&problem, &positions, stop) else {
        return Ok(None);
    };
    let simulated = simulated.map_err(|failure| {
        let detail = format!("the simulation of the estimate fails: {}", failure.name());
        vec![Fault::new("", "simulation_fails", detail)]
    })?;
    let experiments = spec
        .experiments
        .iter()
        .zip(problem.experiments.iter())
        .zip(simulated);
    let shown = experiments.map(|((spec, data), simulated)| {
        let from = spec.window.and_then(|window| window.from_s).unwrap_or(0.0);
        let outputs = problem.outputs.iter().zip(&data.measured);
        ExperimentTrajectory {
            dataset: spec.dataset,
            time: (0..data.samples).map(|k| from + data.instant(k)).collect(),
            estimation_samples: data.estimation_samples,
            outputs: outputs
                .map(|(output, measured)| OutputTrajectory {
                    name: output.name.clone(),
                    unit: output.unit.clone(),
                    residual: difference(measured, &simulated[output.index]),
                    simulated: simulated[output.index].clone(),
                    measured: measured.clone(),
                })
                .collect(),
        }
    });
    Ok(Some(shown.collect()))
}

/// The problem of a result, without the effects that it left out, and where its estimate lies.
///
/// # Errors
/// When the recordings do not fit the specification any more.
pub(super) fn at_estimate(
    spec: &JobSpec,
    model: &Arc<Model>,
    recordings: &[Recording],
    outcome: &Outcome,
) -> Result<(Problem, Vec<f64>), Vec<Fault>> {
    let mut problem = super::problem(spec, model, recordings)?.problem;
    for start in &outcome.validation_starts {
        let state = model.description().state_index(&start.state);
        let experiments = Arc::make_mut(&mut problem.experiments);
        if let (Some(state), Some(own)) = (state, experiments.get_mut(start.experiment)) {
            own.initial_state[state] = Some(start.value);
        }
    }
    problem
        .coordinates
        .retain(|coordinate| is_estimated(coordinate, outcome));
    let positions = positions(&problem, outcome);
    Ok((problem, positions))
}

/// Whether the result has an estimate of it: an effect that the data do not support has none.
fn is_estimated(coordinate: &Coordinate, outcome: &Outcome) -> bool {
    let is_state = matches!(coordinate.target, Target::InitialState { .. });
    let mut estimated = outcome.parameters.iter();
    is_state
        || estimated.any(|known| {
            known.experiment == coordinate.target.experiment() && known.name == coordinate.quantity
        })
}

fn positions(problem: &Problem, outcome: &Outcome) -> Vec<f64> {
    let parameters = outcome
        .parameters
        .iter()
        .map(|parameter| &parameter.estimate);
    let states = outcome.initial_states.iter().map(|state| &state.estimate);
    let position = |(coordinate, known): (&Coordinate, &Estimate)| {
        coordinate
            .scale
            .position(known.estimate, coordinate.lower, coordinate.upper)
    };
    problem
        .coordinates
        .iter()
        .zip(parameters.chain(states))
        .map(position)
        .collect()
}

fn difference(measured: &[f64], simulated: &[f64]) -> Vec<f64> {
    measured
        .iter()
        .zip(simulated)
        .map(|(measured, simulated)| measured - simulated)
        .collect()
}
