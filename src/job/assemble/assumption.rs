//! What a job takes as known, with how well it is known.

use super::experiment;
use crate::estimation::problem::{Assumption, Target};
use crate::job::spec::{FixedValue, InitialStateSpec, JobSpec, ParameterSpec};
use crate::model::{ModelDescription, ParameterDescription};

/// Every number of a specification that is taken as known, but not exactly: parameters that
/// experiments share, those of single experiments, and where states start.
pub(super) fn assumptions(spec: &JobSpec, description: &ModelDescription) -> Vec<Assumption> {
    let mut found = Vec::new();
    let described = || description.parameters.iter().enumerate();
    for (index, parameter) in described() {
        let said = spec.parameters.get(&*parameter.name);
        if let Some(ParameterSpec::Fixed(fixed)) = said
            && spec.shares(&parameter.name)
        {
            found.extend(of_parameter(parameter, *fixed, Target::Parameter(index)));
        }
    }
    for (experiment, own) in spec.experiments.iter().enumerate() {
        for (index, parameter) in described() {
            if let Some(ParameterSpec::Fixed(fixed)) = own.parameters.get(&*parameter.name) {
                let target = Target::ExperimentParameter {
                    experiment,
                    parameter: index,
                };
                found.extend(of_parameter(parameter, *fixed, target));
            }
        }
        for (state, description) in description.states.iter().enumerate() {
            let said = own.initial_state.get(&*description.name);
            if let Some(InitialStateSpec::Fixed(fixed)) = said
                && let Some(tolerance) = size(*fixed)
            {
                found.push(Assumption {
                    name: experiment::name_of_start(&description.name, experiment),
                    unit: description.unit.to_string(),
                    target: Target::InitialState { experiment, state },
                    value: fixed.value,
                    tolerance,
                    is_absent_effect: false,
                    limits: [None, None],
                });
            }
        }
    }
    found
}

/// The tolerance, where the value is not exact.
fn size(fixed: FixedValue) -> Option<f64> {
    let size = fixed.tolerance?.of(fixed.value);
    (size > 0.0).then_some(size)
}

fn of_parameter(
    parameter: &ParameterDescription,
    fixed: FixedValue,
    target: Target,
) -> Option<Assumption> {
    Some(Assumption {
        name: super::name_of(parameter, target),
        unit: parameter.unit.to_string(),
        target,
        value: fixed.value,
        tolerance: size(fixed)?,
        is_absent_effect: parameter.default == 0.0 && fixed.value == 0.0,
        limits: [parameter.minimum, parameter.maximum],
    })
}
