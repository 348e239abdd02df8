//! The problem of a changed specification, without the recordings.

use super::{assumption, constraints, coordinates, priors, tolerances};
use crate::estimation::Problem;
use crate::estimation::problem::{MeasuredOutput, Target};
use crate::identification::spec::{ExperimentSpec, JobSpec, OutputSpec, ParameterSpec};
use std::sync::Arc;

/// The problem of a specification that was changed, from that of the specification before. None where the change
/// needs the recordings again, because it takes other samples, starts or a noise that differs from sample to sample,
/// or where it leaves nothing that can be solved.
#[must_use]
pub fn changed(problem: &Problem, before: &JobSpec, spec: &JobSpec) -> Option<Problem> {
    let is_cut_alike = spec.experiments.len() == before.experiments.len()
        && spec
            .experiments
            .iter()
            .zip(&before.experiments)
            .all(is_cut_alike)
        && spec.validation == before.validation;
    if !is_cut_alike || spec.method.huber_threshold != before.method.huber_threshold {
        return None;
    }
    let description = problem.model.description();
    let (parameters, mut unknowns) = coordinates::parameters(spec, description);
    let is_start = |target: Target| matches!(target, Target::InitialState { .. });
    let starts = problem.coordinates.iter();
    unknowns.extend(starts.filter(|start| is_start(start.target)).cloned());
    if unknowns.is_empty() {
        return None;
    }
    let outputs = problem.outputs.iter();
    let outputs = outputs.map(|output| {
        let [output_spec, spec_before] = [spec, before].map(|spec| spec.outputs.get(&output.name));
        with_noise(output, output_spec, spec_before)
    });
    let outputs = outputs.collect::<Option<Vec<MeasuredOutput>>>()?;
    let assumptions = assumption::assumptions(spec, description, &outputs);
    let mut problem = Problem {
        parameters,
        coordinates: unknowns,
        outputs,
        assumptions: Arc::new(assumptions),
        tolerances: Arc::default(),
        joint_priors: Arc::new(priors::joint(spec, description)),
        constraints: Arc::new(constraints::compiled(spec, description)),
        ..problem.clone()
    };
    problem.tolerances = Arc::new(tolerances::named(spec, &problem).ok()?);
    constraints::check(&problem).ok()?;
    Some(problem)
}

/// Whether two experiments take the same samples, starts and known parameters of their own.
fn is_cut_alike((experiment, before): (&ExperimentSpec, &ExperimentSpec)) -> bool {
    let [experiment, before] = [experiment, before].map(|experiment| {
        let mut cut = experiment.clone();
        let parameters = &mut cut.parameters;
        parameters.retain(|_, parameter| matches!(parameter, ParameterSpec::Fixed(_)));
        cut
    });
    experiment == before
}

/// An output with the noise that is said of it now; none where the noise differs from sample to sample and is said
/// otherwise.
fn with_noise(
    output: &MeasuredOutput,
    output_spec: Option<&OutputSpec>,
    before: Option<&OutputSpec>,
) -> Option<MeasuredOutput> {
    let [output_spec, before] = [output_spec, before].map(|output_spec| {
        let output_spec = output_spec.cloned().unwrap_or_default();
        OutputSpec {
            noise_std: output_spec.noise_std,
            noise_share: output_spec.noise_share,
            noise_signal: output_spec.noise_signal,
            ..OutputSpec::default()
        }
    });
    if output_spec == before {
        return Some(output.clone());
    }
    let is_one_number = |output_spec: &OutputSpec| {
        output_spec.noise_share.is_none() && output_spec.noise_signal.is_none()
    };
    let noise = output_spec
        .noise_std
        .filter(|_| is_one_number(&output_spec) && is_one_number(&before))?;
    Some(MeasuredOutput {
        noise_std: Some(noise),
        residual_scale: noise,
        ..output.clone()
    })
}
