//! A model driven by a recording.

use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

use super::spec::simulation::SimulationSpec;
use super::spec::{FixedValue, InitialStateSpec};
use greybox_numerics::parsing::Fault;
use greybox_recording::{
    ExperimentData, Mapped, Recording, RecordingSelection, Signal, TimeAxis, TimeWindow,
};
use greybox_simulation::model::{InitialState, Model, ModelDescription};
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};

/// All outputs of the model as a recording, at the instants of the one that drives it. Nothing when
/// `stop` was raised.
#[must_use]
pub fn simulate(
    spec: &SimulationSpec,
    model: &Model,
    recording: &Recording,
    stop: &AtomicBool,
) -> Option<Result<Recording, Vec<Fault>>> {
    let run = match Run::new(spec, model.description(), recording) {
        Ok(run) => run,
        Err(fault) => return Some(Err(vec![fault])),
    };
    let data = &run.data;
    let excitation = DrivingInputs {
        sample_time: data.sample_time,
        instants: data.instants.as_deref(),
        samples: data.samples,
        input_set: run.input_set,
        inputs: &run.inputs,
        accuracy: Accuracy::Full,
    };
    let candidate = SimulatedCandidate {
        parameters: &spec.parameters,
        initial_state: &run.initial_state,
    };
    let simulated = single::outputs(model.plant(), &[(excitation, candidate)], stop)?;
    let simulated = simulated.map_err(|failure| {
        let detail = format!("the simulation fails: {}", failure.name());
        vec![Fault::new("/parameters", "simulation_fails", detail)]
    });
    Some(simulated.map(|outputs| {
        let described = model.description().outputs.iter();
        let signals = described
            .zip(outputs.into_iter().flatten())
            .map(|(output, values)| Signal::new(&*output.name, &*output.unit, values));
        Recording::new(run.time(spec), signals.collect())
    }))
}

/// All that one simulation needs beside its model and parameters.
struct Run {
    data: ExperimentData,
    input_set: usize,
    inputs: Vec<Vec<f64>>,
    initial_state: Vec<Option<f64>>,
}

impl Run {
    fn new(
        spec: &SimulationSpec,
        model: &ModelDescription,
        recording: &Recording,
    ) -> Result<Run, Fault> {
        let mapped = spec.signals.iter();
        let mapped = mapped.map(|(model, recorded)| Mapped::held(model, recorded));
        let mapped: Vec<Mapped> = mapped.collect();
        let selection = RecordingSelection {
            window: spec.window.map(|window| TimeWindow {
                from_s: window.from_s,
                to_s: window.to_s,
            }),
            ..RecordingSelection::default()
        };
        let data = recording.experiment(&mapped, selection);
        let data =
            data.map_err(|error| Fault::new("", "experiment_not_possible", error.to_string()))?;
        let mapped = |set: &Vec<Cow<'static, str>>| {
            set.iter().all(|name| spec.signals.contains_key(&**name))
        };
        let input_set = model.input_sets.iter().position(mapped);
        let input_set = input_set.expect("a specification that exists maps one set of inputs");
        let mut inputs = Vec::new();
        for name in &model.input_sets[input_set] {
            let values = data.signal(name).unwrap_or_default().to_vec();
            refuse_missing(name, &values)?;
            inputs.push(values);
        }
        let states = model.states.iter();
        let initial_state = states.map(|state| {
            let given = spec.initial_state.get(&*state.name);
            match (given, &state.initial) {
                (Some(InitialStateSpec::Fixed(FixedValue { value, .. })), _)
                | (Some(InitialStateSpec::Number(value)), _) => Some(*value),
                (Some(InitialStateSpec::Measured(_)), _) => first(&data, &state.name),
                (None, InitialState::FirstSample { output }) => {
                    first(&data, &model.outputs[*output].name)
                }
                _ => None,
            }
        });
        Ok(Run {
            input_set,
            inputs,
            initial_state: initial_state.collect(),
            data,
        })
    }

    /// When its outputs are, from the recording's first sample.
    fn time(&self, spec: &SimulationSpec) -> TimeAxis {
        let from = spec.window.and_then(|window| window.from_s).unwrap_or(0.0);
        let ExperimentData {
            sample_time,
            samples,
            instants,
            ..
        } = &self.data;
        match instants {
            Some(instants) => TimeAxis::Instants(instants.clone()),
            None if from == 0.0 => TimeAxis::Uniform {
                sample_time: *sample_time,
                samples: *samples,
            },
            None => {
                let instants = (0..*samples).map(|k| from + k as f64 * sample_time);
                TimeAxis::Instants(instants.collect())
            }
        }
    }
}

/// The first sample of a signal that is there.
fn first(data: &ExperimentData, name: &str) -> Option<f64> {
    let values = data.signal(name).unwrap_or_default().iter();
    values.copied().find(|value| !value.is_nan())
}

/// An input must be known at every instant.
fn refuse_missing(name: &str, values: &[f64]) -> Result<(), Fault> {
    let missing = values.iter().filter(|value| value.is_nan()).count();
    if missing == 0 {
        return Ok(());
    }
    let detail = format!("{missing} samples of the input `{name}` are missing");
    Err(Fault::new("/signals", "input_missing", detail))
}
