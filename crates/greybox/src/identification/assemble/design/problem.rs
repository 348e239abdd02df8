//! The problem of the job to come, without data: an experiment is designed for that.

use super::super::coordinates::parameters;
use super::super::trajectory::at_estimate;
use super::super::{assumption, constraints, experiment, priors};
use crate::estimation::loss::Loss;
use crate::estimation::problem::{Coordinate, Experiment, MeasuredOutput, Problem, Target};
use crate::estimation::sensitivity::{SensitivityError, Sides};
use crate::estimation::{Finding, trajectory};
use crate::identification::outcome::{Estimate, Outcome};
use crate::identification::spec::design::{DesignSpec, Plan};
use crate::identification::spec::{InitialStateSpec, JobSpec};
use crate::uncertainty::assumed_values::take;
use crate::uncertainty::design::{Past, Present};
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
    /// The specification of the job.
    pub spec: &'a JobSpec,
    /// The outcome of the job.
    pub outcome: &'a Outcome,
    /// The recordings that the job estimated from.
    pub recordings: &'a [Arc<Recording>],
}

/// The problem of the job to come, where its unknowns are at present, and what came before.
pub(super) struct DesignProblem {
    /// The problem, whose experiments stand in for the one that is designed.
    pub next: Problem,
    /// Where the unknowns are.
    pub positions: Vec<f64>,
    /// The indices of the unknowns that matter.
    pub wanted: Vec<usize>,
    /// The earlier estimate.
    pub past: Option<Past>,
    /// What the user should know.
    pub findings: Vec<Finding>,
    /// Where each state starts in the next experiment.
    start: Vec<Option<f64>>,
}

/// The experiment that is designed, with all that was known before the experiment.
#[derive(Clone, Copy)]
pub(super) struct Question<'a> {
    /// The specification of the design.
    pub spec: &'a DesignSpec,
    /// The problem of the job to come.
    pub problem: &'a DesignProblem,
    /// The knowledge of the unknowns before the new experiment.
    pub present: &'a Present,
}

/// How an experiment is played and sampled.
pub(super) struct Course {
    /// How many samples there are.
    pub samples: usize,
    /// The time from one sample to the next.
    pub sample_time: f64,
    /// When the samples are, where that is not uniform.
    pub instants: Option<Vec<f64>>,
    /// Which of the model's input sets is driven.
    pub input_set: usize,
    /// The samples of each input of the set.
    pub inputs: Vec<Vec<f64>>,
}

/// The result of a simulation; nothing where the simulation was stopped, a fault at `pointer` where
/// the simulation failed.
pub(in crate::identification::assemble) fn simulated<T>(
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

impl DesignProblem {
    pub(super) fn new(
        spec: &DesignSpec,
        model: &Arc<Model>,
        past: Option<PastResult<'_>>,
    ) -> Result<DesignProblem, Vec<Fault>> {
        let description = model.description();
        let next_experiment = spec.job.experiments.len() - 1;
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
            let is_start = |c: &Coordinate| matches!(c.target, Target::InitialState { .. });
            // An effect that the job left out is no unknown.
            coordinates.retain(|c| problem.coordinates.iter().any(|other| other.name == c.name));
            coordinates.extend(problem.coordinates.iter().filter(|c| is_start(c)).cloned());
        }
        let starts = starts
            .iter()
            .map(|free| free.coordinate(description, next_experiment));
        coordinates.extend(starts);
        let estimated = |coordinate: &Coordinate| {
            let (problem, positions) = earlier.as_ref()?;
            let mut others = problem.coordinates.iter();
            let index = others.position(|other| other.name == coordinate.name)?;
            Some(positions[index])
        };
        let positions = coordinates
            .iter()
            .map(|coordinate| estimated(coordinate).unwrap_or(middle(coordinate)));
        let mut next = Problem {
            model: Arc::clone(model),
            parameters: values,
            outputs: outputs(spec, description),
            experiments: Arc::default(),
            loss: Loss::Squared,
            // Nothing is assumed of sensors: the question may be which sensors there will be.
            assumptions: Arc::new(assumption::assumptions(&spec.job, description, &[])),
            tolerances: Arc::default(),
            joint_priors: Arc::new(priors::joint(&spec.job, description)),
            constraints: Arc::new(constraints::compiled(&spec.job, description)),
            coordinates: coordinates.clone(),
            innovations: None,
        };
        if let Some((problem, _)) = &earlier {
            carry_on(&mut next, problem);
        }
        let wants = |coordinate: &Coordinate| {
            !matches!(coordinate.target, Target::InitialState { .. })
                && spec.wanted.contains(&coordinate.quantity)
        };
        let wanted: Vec<usize> = (0..coordinates.len())
            .filter(|index| wants(&coordinates[*index]))
            .collect();
        if wanted.is_empty() {
            let detail = "the job left all of it out of its model: nothing of it is estimated";
            return Err(vec![Fault::new("/wanted", "not_estimated", detail)]);
        }
        Ok(DesignProblem {
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

    /// An experiment that measures all outputs.
    pub(super) fn experiment(&self, spec: &DesignSpec, course: Course) -> Experiment {
        let (outputs, samples) = (self.next.outputs.len(), course.samples);
        Experiment {
            place: spec.job.experiments.len() - 1,
            sample_time: course.sample_time,
            instants: course.instants,
            samples,
            estimation_samples: samples,
            scored_from: samples,
            input_set: course.input_set,
            inputs: course.inputs,
            // Only the derivatives count: what will be measured does not.
            measured: vec![vec![0.0; samples]; outputs],
            weights: vec![None; outputs],
            initial_state: self.start.clone(),
            parameters: Vec::new(),
            unknown_starts: Vec::new(),
            start_samples: None,
        }
    }

    /// Refuses experiments of more derivatives or values than there may be; whether `stop` was not
    /// raised meanwhile.
    pub(super) fn check_cost(
        &self,
        spec: &DesignSpec,
        most_derivatives: f64,
        stop: &AtomicBool,
    ) -> Result<bool, Vec<Fault>> {
        let columns = self.positions.len() + self.next.assumptions.len();
        let candidates = Sides::Both.candidates(columns);
        let pointer = match &spec.plan {
            Plan::Excite(_) => "/duration_s",
            Plan::Sample(_) => "/instants",
        };
        let (course, points) = (self.middle_course(&spec.plan), spec.points);
        let samples = course.samples;
        let mut problem = self.next.clone();
        problem.experiments = Arc::new(vec![self.experiment(spec, course)]);
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

    /// The longest experiment of a plan, each input in the middle between its limits.
    fn middle_course(&self, plan: &Plan) -> Course {
        let (samples, sample_time, input_set, limits) = match plan {
            Plan::Excite(plan) => {
                let grid = &plan.grid;
                let limits = &grid.inputs[..];
                (grid.samples, grid.sample_time, plan.input_set, limits)
            }
            Plan::Sample(plan) => {
                let samples = plan.candidates.len() + plan.measured.len() + 1;
                let last = plan.candidates.iter().copied().fold(0.0, f64::max);
                (samples, last / samples as f64, 0, &[][..])
            }
        };
        let names = &self.next.model.description().input_sets[input_set];
        let middle = |index: usize| {
            let limits = limits.get(index);
            let middle = limits.map_or(0.0, |limits| f64::midpoint(limits.lower, limits.upper));
            vec![middle; samples]
        };
        Course {
            samples,
            sample_time: sample_time.max(f64::MIN_POSITIVE),
            instants: None,
            input_set,
            inputs: (0..names.len()).map(middle).collect(),
        }
    }
}

/// Has a problem take the values that an earlier estimate took of numbers of which both jobs declare
/// the same.
fn carry_on(next: &mut Problem, earlier: &Problem) {
    let taken = next.assumptions.iter().map(|assumption| {
        let mut of_earlier = earlier.assumptions.iter();
        let same = of_earlier
            .find(|before| before.name == assumption.name && before.value == assumption.value);
        same.map_or(assumption.value, |before| before.taken)
    });
    let taken: Vec<f64> = taken.collect();
    take(next, &taken);
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
    let next = spec.job.experiments.last();
    let start_of = |name: &str| next.and_then(|next| next.initial_state.get(name));
    let (mut start, mut free) = (Vec::new(), Vec::new());
    for (state, described) in description.states.iter().enumerate() {
        start.push(match start_of(&described.name) {
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
                if described.initial.is_estimated() {
                    let detail = format!(
                        "a job estimates where `{}` starts; here it is taken as known: give its \
                         range, `{{\"estimate\": {{\"lower\": …, \"upper\": …}}}}`",
                        described.name
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
    let parameters = outcome
        .parameters
        .iter()
        .map(|parameter| &parameter.estimate);
    let starts = outcome.initial_states.iter().map(|start| &start.estimate);
    let names = problem.coordinates.iter().map(|c| c.name.clone());
    let errors: Vec<(String, Option<f64>)> = names
        .zip(parameters.chain(starts))
        .map(|(name, estimate): (String, &Estimate)| (name, estimate.standard_error))
        .collect();
    let error_of = |coordinate: &Coordinate| {
        let mut errors = errors.iter();
        errors.find(|(name, _)| *name == coordinate.name)?.1
    };
    let weight = |output: &MeasuredOutput| {
        let residuals = outcome.residuals.get(&output.name);
        residuals.map_or(1.0, |residuals| output.residual_scale / residuals.noise_std)
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
