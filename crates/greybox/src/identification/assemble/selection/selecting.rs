//! A selection at work: each window of a stream, looked at with the model at the estimate of a finished job.

use super::window::{HistoryWindow, LookedWindow};
use crate::estimation::loss::Loss;
use crate::estimation::problem::{Assumption, Coordinate, Problem, Target};
use crate::estimation::process_noise::filtered;
use crate::estimation::sensitivity::SensitivityError;
use crate::estimation::trajectory;
use crate::identification::assemble::PastResult;
use crate::identification::assemble::assembly::problem;
use crate::identification::assemble::design::simulated;
use crate::identification::assemble::disturbance::noise_model;
use crate::identification::assemble::start::tolerated;
use crate::identification::assemble::trajectory::{at_estimate, is_estimated};
use crate::identification::outcome::{Outcome, ProcessNoiseReport};
use crate::identification::selection::LeftOut;
use crate::identification::spec::selection::SelectionSpec;
use crate::identification::spec::{ExperimentRole, JobSpec};
use crate::uncertainty::assumed_values::take;
use crate::uncertainty::design::Present;
use crate::uncertainty::design::history::WindowInformation;
use crate::uncertainty::feedback::{LAGS, scores};
use crate::uncertainty::identifiability::with_fitted_starts;
use crate::uncertainty::probes::probed;
use greybox_numerics::parsing::fault::Fault;
use greybox_recording::{Recording, RecordingSource, RowSignal, stands_still};
use greybox_simulation::model::Model;
use rayon::prelude::*;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Simulated values that are held for one window at the most.
const MOST_VALUES: usize = 20_000_000;

/// A window is left out where a larger share of it has no samples.
const MOST_GAPS: f64 = 0.1;
/// Instants are apart by a gap where they are so many times as far apart as is usual.
const GAP: f64 = 5.0;

/// A selection at work: what is known before any window.
pub struct Selecting {
    pub(super) spec: SelectionSpec,
    /// The job of one window.
    pub(super) job: JobSpec,
    pub(super) model: Arc<Model>,
    outcome: Outcome,
    noise: Option<ProcessNoiseReport>,
    /// The problem that all windows share, without experiments.
    pub(super) shared: Problem,
    pub(super) positions: Vec<f64>,
    pub(super) wanted: Vec<usize>,
    pub(super) present: Present,
}

impl Selecting {
    /// Begins from a finished job. Answers nothing when `stop` was raised.
    ///
    /// # Errors
    /// What keeps the windows from being looked at, with JSON pointers.
    pub fn begin(
        spec: SelectionSpec,
        model: &Arc<Model>,
        past: PastResult<'_>,
        stop: &AtomicBool,
    ) -> Result<Option<Selecting>, Vec<Fault>> {
        let outcome = past.outcome;
        let (estimated, positions) = at_estimate(past.spec, model, past.recordings, outcome)?;
        let Some(mut shared) = probed(&estimated, &positions, stop) else {
            return Ok(None);
        };
        shared.loss = Loss::Squared;
        shared.experiments = Arc::default();
        let is_shared = |coordinate: &Coordinate| coordinate.target.experiment().is_none();
        shared.coordinates.retain(is_shared);
        Arc::make_mut(&mut shared.assumptions)
            .retain(|assumption| !assumption.belongs_to_an_experiment());
        let positions = positions_of(&shared, outcome);
        let wanted: Vec<usize> = (0..shared.coordinates.len())
            .filter(|index| spec.wanted.contains(&shared.coordinates[*index].quantity))
            .collect();
        if wanted.is_empty() {
            let detail = "the job left all that is wanted out of its model";
            return Err(vec![Fault::new("/job", "not_estimated", detail)]);
        }
        let present = Present::new(&shared, &positions, wanted.clone(), None, stop);
        let Some(present) = simulated(present, "/job")? else {
            return Ok(None);
        };
        let report = outcome.process_noise.clone();
        Ok(Some(Selecting {
            noise: report.filter(|report| !report.disturbances.is_empty()),
            outcome: outcome.clone(),
            model: Arc::clone(model),
            job: job_of_window(past, &spec),
            spec,
            shared,
            positions,
            wanted,
            present,
        }))
    }

    /// Whether a window is one that the request leaves out, by where it begins and ends, nanoseconds since 1970.
    #[must_use]
    pub fn is_excluded(&self, (from, until): (i64, i64)) -> bool {
        let nanoseconds = |instant: jiff::Timestamp| instant.as_nanosecond();
        let mut excluded = self.spec.excluded.iter();
        excluded.any(|(begin, end)| {
            nanoseconds(*begin) < until.into() && nanoseconds(*end) > from.into()
        })
    }

    /// Looks at windows side by side. Answers nothing when `stop` was raised.
    #[must_use]
    pub fn look(
        &self,
        windows: Vec<HistoryWindow>,
        signals: &[RowSignal],
        stop: &AtomicBool,
    ) -> Option<Vec<LookedWindow>> {
        let looked =
            windows
                .into_par_iter()
                .map(|window| match self.look_at(window, signals, stop) {
                    Ok(looked) => Some(looked),
                    Err(Unseen::Interrupted) => None,
                    Err(Unseen::LeftOut(reason)) => Some(LookedWindow::LeftOut(reason)),
                });
        looked.collect()
    }

    fn look_at(
        &self,
        window: HistoryWindow,
        signals: &[RowSignal],
        stop: &AtomicBool,
    ) -> Result<LookedWindow, Unseen> {
        let left_out = |reason| Err(Unseen::LeftOut(reason));
        let (rows, bounds) = match window {
            HistoryWindow::LeftOut(reason) => return left_out(reason),
            HistoryWindow::Recorded { rows, bounds } => (rows, bounds),
        };
        if rows.rows() < 2 {
            return left_out(LeftOut::NoSamples);
        }
        if share_of_gaps(&rows.instants, bounds) > MOST_GAPS {
            return left_out(LeftOut::Gaps);
        }
        let recorded = |name: &String| signals.iter().position(|signal| signal.name == *name);
        let outputs = self.shared.outputs.iter();
        let mut outputs = outputs
            .filter_map(|output| recorded(self.job.experiments[0].signals.get(&output.name)?));
        if outputs.any(|column| stands_still(&rows.columns[column].values)) {
            return left_out(LeftOut::OutputStoodStill);
        }
        match rows.into_recording(signals, RecordingSource::default()) {
            Some(recording) => self.information(&recording, stop),
            None => left_out(LeftOut::NoSamples),
        }
    }

    /// Has a window take the values and the assumptions that all windows share, behind those of the window alone.
    fn share_with(&self, problem: &mut Problem) {
        let mut assumptions = Vec::clone(&problem.assumptions);
        assumptions.retain(Assumption::belongs_to_an_experiment);
        assumptions.extend(self.shared.assumptions.iter().cloned());
        problem.assumptions = Arc::new(assumptions);
        problem.model = Arc::clone(&self.shared.model);
        problem.parameters.clone_from(&self.shared.parameters);
    }

    fn information(&self, window: &Recording, stop: &AtomicBool) -> Result<LookedWindow, Unseen> {
        let not_usable = |_| Unseen::LeftOut(LeftOut::NotUsable);
        let mut problem = problem(&self.job, &self.model, &[window])
            .map_err(not_usable)?
            .problem;
        problem
            .coordinates
            .retain(|coordinate| is_estimated(coordinate, &self.outcome));
        take_over(&mut problem, &self.outcome);
        self.share_with(&mut problem);
        let data = &problem.experiments[0];
        let columns = problem.coordinates.len() + problem.assumptions.len();
        if data.samples * problem.outputs.len() * (1 + 2 * columns) > MOST_VALUES {
            return Err(Unseen::LeftOut(LeftOut::TooManySamples));
        }
        let inputs: Vec<[f32; 2]> = data.inputs.iter().map(|input| extremes(input)).collect();
        if !inputs.is_empty() && inputs.iter().all(|[least, greatest]| least == greatest) {
            return Err(Unseen::LeftOut(LeftOut::InputsStoodStill));
        }
        let positions = positions_of(&problem, &self.outcome);
        let positions = with_fitted_starts(&problem, &positions, stop)?;
        let following = answer_by_the_model(&mut problem, &positions, stop)?;
        if let Some(report) = &self.noise {
            let noise = noise_model(&problem, report).ok_or(Unseen::LeftOut(LeftOut::NotUsable))?;
            problem =
                filtered(&problem, &noise).map_err(|_| Unseen::LeftOut(LeftOut::NotUsable))?;
        }
        let information = WindowInformation::of(&problem, &positions, stop)?;
        Ok(LookedWindow::Informs {
            information,
            inputs,
            following,
        })
    }
}

/// Why a window has no information.
enum Unseen {
    Interrupted,
    LeftOut(LeftOut),
}

impl From<SensitivityError> for Unseen {
    fn from(error: SensitivityError) -> Unseen {
        match error {
            SensitivityError::Interrupted => Unseen::Interrupted,
            SensitivityError::Failed(_) => Unseen::LeftOut(LeftOut::NotSimulated),
        }
    }
}

/// The job that estimates from one window, with the noise that the finished job found.
fn job_of_window(past: PastResult<'_>, spec: &SelectionSpec) -> JobSpec {
    let mut job = past.spec.clone();
    job.experiments
        .retain(|experiment| experiment.role == ExperimentRole::Estimation);
    job.experiments.truncate(1);
    for experiment in &mut job.experiments {
        experiment.window = None;
        experiment.exclude = None;
        experiment.version = None;
        let starts = spec.initial_state.clone();
        experiment.initial_state.extend(starts);
    }
    job.method.huber_threshold = None;
    job.process_noise = None;
    let measured = &past.outcome.residuals;
    for (name, residuals) in measured
        .iter()
        .filter(|(_, residuals)| residuals.noise_std > 0.0)
    {
        job.outputs.entry(name.clone()).or_default().noise_std = Some(residuals.noise_std);
    }
    job
}

/// Has a problem take the values that a result took as known.
fn take_over(problem: &mut Problem, outcome: &Outcome) {
    let taken = problem.assumptions.iter().map(|assumption| {
        let mut lines = outcome.budget.iter();
        let line = lines.find(|line| line.assumption == assumption.name);
        line.and_then(|line| line.taken).unwrap_or(assumption.value)
    });
    let taken: Vec<f64> = taken.collect();
    take(problem, &taken);
}

/// Where a result puts the unknowns; the middle of the range of those that belong to a window.
fn positions_of(problem: &Problem, outcome: &Outcome) -> Vec<f64> {
    let position = |coordinate: &Coordinate| {
        let Target::Parameter(_) = coordinate.target else {
            return 0.5;
        };
        let mut parameters = outcome.parameters.iter();
        let estimate = parameters.find(|parameter| parameter.name == coordinate.quantity);
        estimate.map_or(0.5, |parameter| {
            let (lower, upper) = (coordinate.lower, coordinate.upper);
            coordinate
                .scale
                .position(parameter.estimate.estimate, lower, upper)
        })
    };
    problem.coordinates.iter().map(position).collect()
}

/// Puts what the model answers in the place of what was measured; says how the inputs follow what it leaves. Where no start is estimated, both must begin alike:
/// a start that was fitted may be off the first sample by as much as a disturbance is large.
fn answer_by_the_model(
    problem: &mut Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Result<Vec<Option<[f32; 2 * LAGS]>>, Unseen> {
    let simulated = trajectory::simulate(problem, positions, stop).ok_or(Unseen::Interrupted)?;
    let simulated = simulated.map_err(|_| Unseen::LeftOut(LeftOut::NotSimulated))?;
    let mut experiments = Arc::clone(&problem.experiments);
    let data = &mut Arc::make_mut(&mut experiments)[0];
    let mut following = Vec::new();
    let is_fitted = problem.coordinates.iter().any(Coordinate::is_start);
    for (output, measured) in problem.outputs.iter().zip(&mut data.measured) {
        let simulated = &simulated[0][output.index];
        let mut both = measured.iter().zip(simulated);
        let first = both.find(|(measured, _)| !measured.is_nan());
        let is_off =
            |(first, simulated): (&f64, &f64)| (first - simulated).abs() > tolerated(measured);
        if !is_fitted && first.is_some_and(is_off) {
            return Err(Unseen::LeftOut(LeftOut::StartsElsewhere));
        }
        let residuals = measured.iter().zip(simulated);
        let residuals: Vec<f64> = residuals
            .map(|(measured, simulated)| measured - simulated)
            .collect();
        following.extend(data.inputs.iter().map(|input| scores(&residuals, input)));
        for (measured, simulated) in measured.iter_mut().zip(simulated) {
            if !measured.is_nan() {
                *measured = *simulated;
            }
        }
    }
    problem.experiments = experiments;
    Ok(following)
}

/// The share of a window that has no samples, by how far instants usually are apart.
fn share_of_gaps(instants: &[i64], (from, until): (i64, i64)) -> f64 {
    let steps = instants.windows(2).map(|pair| pair[1] - pair[0]);
    let mut sorted: Vec<i64> = steps.clone().collect();
    sorted.sort_unstable();
    let usual = sorted[sorted.len() / 2];
    let ends = [instants[0] - from, until - instants[instants.len() - 1]];
    let gaps = steps
        .chain(ends)
        .filter(|step| *step as f64 > GAP * usual as f64);
    gaps.map(|gap| (gap - usual) as f64).sum::<f64>() / (until - from) as f64
}

fn extremes(samples: &[f64]) -> [f32; 2] {
    let least = samples.iter().copied().fold(f64::INFINITY, f64::min);
    let greatest = samples.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    [least as f32, greatest as f32]
}
