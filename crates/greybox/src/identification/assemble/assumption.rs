//! What a job takes as known, with how well it is known.

use super::coordinates::name_of;
use crate::estimation::problem::{Assumed, Assumption, MeasuredOutput, SensorNumber, Target};
use crate::identification::outcome::name_of_start;
use crate::identification::spec::{
    FixedValue, InitialStateSpec, JobSpec, OutputSpec, ParameterSpec,
};
use greybox_simulation::model::{ModelDescription, ParameterDescription};

/// Every number of a specification that is taken as known, but not exactly: parameters that
/// experiments share, those of single experiments, and where states start; then those of the sensors
/// and the clock.
pub(super) fn assumptions(
    spec: &JobSpec,
    description: &ModelDescription,
    outputs: &[MeasuredOutput],
) -> Vec<Assumption> {
    let mut assumptions = Vec::new();
    let described = || description.parameters.iter().enumerate();
    for (index, parameter) in described() {
        let parameter_spec = spec.parameters.get(&*parameter.name);
        if let Some(ParameterSpec::Fixed(fixed)) = parameter_spec
            && spec.shares(&parameter.name)
        {
            assumptions.extend(of_parameter(parameter, *fixed, Target::Parameter(index)));
        }
    }
    for (experiment, experiment_spec) in spec.experiments.iter().enumerate() {
        for (index, parameter) in described() {
            if let Some(ParameterSpec::Fixed(fixed)) =
                experiment_spec.parameters.get(&*parameter.name)
            {
                let target = Target::ExperimentParameter {
                    experiment,
                    parameter: index,
                };
                assumptions.extend(of_parameter(parameter, *fixed, target));
            }
        }
        for (state, description) in description.states.iter().enumerate() {
            let state_spec = experiment_spec.initial_state.get(&*description.name);
            if let Some(InitialStateSpec::Fixed(fixed)) = state_spec
                && let Some(tolerance) = size(*fixed)
            {
                assumptions.push(Assumption {
                    name: name_of_start(&description.name, experiment),
                    unit: description.unit.to_string(),
                    target: Assumed::Model(Target::InitialState { experiment, state }),
                    value: fixed.value,
                    taken: fixed.value,
                    tolerance,
                    is_absent_effect: false,
                    is_default: false,
                    limits: [None, None],
                });
            }
        }
    }
    assumptions.extend(outputs.iter().enumerate().flat_map(|(place, output)| {
        let sensor = spec.outputs.get(&output.name);
        sensor
            .into_iter()
            .flat_map(move |sensor| of_sensor(sensor, place, output))
    }));
    let clock = spec.clock_tolerance.map(|tolerance| tolerance.of(1.0));
    assumptions.extend(
        clock
            .filter(|tolerance| *tolerance > 0.0)
            .map(|tolerance| Assumption {
                name: "clock".to_owned(),
                unit: String::new(),
                target: Assumed::Clock,
                value: 1.0,
                taken: 1.0,
                tolerance,
                is_absent_effect: false,
                is_default: false,
                limits: [Some(0.0), None],
            }),
    );
    assumptions
}

/// What is known of an output's sensor.
fn of_sensor<'a>(
    sensor: &OutputSpec,
    place: usize,
    output: &'a MeasuredOutput,
) -> impl Iterator<Item = Assumption> + use<'a> {
    let numbers = [
        (
            SensorNumber::Gain,
            sensor.gain_tolerance.map(|tolerance| tolerance.of(1.0)),
        ),
        (SensorNumber::Offset, sensor.offset_tolerance),
        (SensorNumber::Lag, sensor.lag_tolerance_s),
    ];
    numbers.into_iter().filter_map(move |(number, tolerance)| {
        let tolerance = tolerance.filter(|tolerance| *tolerance > 0.0)?;
        Some(Assumption::of_sensor(
            &output.name,
            &output.unit,
            place,
            number,
            tolerance,
        ))
    })
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
        name: name_of(parameter, target),
        unit: parameter.unit.to_string(),
        target: Assumed::Model(target),
        value: fixed.value,
        taken: fixed.value,
        tolerance: size(fixed)?,
        is_absent_effect: parameter.default == 0.0 && fixed.value == 0.0,
        is_default: false,
        limits: [parameter.minimum, parameter.maximum],
    })
}
