//! The parameters of a problem: what is known of them, and the unknown ones as coordinates.

use crate::estimation::problem::{Coordinate, Target};
use crate::identification::spec::{FreeParameter, JobSpec, ParameterSpec};
use greybox_simulation::model::{ModelDescription, ParameterDescription};

/// A value for each parameter, and the free ones as coordinates: those that experiments share
/// first, then those of single experiments.
pub(super) fn parameters(
    spec: &JobSpec,
    description: &ModelDescription,
) -> (Vec<f64>, Vec<Coordinate>) {
    let mut values = description.defaults();
    let mut coordinates = Vec::new();
    for (index, parameter) in description.parameters.iter().enumerate() {
        match spec.parameters.get(&*parameter.name) {
            Some(ParameterSpec::Fixed(fixed)) => values[index] = fixed.value,
            Some(ParameterSpec::Free(free)) if spec.shares(&parameter.name) => {
                let target = Target::Parameter(index);
                coordinates.push(coordinate(parameter, free, target));
            }
            _ => {}
        }
    }
    for (experiment, experiment_spec) in spec.experiments.iter().enumerate() {
        for (index, parameter) in description.parameters.iter().enumerate() {
            if let Some(ParameterSpec::Free(free)) =
                experiment_spec.parameters.get(&*parameter.name)
            {
                let target = Target::ExperimentParameter {
                    experiment,
                    parameter: index,
                };
                coordinates.push(coordinate(parameter, free, target));
            }
        }
    }
    (values, coordinates)
}

fn coordinate(
    parameter: &ParameterDescription,
    free: &FreeParameter,
    target: Target,
) -> Coordinate {
    Coordinate {
        name: name_of(parameter, target),
        quantity: parameter.name.to_string(),
        symbol: parameter.symbol.to_string(),
        unit: parameter.unit.to_string(),
        target,
        lower: free.estimate.lower,
        upper: free.estimate.upper,
        scale: free.estimate.scale,
        start: free.estimate.start,
        prior: free.prior.map(|prior| prior.distribution()),
    }
}

/// What a parameter is called, where it is an experiment's own too.
pub(super) fn name_of(parameter: &ParameterDescription, target: Target) -> String {
    match target.experiment() {
        None => parameter.name.to_string(),
        Some(experiment) => format!("{}[{experiment}]", parameter.name),
    }
}
