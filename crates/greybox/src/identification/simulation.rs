//! A model driven by a recording.

use std::borrow::Cow;
use std::sync::atomic::AtomicBool;

use super::spec::simulation::{KnownNoise, SimulationSpec};
use super::spec::{FixedValue, InitialStateSpec};
use crate::estimation::process_noise::{self, FilteredRecord, NoiseNumber, ProcessNoise};
use greybox_numerics::parsing::Fault;
use greybox_recording::{
    ExperimentData, Mapped, Recording, RecordingSelection, Signal, TimeAxis, TimeWindow,
};
use greybox_simulation::filter::StartVariance;
use greybox_simulation::model::{InitialState, Model, ModelDescription};
use greybox_simulation::single::Outputs;
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};

/// Steps of the covariance between two samples.
const COVARIANCE_STEPS: f64 = 4.0;

/// What a simulation came to.
#[derive(Debug)]
pub struct SimulatedRecord {
    /// All outputs of the model, at the instants of the recording that drives it. Where disturbances
    /// move the plant they are what is expected from all samples before, and `OUTPUT_std` is the
    /// standard deviation of each one's error.
    pub recording: Recording,
    /// The natural logarithm of the likelihood of the measured outputs, where disturbances move the
    /// plant.
    pub log_likelihood: Option<f64>,
}

/// Simulates a model over the recording that drives it. Nothing when `stop` was raised.
#[must_use]
pub fn simulate(
    spec: &SimulationSpec,
    model: &Model,
    recording: &Recording,
    stop: &AtomicBool,
) -> Option<Result<SimulatedRecord, Vec<Fault>>> {
    let run = match Run::new(spec, model.description(), recording) {
        Ok(run) => run,
        Err(fault) => return Some(Err(vec![fault])),
    };
    match &spec.process_noise {
        None => run.free(spec, model, stop),
        Some(noise) => run.filtered(spec, noise, model, stop),
    }
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

    /// The outputs of a model whose inputs are these, or how the simulation fails. Nothing when
    /// `stop` was raised.
    fn outputs(
        &self,
        model: &Model,
        inputs: &[Vec<f64>],
        parameters: &[f64],
        stop: &AtomicBool,
    ) -> Option<Result<Outputs, Vec<Fault>>> {
        let excitation = DrivingInputs {
            sample_time: self.data.sample_time,
            instants: self.data.instants.as_deref(),
            samples: self.data.samples,
            input_set: self.input_set,
            inputs,
            accuracy: Accuracy::Full,
        };
        let candidate = SimulatedCandidate {
            parameters,
            initial_state: &self.initial_state,
        };
        let simulated = single::outputs(model.plant(), &[(excitation, candidate)], stop)?;
        let simulated = simulated.map_err(|failure| {
            let detail = format!("the simulation fails: {}", failure.name());
            vec![Fault::new("/parameters", "simulation_fails", detail)]
        });
        Some(simulated.map(|outputs| outputs.into_iter().flatten().collect()))
    }

    /// The outputs where nothing but the inputs moves the plant.
    fn free(
        &self,
        spec: &SimulationSpec,
        model: &Model,
        stop: &AtomicBool,
    ) -> Option<Result<SimulatedRecord, Vec<Fault>>> {
        let outputs = self.outputs(model, &self.inputs, &spec.parameters, stop)?;
        Some(outputs.map(|outputs| {
            let described = model.description().outputs.iter();
            let signals = described
                .zip(outputs)
                .map(|(output, values)| Signal::new(&*output.name, &*output.unit, values));
            SimulatedRecord {
                recording: Recording::new(self.time(spec), signals.collect()),
                log_likelihood: None,
            }
        }))
    }

    /// The expected outputs where disturbances move the plant.
    fn filtered(
        &self,
        spec: &SimulationSpec,
        noise: &KnownNoise,
        model: &Model,
        stop: &AtomicBool,
    ) -> Option<Result<SimulatedRecord, Vec<Fault>>> {
        let description = model.description();
        let sample_time = self.data.sample_time;
        let evenly = self.data.instants.is_none().then_some(sample_time);
        let disturbances: Vec<_> = noise
            .disturbances
            .iter()
            .map(|noise| noise.disturbance)
            .collect();
        let filter = model.controller(evenly, &disturbances);
        let filter = filter.and_then(|controller| {
            let filtered = FilteredRecord {
                starts: vec![StartVariance::Known(0.0); description.states.len()],
                controller,
                recorded: Vec::new(),
                n_inputs: self.inputs.len(),
                longest_step: sample_time / COVARIANCE_STEPS,
            };
            model.filtered(&process_noise::layout(&noise.disturbances, filtered))
        });
        let filter = match filter {
            Ok(filter) => filter,
            Err(fault) => {
                let fault = Fault::new("/process_noise", "filter_not_possible", fault.to_string());
                return Some(Err(vec![fault]));
            }
        };
        let of_disturbances = noise.disturbances.iter().flat_map(ProcessNoise::numbers);
        let sensor_of = |name: &str| noise.sensors.iter().find(|(sensor, _)| sensor == name);
        let outputs = description.outputs.iter();
        // An output that is not measured corrects nothing, whatever its sensor.
        let sensors = outputs
            .clone()
            .map(|output| sensor_of(&output.name).map_or(0.0, |(_, std)| *std));
        let parameters = spec.parameters.iter().copied();
        let parameters: Vec<f64> = parameters
            .chain(of_disturbances.map(NoiseNumber::typical))
            .chain(sensors)
            .collect();
        let missing = vec![f64::NAN; self.data.samples];
        let measured = outputs.map(|output| {
            self.data
                .signal(&output.name)
                .map_or(&missing[..], |values| values)
        });
        let measured: Vec<Vec<f64>> = measured.map(<[f64]>::to_vec).collect();
        let inputs: Vec<Vec<f64>> = self.inputs.iter().chain(&measured).cloned().collect();
        let outputs = self.outputs(&filter, &inputs, &parameters, stop)?;
        Some(outputs.map(|outputs| self.expected(spec, description, &measured, outputs)))
    }

    /// Expected outputs, their standard deviations and the likelihood of what was measured.
    fn expected(
        &self,
        spec: &SimulationSpec,
        description: &ModelDescription,
        measured: &[Vec<f64>],
        mut outputs: Outputs,
    ) -> SimulatedRecord {
        let variances = outputs.split_off(description.outputs.len());
        let mut signals = Vec::new();
        let mut log_likelihood = 0.0;
        let columns = outputs.into_iter().zip(variances).zip(measured);
        for (described, ((expected, variances), measured)) in
            description.outputs.iter().zip(columns)
        {
            for ((measured, expected), variance) in measured.iter().zip(&expected).zip(&variances) {
                log_likelihood += log_density(measured - expected, *variance);
            }
            let deviations = variances.into_iter().map(f64::sqrt).collect();
            let name = format!("{}_std", described.name);
            signals.push(Signal::new(&*described.name, &*described.unit, expected));
            signals.push(Signal::new(&name, &*described.unit, deviations));
        }
        SimulatedRecord {
            recording: Recording::new(self.time(spec), signals),
            log_likelihood: Some(log_likelihood),
        }
    }

    /// The instants of the outputs, from the recording's first sample.
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

/// The logarithm of the normal density of an error; 0 where nothing was measured.
fn log_density(error: f64, variance: f64) -> f64 {
    if error.is_nan() {
        return 0.0;
    }
    -0.5 * (libm::log(2.0 * std::f64::consts::PI * variance) + error * error / variance)
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
