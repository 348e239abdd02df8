//! What acted on the plant over the recordings of a result, sample by sample.

use super::PastResult;
use super::trajectory::{at_estimate, difference, instants};
use crate::estimation::Problem;
use crate::estimation::noise_ladder::COVARIANCE_STEPS;
use crate::estimation::problem::{Experiment, MeasuredOutput};
use crate::estimation::process_noise::{NoiseModel, NoiseNumber};
use crate::estimation::smoothing::{self, DisturbanceEvent, SmoothedExperiment};
use crate::identification::DatasetId;
use crate::identification::outcome::{DisturbanceReport, NoiseNumberReport, ProcessNoiseReport};
use crate::identification::spec::{ActsOnSpec, NoiseKind, NoiseNumberSpec, ProcessNoiseSpec};
use greybox_numerics::parsing::fault::Fault;
use greybox_simulation::filter::SmoothedPath;
use greybox_simulation::model::Model;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// One experiment of a result.
#[derive(Clone, Debug)]
pub struct ExperimentDisturbances {
    /// The recording.
    pub dataset: DatasetId,
    /// The instants, from the recording's first sample `[s]`.
    pub time: Vec<f64>,
    /// How many of the instants were estimated from; the rest validates.
    pub estimation_samples: usize,
    /// The disturbances of the noise model that was chosen.
    pub disturbances: Vec<DisturbancePath>,
    /// The states of the model as all samples put them.
    pub states: Vec<NamedPath>,
    /// The measured outputs.
    pub outputs: Vec<OutputInnovations>,
}

/// One disturbance of an experiment.
#[derive(Clone, Debug)]
pub struct DisturbancePath {
    /// The quantity that the disturbance acts on; a state's rate is disturbed.
    pub acts_on: ActsOnSpec,
    /// How the disturbance moves.
    pub kind: NoiseKind,
    /// The SI unit of the quantity that the disturbance acts on.
    pub unit: String,
    /// The disturbance at each sample; white noise as its mean from the sample to the next.
    pub path: SmoothedPath,
    /// The auxiliary residual of what the disturbance received from each sample to the next: standard normal
    /// where the noise model holds.
    pub residuals: Vec<f64>,
    /// The events, in the order of time.
    pub events: Vec<DatedEvent>,
    /// For each output the share of its variance that the disturbance makes.
    pub share_of_output: BTreeMap<String, f64>,
}

/// A stretch of time in which a disturbance received more than its noise model expects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DatedEvent {
    /// When the event begins `[s]`, from the recording's first sample.
    pub start: f64,
    /// When the event ends `[s]`.
    pub end: f64,
    /// When the auxiliary residual is largest `[s]`.
    pub peak: f64,
    /// The auxiliary residual there.
    pub residual: f64,
    /// The mean of white noise over the event; the change of any other disturbance from the start of the event to
    /// its end.
    pub size: f64,
}

/// A state as all samples put it.
#[derive(Clone, Debug)]
pub struct NamedPath {
    /// The name of the state.
    pub name: String,
    /// The SI unit of the state.
    pub unit: String,
    /// The state at each sample.
    pub path: SmoothedPath,
}

/// One output of an experiment, expected from sample to sample.
#[derive(Clone, Debug)]
pub struct OutputInnovations {
    /// The name of the output.
    pub name: String,
    /// The SI unit of the output.
    pub unit: String,
    /// The samples as they were expected from all samples before, with one standard deviation of the difference
    /// to what is measured.
    pub expected: SmoothedPath,
    /// measured − expected; NaN where a sample is missing.
    pub innovation: Vec<f64>,
}

/// Smooths the recordings that a result was made from, under the noise model of the result. Answers nothing when
/// `stop` was raised.
///
/// # Errors
/// When the recordings or the model do not fit the result any more, or the filter fails.
pub fn disturbances(
    result: &PastResult<'_>,
    model: &Arc<Model>,
    report: &ProcessNoiseReport,
    stop: &AtomicBool,
) -> Result<Option<Vec<ExperimentDisturbances>>, Vec<Fault>> {
    let PastResult {
        spec,
        outcome,
        recordings,
    } = *result;
    let fault = |code: &'static str, detail: String| vec![Fault::new("", code, detail)];
    let (problem, positions) = at_estimate(spec, model, recordings, outcome)?;
    let Some(noise) = noise_model(&problem, report) else {
        let detail = "the model has nothing more that the disturbances of the result act on";
        return Err(fault("model_changed", detail.to_owned()));
    };
    let smoothed = smoothing::smoothed(&problem, &positions, &noise, stop);
    let smoothed = smoothed.map_err(|failure| fault("simulation_fails", failure.to_string()))?;
    let Some(smoothed) = smoothed else {
        return Ok(None);
    };
    let clock = problem.clock();
    let experiments = spec.experiments.iter().zip(problem.experiments.iter());
    let shown = experiments.zip(smoothed).map(|((spec, data), smoothed)| {
        let time = instants(spec, data, clock);
        ExperimentDisturbances {
            dataset: spec.dataset,
            estimation_samples: data.estimation_samples,
            disturbances: paths(report, &time, &smoothed),
            states: states(&problem, &smoothed),
            outputs: outputs(&problem, data, &smoothed),
            time,
        }
    });
    Ok(Some(shown.collect()))
}

/// The noise model of a result, with the numbers that were estimated; none where the model lacks a quantity that
/// a disturbance acts on.
pub(super) fn noise_model(problem: &Problem, report: &ProcessNoiseReport) -> Option<NoiseModel> {
    let description = problem.model.description();
    let disturbance = |disturbance: &DisturbanceReport| {
        let number = |number: &NoiseNumberReport| NoiseNumberSpec::Given(number.estimate);
        let spec = ProcessNoiseSpec {
            acts_on: disturbance.acts_on.clone(),
            kind: disturbance.kind,
            std: None,
            strength: Some(number(&disturbance.strength)),
            time_constant_s: disturbance.time_constant_s.as_ref().map(number),
        };
        spec.known(description)
    };
    let sensor = |output: &MeasuredOutput| {
        let sensor = report.sensors.get(&output.name)?;
        Some(NoiseNumber::Given(sensor.estimate))
    };
    Some(NoiseModel {
        disturbances: report
            .disturbances
            .iter()
            .map(disturbance)
            .collect::<Option<_>>()?,
        sensors: problem.outputs.iter().map(sensor).collect::<Option<_>>()?,
        steps: COVARIANCE_STEPS,
    })
}

fn paths(
    report: &ProcessNoiseReport,
    time: &[f64],
    smoothed: &SmoothedExperiment,
) -> Vec<DisturbancePath> {
    let dated = |event: &DisturbanceEvent| DatedEvent {
        start: time[event.start],
        end: time[event.end],
        peak: time[event.peak],
        residual: event.residual,
        size: event.size,
    };
    let disturbances = report.disturbances.iter().enumerate();
    let path = |(place, report): (usize, &DisturbanceReport)| DisturbancePath {
        acts_on: report.acts_on.clone(),
        kind: report.kind,
        unit: report.unit.clone(),
        path: smoothed.record.disturbances[place].clone(),
        residuals: smoothed.record.residuals[place].clone(),
        events: smoothed.events[place].iter().map(dated).collect(),
        share_of_output: report.share_of_output.clone(),
    };
    disturbances.map(path).collect()
}

fn states(problem: &Problem, smoothed: &SmoothedExperiment) -> Vec<NamedPath> {
    let states = problem.model.description().states.iter();
    let named = states.zip(&smoothed.record.states);
    named
        .map(|(state, path)| NamedPath {
            name: state.name.to_string(),
            unit: state.unit.to_string(),
            path: path.clone(),
        })
        .collect()
}

fn outputs(
    problem: &Problem,
    data: &Experiment,
    smoothed: &SmoothedExperiment,
) -> Vec<OutputInnovations> {
    let outputs = problem.outputs.iter().zip(&data.measured);
    outputs
        .zip(&smoothed.expected)
        .map(|((output, measured), expected)| OutputInnovations {
            name: output.name.clone(),
            unit: output.unit.clone(),
            expected: expected.clone(),
            innovation: difference(measured, &expected.values),
        })
        .collect()
}
