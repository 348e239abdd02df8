//! Measured and simulated outputs of a result, side by side.

use crate::estimation::Problem;
use crate::estimation::problem::{Coordinate, Experiment, Target};
use crate::estimation::trajectory::{self, Errors};
use crate::identification::DatasetId;
use crate::identification::outcome::{Estimate, Outcome};
use crate::identification::spec::{ExperimentSpec, JobSpec};
use crate::uncertainty::assumed_values::{shown_by_sensors, take};
use greybox_numerics::parsing::fault::Fault;
use greybox_recording::Recording;
use greybox_simulation::model::Model;
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
    /// The name of the output.
    pub name: String,
    /// The SI unit of the output.
    pub unit: String,
    /// Measured samples; NaN where missing.
    pub measured: Vec<f64>,
    /// Simulated samples.
    pub simulated: Vec<f64>,
    /// measured − simulated; NaN where missing.
    pub residual: Vec<f64>,
    /// One standard deviation of the simulated samples through the errors of the estimates, where these
    /// are known.
    pub deviation: Option<Vec<f64>>,
}

/// Simulates a result over the recordings that it was made from. Answers nothing when `stop` was
/// raised.
///
/// # Errors
/// When the recordings do not fit the specification any more, or the simulation fails.
pub fn trajectory(
    spec: &JobSpec,
    model: &Arc<Model>,
    recordings: &[Arc<Recording>],
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
    let Some(simulated) = shown_by_sensors(&problem, &positions, simulated, stop) else {
        return Ok(None);
    };
    let clock = problem.clock();
    let deviations = match errors(&problem, &positions, outcome) {
        Some(errors) => match trajectory::deviations(&problem, &positions, &errors, stop) {
            Some(deviations) => deviations,
            None => return Ok(None),
        },
        None => None,
    };
    let experiments = spec
        .experiments
        .iter()
        .zip(problem.experiments.iter())
        .zip(simulated)
        .enumerate();
    let shown = experiments.map(|(number, ((spec, data), simulated))| {
        let deviation = |place: usize| Some(deviations.as_ref()?[number][place].clone());
        let outputs = problem.outputs.iter().zip(&data.measured);
        ExperimentTrajectory {
            dataset: spec.dataset,
            time: instants(spec, data, clock),
            estimation_samples: data.estimation_samples,
            outputs: outputs
                .enumerate()
                .map(|(place, (output, measured))| OutputTrajectory {
                    name: output.name.clone(),
                    unit: output.unit.clone(),
                    residual: difference(measured, &simulated[output.index]),
                    simulated: simulated[output.index].clone(),
                    measured: measured.clone(),
                    deviation: deviation(place),
                })
                .collect(),
        }
    });
    Ok(Some(shown.collect()))
}

/// The instants of an experiment, from the recording's first sample `[s]`; `clock` is how long one of the
/// recording's seconds is.
pub(super) fn instants(spec: &ExperimentSpec, data: &Experiment, clock: f64) -> Vec<f64> {
    let from = spec.window.and_then(|window| window.from_s).unwrap_or(0.0);
    let samples = 0..data.samples;
    samples.map(|k| from + data.instant(k) / clock).collect()
}

/// The problem of a result, without the effects that it left out and with the values that it took as
/// known, and where its estimate lies.
///
/// # Errors
/// When the recordings do not fit the specification any more.
pub(super) fn at_estimate(
    spec: &JobSpec,
    model: &Arc<Model>,
    recordings: &[Arc<Recording>],
    outcome: &Outcome,
) -> Result<(Problem, Vec<f64>), Vec<Fault>> {
    let mut problem = super::problem(spec, model, recordings)?.problem;
    for start in &outcome.validation_starts {
        let state = model.description().state_index(&start.state);
        let experiments = Arc::make_mut(&mut problem.experiments);
        if let (Some(state), Some(experiment)) = (state, experiments.get_mut(start.experiment)) {
            experiment.initial_state[state] = Some(start.value);
        }
    }
    problem
        .coordinates
        .retain(|coordinate| is_estimated(coordinate, outcome));
    let taken = problem.assumptions.iter().map(|assumption| {
        let mut lines = outcome.budget.iter();
        let line = lines.find(|line| line.assumption == assumption.name);
        line.and_then(|line| line.taken).unwrap_or(assumption.value)
    });
    let taken: Vec<f64> = taken.collect();
    take(&mut problem, &taken);
    let positions = positions(&problem, outcome);
    Ok((problem, positions))
}

/// Whether the result has an estimate of it: an effect that the data do not support has none.
pub(super) fn is_estimated(coordinate: &Coordinate, outcome: &Outcome) -> bool {
    let is_state = matches!(coordinate.target, Target::InitialState { .. });
    let mut estimated = outcome.parameters.iter();
    is_state
        || estimated.any(|estimate| {
            estimate.experiment == coordinate.target.experiment()
                && estimate.name == coordinate.quantity
        })
}

/// The estimates in the order of a problem's coordinates.
fn estimates(outcome: &Outcome) -> impl Iterator<Item = &Estimate> {
    let parameters = outcome.parameters.iter();
    let states = outcome.initial_states.iter().map(|state| &state.estimate);
    parameters
        .map(|parameter| &parameter.estimate)
        .chain(states)
}

fn positions(problem: &Problem, outcome: &Outcome) -> Vec<f64> {
    let position = |(coordinate, estimate): (&Coordinate, &Estimate)| {
        coordinate
            .scale
            .position(estimate.estimate, coordinate.lower, coordinate.upper)
    };
    problem
        .coordinates
        .iter()
        .zip(estimates(outcome))
        .map(position)
        .collect()
}

/// The errors of the estimates as positions; none where one of them or a correlation is not known.
fn errors(problem: &Problem, positions: &[f64], outcome: &Outcome) -> Option<Errors> {
    let coordinates = problem.coordinates.iter().zip(positions);
    let deviation = |((coordinate, position), estimate): ((&Coordinate, &f64), &Estimate)| {
        let (lower, upper) = (coordinate.lower, coordinate.upper);
        let shifted = estimate.estimate + estimate.standard_error?;
        let moved = coordinate.scale.position(shifted, lower, upper) - position;
        moved.is_finite().then_some(moved.abs())
    };
    let correlation = outcome.correlation.as_ref()?;
    let place = |coordinate: &Coordinate| {
        correlation
            .names
            .iter()
            .position(|name| *name == coordinate.name)
    };
    let places: Vec<usize> = problem
        .coordinates
        .iter()
        .map(place)
        .collect::<Option<_>>()?;
    let row = |a: &usize| places.iter().map(|b| correlation.matrix[*a][*b]).collect();
    Some(Errors {
        deviations: coordinates
            .zip(estimates(outcome))
            .map(deviation)
            .collect::<Option<_>>()?,
        correlation: places.iter().map(row).collect::<Option<_>>()?,
    })
}

pub(super) fn difference(measured: &[f64], simulated: &[f64]) -> Vec<f64> {
    measured
        .iter()
        .zip(simulated)
        .map(|(measured, simulated)| measured - simulated)
        .collect()
}
