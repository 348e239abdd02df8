//! The problem of a specification and its recordings.

use super::experiment::Cutter;
use super::{Finding, assumption, constraints, coordinates, noise, priors, tolerances};
use crate::estimation::Problem;
use crate::estimation::loss::Loss;
use crate::estimation::problem::MeasuredOutput;
use crate::estimation::process_noise::{NoiseModel, NoiseNumber, ProcessNoise, filtered};
use crate::identification::spec::JobSpec;
use crate::uncertainty::SoughtNoise;
use greybox_numerics::parsing::fault::Fault;
use greybox_recording::Recording;
use greybox_simulation::model::{Model, ModelDescription};
use greybox_simulation::program::DisturbanceKind;
use std::borrow::Borrow;
use std::sync::Arc;

/// A problem ready to be estimated, and what was changed or noticed on the way.
#[derive(Debug)]
pub struct Assembly {
    /// The problem.
    pub problem: Problem,
    /// Findings that the job's user should know.
    pub findings: Vec<Finding>,
}

/// Assembles the problem of a specification from its recordings, one for each experiment.
///
/// # Errors
/// All that keeps the experiments from being cut out of the recordings, with JSON pointers.
pub fn problem(
    spec: &JobSpec,
    model: &Arc<Model>,
    recordings: &[impl Borrow<Recording>],
) -> Result<Assembly, Vec<Fault>> {
    let description = model.description();
    let mut outputs = measured_outputs(spec, description);
    let mut cuts = Vec::new();
    let mut faults = Vec::new();
    for (index, (experiment, recording)) in spec.experiments.iter().zip(recordings).enumerate() {
        let pointer = format!("/experiments/{index}");
        let cutter = Cutter {
            description,
            outputs: &outputs,
            output_specs: &spec.outputs,
            validation_fraction: spec.validation.fraction,
            pointer: &pointer,
            place: index,
        };
        match cutter.cut(experiment, recording.borrow()) {
            Ok(cut) => cuts.push(cut),
            Err(cut_faults) => faults.extend(cut_faults),
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let (parameters, mut coordinates) = coordinates::parameters(spec, description);
    for (index, cut) in cuts.iter().enumerate() {
        coordinates.extend(
            cut.free_states
                .iter()
                .map(|free| free.coordinate(description, index)),
        );
    }
    noise::settle(&mut outputs, spec, &mut cuts)?;
    let findings = cuts
        .iter_mut()
        .flat_map(|cut| std::mem::take(&mut cut.findings))
        .collect();
    let experiments = Arc::new(cuts.into_iter().map(|cut| cut.experiment).collect());
    let assumptions = assumption::assumptions(spec, description, &outputs);
    let mut problem = Problem {
        model: Arc::clone(model),
        parameters,
        coordinates,
        outputs,
        experiments,
        loss: spec
            .method
            .huber_threshold
            .map_or(Loss::Squared, Loss::Huber),
        assumptions: Arc::new(assumptions),
        tolerances: Arc::default(),
        joint_priors: Arc::new(priors::joint(spec, description)),
        constraints: Arc::new(constraints::compiled(spec, description)),
        innovations: None,
    };
    problem.tolerances = Arc::new(tolerances::named(spec, &problem)?);
    constraints::check(&problem)?;
    if problem.n_residuals() <= problem.coordinates.len() {
        let detail = format!(
            "{} measured samples cannot fix {} unknowns",
            problem.n_residuals(),
            problem.coordinates.len()
        );
        return Err(vec![Fault::new("/experiments", "too_few_samples", detail)]);
    }
    check_filter(spec, &problem)?;
    Ok(Assembly { problem, findings })
}

/// Whether the disturbances that the job lists can be filtered.
fn check_filter(spec: &JobSpec, problem: &Problem) -> Result<(), Vec<Fault>> {
    let SoughtNoise::Listed(listed) = spec.sought_noise(problem.model.description()) else {
        return Ok(());
    };
    let unit = NoiseNumber::Given(1.0);
    let disturbances = listed.iter().map(|sought| ProcessNoise {
        name: String::new(),
        disturbance: sought.disturbance,
        strength: unit,
        time_constant: (sought.disturbance.kind == DisturbanceKind::Memory).then_some(unit),
    });
    let noise = NoiseModel {
        disturbances: disturbances.collect(),
        sensors: vec![unit; problem.outputs.len()],
        steps: 1,
    };
    let checked = filtered(problem, &noise).map(drop);
    checked.map_err(|fault| {
        let detail = fault.to_string();
        vec![Fault::new("/process_noise", "filter_not_possible", detail)]
    })
}

/// The outputs that at least one experiment measures, in the model's order.
fn measured_outputs(spec: &JobSpec, description: &ModelDescription) -> Vec<MeasuredOutput> {
    let is_measured = |name: &str| {
        spec.experiments
            .iter()
            .any(|experiment| experiment.signals.contains_key(name))
    };
    let outputs = description.outputs.iter().enumerate();
    outputs
        .filter(|(_, output)| is_measured(&output.name))
        .map(|(index, output)| MeasuredOutput {
            index,
            name: output.name.to_string(),
            unit: output.unit.to_string(),
            noise_std: None,
            residual_scale: 1.0,
        })
        .collect()
}
