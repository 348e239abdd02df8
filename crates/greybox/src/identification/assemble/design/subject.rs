//! What an experiment is designed for: the problem of the job to come, without data.

use super::super::trajectory::at_estimate;
use super::super::{assumption, constraints, experiment, parameters, priors};
use crate::estimation::loss::Loss;
use crate::estimation::problem::{Coordinate, Experiment, MeasuredOutput, Problem, Target};
use crate::estimation::sensitivity::{SensitivityError, Sides};
use crate::estimation::{Finding, trajectory};
use crate::identification::outcome::{Estimate, Outcome};
use crate::identification::spec::design::{DesignSpec, Plan};
use crate::identification::spec::{InitialStateSpec, JobSpec};
use crate::uncertainty::design::Past;
use greybox_numerics::parsing::fault::Fault;
use greybox_recording::Recording;
use greybox_simulation::model::{Model, ModelDescription, Scale};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Simulated values that are held for one experiment at one point at the most.
const MOST_VALUES: usize = 5_000_000;

/// A finished job that a design begins from.
#[derive(Clone, Copy, Debug)]
pub struct PastResult<'a> {
    /// What the job was asked.
    pub spec: &'a JobSpec,
    /// The outcome of the job.
    pub outcome: &'a Outcome,
    /// The recordings that the job estimated from.
    pub recordings: &'a [Arc<Recording>],
}

/// The problem of the job to come, where its unknowns are at present, and what came before.
pub(super) struct Subject {
    /// The problem; its experiments stand in for the one that is designed.
    pub next: Problem,
    /// Where the unknowns are.
    pub positions: Vec<f64>,
    /// Places of the unknowns that matter.
    pub wanted: Vec<usize>,
    /// The earlier estimate.
    pub past: Option<Past>,
    /// What the user should know.
    pub findings: Vec<Finding>,
    /// Where each state starts in the next experiment.
    start: Vec<Option<f64>>,
}

/// What was simulated; nothing where that was stopped, a fault at `pointer` where it failed.
pub(super) fn simulated<T>(
    result: Result<T, SensitivityError>,
    pointer: &str,
) -> Result<Option<T>, Vec<Fault>> {
    match result {
        Ok(simulated) => Ok(Some(simulated)),
        Err(SensitivityError::Interrupted) => Ok(None),
        Err(SensitivityError::Failed(failure)) => {
            let detail = format!("the simulation fails: {}", failure.name());
            Err(vec![Fault::new(pointer, "simulation_fails", detail)])
        }
    }
}

impl Subject {
    pub(super) fn new(
        spec: &DesignSpec,
        model: &Arc<Model>,
        past: Option<PastResult<'_>>,
    ) -> Result<Subject, Vec<Fault>> {
        let description = model.description();
        let place = spec.job.experiments.len() - 1;
        let (values, mut coordinates) = parameters(&spec.job, description);
        let mut findings = Vec::new();
        let (start, starts) = start(spec, description, &mut findings);
        let earlier = match past {
            Some(past) => Some(at_estimate(
                past.spec,
                model,
                past.recordings,
                past.outcome,
            )?),
            None => None,
        };
        if let Some((problem, _)) = &earlier {
            let is_start = |own: &Coordinate| matches!(own.target, Target::InitialState { .. });
            let there = |own: &Coordinate| problem.coordinates.iter().any(|c| c.name == own.name);
            // An effect that the job left out is no unknown.
            coordinates.retain(there);
            coordinates.extend(problem.coordinates.iter().filter(|c| is_start(c)).cloned());
        }
        let starts = starts
            .iter()
            .map(|free| free.coordinate(description, place));
        coordinates.extend(starts);
        let known = |own: &Coordinate| {
            let (problem, positions) = earlier.as_ref()?;
            let place = problem
                .coordinates
                .iter()
                .position(|c| c.name == own.name)?;
            Some(positions[place])
        };
        let positions = coordinates
            .iter()
            .map(|own| known(own).unwrap_or(middle(own)));
        let next = Problem {
            model: Arc::clone(model),
            parameters: values,
            outputs: outputs(spec, description),
            experiments: Arc::default(),
            loss: Loss::Squared,
            // Of sensors nothing is assumed: which of them there will be may be the question.
            assumptions: Arc::new(assumption::assumptions(&spec.job, description, &[])),
            joint_priors: Arc::new(priors::joint(&spec.job, description)),
            constraints: Arc::new(constraints::compiled(&spec.job, description)),
            coordinates: coordinates.clone(),
        };
        let wants = |own: &Coordinate| {
            !matches!(own.target, Target::InitialState { .. })
                && spec.wanted.contains(&own.quantity)
        };
        let wanted: Vec<usize> = (0..coordinates.len())
            .filter(|index| wants(&coordinates[*index]))
            .collect();
        if wanted.is_empty() {
            let detail = "the job left all of it out of its model: nothing of it is estimated";
            return Err(vec![Fault::new("/wanted", "not_estimated", detail)]);
        }
        Ok(Subject {
            positions: positions.collect(),
            past: past
                .zip(earlier)
                .map(|(past, (problem, _))| before(&next, past, problem)),
            next,
            wanted,
            findings,
            start,
        })
    }

    /// An experiment that measures all outputs at uniform samples, or at some instants.
    pub(super) fn experiment(
        &self,
        spec: &DesignSpec,
        (samples, sample_time): (usize, f64),
        instants: Option<Vec<f64>>,
        (input_set, inputs): (usize, Vec<Vec<f64>>),
    ) -> Experiment {
        let outputs = self.next.outputs.len();
        Experiment {
            place: spec.job.experiments.len() - 1,
            sample_time,
            instants,
            samples,
            estimation_samples: samples,
            scored_from: samples,
            input_set,
            inputs,
            // Only the derivatives count: what will be measured does not.
            measured: vec![vec![0.0; samples]; outputs],
            weights: vec![None; outputs],
            initial_state: self.start.clone(),
            parameters: Vec::new(),
            unknown_starts: Vec::new(),
            start_samples: None,
        }
    }

    /// Refuses experiments of more derivatives or values than there may be; whether it was not
    /// stopped meanwhile.
    pub(super) fn check_cost(
        &self,
        spec: &DesignSpec,
        most_derivatives: f64,
        stop: &AtomicBool,
    ) -> Result<bool, Vec<Fault>> {
        let columns = self.positions.len() + self.next.assumptions.len();
        let candidates = Sides::Both.candidates(columns);
        let (pointer, shape, points) = match &spec.plan {
            Plan::Excite(plan) => {
                let grid = &plan.grid;
                let shape = (grid.samples, grid.sample_time, plan.input_set);
                ("/duration_s", shape, spec.points)
            }
            Plan::Sample(plan) => {
                let samples = plan.candidates.len() + plan.measured.len() + 1;
                let last = plan.candidates.iter().copied().fold(0.0, f64::max);
                (
                    "/instants",
                    (samples, last / samples as f64, 0),
                    spec.points,
                )
            }
        };
        let (samples, sample_time, input_set) = shape;
        let inputs = &self.next.model.description().input_sets[input_set];
        let limits = match &spec.plan {
            Plan::Excite(plan) => &plan.grid.inputs[..],
            Plan::Sample(_) => &[],
        };
        let middle = |place: usize| {
            let middle = limits
                .get(place)
                .map_or(0.0, |l| f64::midpoint(l.lower, l.upper));
            vec![middle; samples]
        };
        let inputs = (0..inputs.len()).map(middle).collect();
        let mut problem = self.next.clone();
        let shape = (samples, sample_time.max(f64::MIN_POSITIVE));
        problem.experiments = Arc::new(vec![self.experiment(
            spec,
            shape,
            None,
            (input_set, inputs),
        )]);
        let values = samples * (problem.outputs.len() + 1) * candidates as usize;
        let Some(each) = trajectory::derivatives(&problem, &self.positions, stop) else {
            return Ok(false);
        };
        let cost = each as f64 * candidates as f64 * points as f64;
        if cost > most_derivatives || values > MOST_VALUES {
            let detail = format!(
                "one experiment takes {cost:.1e} derivatives at {points} points and {values} values \
                 at each, more than {most_derivatives:.1e} and {MOST_VALUES}: ask for fewer samples, fewer \
                 `points`, or give exact values to what need not have a tolerance"
            );
            return Err(vec![Fault::new(pointer, "too_costly", detail)]);
        }
        let Some(past) = &self.past else {
            return Ok(true);
        };
        let Some(each) = trajectory::derivatives(&past.problem, &self.positions, stop) else {
            return Ok(false);
        };
        let values = past.problem.n_residuals() * candidates as usize;
        let cost = each as f64 * candidates as f64;
        if cost > most_derivatives || values > 2 * MOST_VALUES {
            let detail = format!(
                "the recordings of the job take {cost:.1e} derivatives and {values} values, more \
                 than {most_derivatives:.1e} and {}: go on from a job over a shorter window",
                2 * MOST_VALUES
            );
            return Err(vec![Fault::new("/job", "too_costly", detail)]);
        }
        Ok(true)
    }
}

/// The middle of what is known of an unknown before any data.
fn middle(coordinate: &Coordinate) -> f64 {
    let (lower, upper) = (coordinate.lower, coordinate.upper);
    let Some(prior) = coordinate.prior else {
        return 0.5;
    };
    let value = match prior.scale {
        Scale::Linear => prior.middle,
        Scale::Log => libm::exp(prior.middle),
    };
    let value = value.clamp(lower, upper);
    coordinate.scale.position(value, lower, upper)
}

/// The outputs that will be measured, in the model's order.
fn outputs(spec: &DesignSpec, description: &ModelDescription) -> Vec<MeasuredOutput> {
    let names = description.outputs.iter().map(|output| &*output.name);
    let noise = |name: &str| spec.job.outputs.get(name)?.noise_std;
    names
        .filter_map(|name| measured_output(description, name, noise(name)?))
        .collect()
}

/// An output that is measured with noise of this standard deviation.
pub(super) fn measured_output(
    description: &ModelDescription,
    name: &str,
    noise: f64,
) -> Option<MeasuredOutput> {
    let index = description.output_index(name)?;
    Some(MeasuredOutput {
        index,
        name: name.to_owned(),
        unit: description.outputs[index].unit.to_string(),
        noise_std: Some(noise),
        residual_scale: noise,
    })
}

/// Where each state starts, and those starts that will be estimated.
fn start(
    spec: &DesignSpec,
    description: &ModelDescription,
    findings: &mut Vec<Finding>,
) -> (Vec<Option<f64>>, Vec<experiment::FreeState>) {
    let said = spec.job.experiments.last();
    let said = |name: &str| said.and_then(|next| next.initial_state.get(name));
    let (mut start, mut free) = (Vec::new(), Vec::new());
    for (state, own) in description.states.iter().enumerate() {
        start.push(match said(&own.name) {
            Some(InitialStateSpec::Fixed(fixed)) => Some(fixed.value),
            Some(InitialStateSpec::Number(value)) => Some(*value),
            Some(InitialStateSpec::Free(range)) => {
                free.push(experiment::FreeState {
                    state,
                    lower: range.estimate.lower,
                    upper: range.estimate.upper,
                    prior: range.prior.map(|prior| prior.distribution()),
                });
                None
            }
            Some(InitialStateSpec::Measured(_)) => None,
            None => {
                if own.initial.is_estimated() {
                    let detail = format!(
                        "a job estimates where `{}` starts; here it is taken as known: give its \
                         range, `{{\"estimate\": {{\"lower\": …, \"upper\": …}}}}`",
                        own.name
                    );
                    findings.push(Finding::new(
                        "start_taken_as_known",
                        "/initial_state",
                        &detail,
                    ));
                }
                None
            }
        });
    }
    (start, free)
}

/// The earlier estimate as one of the unknowns of the job to come.
fn before(next: &Problem, past: PastResult<'_>, mut problem: Problem) -> Past {
    let outcome = past.outcome;
    let estimates = outcome.parameters.iter().map(|known| &known.estimate);
    let estimates = estimates.chain(outcome.initial_states.iter().map(|known| &known.estimate));
    let told: Vec<(String, Option<f64>)> = problem
        .coordinates
        .iter()
        .zip(estimates)
        .map(|(own, known): (&Coordinate, &Estimate)| (own.name.clone(), known.standard_error))
        .collect();
    let error_of = |own: &Coordinate| {
        let found = told.iter().find(|(name, _)| *name == own.name);
        found.and_then(|(_, error)| *error)
    };
    let weight = |output: &MeasuredOutput| {
        let residuals = outcome.residuals.get(&output.name);
        residuals.map_or(1.0, |own| output.residual_scale / own.noise_std)
    };
    let weights = problem.outputs.iter().map(weight).collect();
    problem.coordinates.clone_from(&next.coordinates);
    problem.assumptions = Arc::clone(&next.assumptions);
    problem.parameters.clone_from(&next.parameters);
    Past {
        standard_errors: next.coordinates.iter().map(error_of).collect(),
        weights,
        problem,
    }
}
