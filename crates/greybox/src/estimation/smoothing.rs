//! The disturbances of a problem's records as all samples put them, and when something acted that the noise
//! model does not expect.
//!
//! The filter goes through each record at the estimate, held-back samples included, and the smoother goes back
//! ([`TracedRecord`]).

use super::problem::{Experiment, Problem};
use super::process_noise::{NoiseFault, NoiseModel, filtered_by, layout_of};
use super::trajectory;
use greybox_simulation::SimulationFailure;
use greybox_simulation::filter::{FilterLayout, SmoothedPath, SmoothedRecord, TracedRecord};
use greybox_simulation::program::DisturbanceKind;
use greybox_simulation::{Accuracy, DrivingInputs};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Numbers that a filter may leave of one record.
const MOST_NUMBERS: usize = 32 << 20;

/// An auxiliary residual beyond this is an event. Chance alone makes a normal number of this size in one of
/// 16 000 samples.
pub const EVENT_RESIDUAL: f64 = 4.0;

/// A record as all of its samples put it.
#[derive(Clone, Debug)]
pub struct SmoothedExperiment {
    /// The states and the disturbances.
    pub record: SmoothedRecord,
    /// For each disturbance its events.
    pub events: Vec<Vec<DisturbanceEvent>>,
    /// For each compared output the samples as they were expected from all samples before.
    pub expected: Vec<SmoothedPath>,
}

/// A stretch of time in which a disturbance received more than its noise model expects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisturbanceEvent {
    /// The sample at which the event begins.
    pub start: usize,
    /// The sample at which the event ends.
    pub end: usize,
    /// The sample behind which the auxiliary residual is largest.
    pub peak: usize,
    /// The auxiliary residual there.
    pub residual: f64,
    /// The mean of white noise over the event; the change of any other disturbance from the start of the event to
    /// its end.
    pub size: f64,
}

/// Why a problem cannot be smoothed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SmoothingFault {
    /// The problem cannot be filtered.
    #[error("{0}")]
    Filter(NoiseFault),
    /// The filter of the estimate fails.
    #[error("the simulation of the estimate fails: {}", .0.name())]
    Simulation(SimulationFailure),
    /// There are too many samples.
    #[error("{samples} samples are too many for a smoother: {most} are possible with this model")]
    TooManySamples {
        /// The samples of the record.
        samples: usize,
        /// The samples that a record may have.
        most: usize,
    },
}

/// Smooths each record at positions of the problem's unknowns. All numbers of the noise model are given. Answers
/// nothing when `stop` was raised.
///
/// # Errors
/// Where a record cannot be smoothed.
pub fn smoothed(
    problem: &Problem,
    positions: &[f64],
    noise: &NoiseModel,
    stop: &AtomicBool,
) -> Result<Option<Vec<SmoothedExperiment>>, SmoothingFault> {
    let layout = FilterLayout {
        is_traced: true,
        ..layout_of(problem, noise).map_err(SmoothingFault::Filter)?
    };
    let mut smoothed = Vec::with_capacity(problem.experiments.len());
    // One record after the other: what the filter leaves of a record takes memory.
    for data in problem.experiments.iter() {
        let alone = Problem {
            experiments: Arc::new(vec![Experiment {
                estimation_samples: data.samples,
                ..data.clone()
            }]),
            ..problem.clone()
        };
        let filtered = filtered_by(&alone, noise, &layout).map_err(SmoothingFault::Filter)?;
        let most = MOST_NUMBERS / filtered.plant().n_outputs();
        if data.samples > most {
            let samples = data.samples;
            return Err(SmoothingFault::TooManySamples { samples, most });
        }
        let Some(columns) = trajectory::simulate(&filtered, positions, stop) else {
            return Ok(None);
        };
        let columns = columns.map_err(SmoothingFault::Simulation)?;
        smoothed.push(experiment(&filtered, noise, &layout, &columns[0]));
    }
    Ok(Some(smoothed))
}

/// The only experiment of a filtered problem, from what the filter answers.
fn experiment(
    filtered: &Problem,
    noise: &NoiseModel,
    layout: &FilterLayout,
    columns: &[Vec<f64>],
) -> SmoothedExperiment {
    let data = &filtered.experiments[0];
    let n_outputs = filtered
        .innovations
        .as_ref()
        .map_or(0, |innovations| innovations.n_outputs);
    let strengths = noise.disturbances.iter();
    let strengths: Vec<f64> = strengths.map(|noise| noise.strength.typical()).collect();
    let traced = TracedRecord {
        layout,
        inputs: DrivingInputs {
            sample_time: data.sample_time,
            instants: data.instants.as_deref(),
            samples: data.samples,
            input_set: data.input_set,
            inputs: &data.inputs,
            accuracy: Accuracy::Full,
        },
        n_outputs,
        strengths: &strengths,
        columns,
    };
    let record = traced.smoothed();
    let paths = record.disturbances.iter().zip(&record.residuals);
    let kinds = layout.disturbances.iter().map(|noise| noise.kind);
    let events = paths
        .zip(kinds)
        .map(|((path, residuals), kind)| events(data, kind, &path.values, residuals))
        .collect();
    let expected = filtered.outputs.iter().map(|output| SmoothedPath {
        values: columns[output.index].clone(),
        deviations: columns[n_outputs + output.index]
            .iter()
            .map(|variance| variance.sqrt())
            .collect(),
    });
    SmoothedExperiment {
        expected: expected.collect(),
        events,
        record,
    }
}

/// Neighbouring samples whose auxiliary residuals lie beyond [`EVENT_RESIDUAL`] at the same side are one event.
fn events(
    data: &Experiment,
    kind: DisturbanceKind,
    values: &[f64],
    residuals: &[f64],
) -> Vec<DisturbanceEvent> {
    let side = |residual: f64| match residual.abs() > EVENT_RESIDUAL {
        true => residual.signum(),
        false => 0.0,
    };
    let mut events = Vec::new();
    let mut first = 0;
    for run in residuals.chunk_by(|left, right| side(*left) == side(*right)) {
        let (start, end) = (first, first + run.len());
        first = end;
        if side(run[0]) == 0.0 {
            continue;
        }
        let larger = |left: &usize, right: &usize| {
            let [left, right] = [*left, *right].map(|sample| residuals[sample].abs());
            left.total_cmp(&right)
        };
        let peak = (start..end).max_by(larger).unwrap_or(start);
        let size = match kind {
            DisturbanceKind::White => {
                let length = |sample: usize| data.instant(sample + 1) - data.instant(sample);
                let sum: f64 = (start..end).map(|k| values[k] * length(k)).sum();
                sum / (data.instant(end) - data.instant(start))
            }
            DisturbanceKind::Memory | DisturbanceKind::Walk => values[end] - values[start],
        };
        events.push(DisturbanceEvent {
            start,
            end,
            peak,
            residual: residuals[peak],
            size,
        });
    }
    events
}
