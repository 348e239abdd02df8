//! `greybox simulate`: the outputs of a model with given parameters under recorded inputs.

use super::error::CommandError;
use super::files;
use crate::job::Fault;
use crate::model::{Model, ModelDescription};
use crate::recording::{Experiment, Mapped, Recording, Selection, Signal, TimeAxis};
use crate::simulation::{Accuracy, Candidate, Excitation, single};
use clap::Args;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// What `simulate` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording with the model's inputs under the model's names, CSV or JSON
    recording: PathBuf,

    /// Values of parameters, a JSON object {"mass": 58, …}; what is not named has its default
    parameters: Option<PathBuf>,

    /// The model: a name of the catalogue, or the file of a model document, JSON or YAML
    #[arg(long, default_value = "single_rod_servo")]
    model: String,

    /// The file to write, CSV [default: standard output]
    #[arg(long, short)]
    output: Option<PathBuf>,

    /// The recording's time column [default: the first]
    #[arg(long)]
    time: Option<String>,
}

/// Writes the outputs.
pub fn simulate(arguments: &Arguments) -> Result<(), CommandError> {
    let model = files::model(&arguments.model)?;
    let recording = files::recording(&arguments.recording, arguments.time.as_deref())?;
    let parameters = match &arguments.parameters {
        Some(path) => {
            let values = files::document(path)?;
            read_parameters(&values, model.description())
                .map_err(|faults| CommandError::faults(path.display(), &faults))?
        }
        None => model.description().defaults(),
    };
    let inputs = inputs(&recording, model.description()).map_err(|error| {
        CommandError::input(format!("{}: {error}", arguments.recording.display()))
    })?;
    let outputs = outputs(&model, &parameters, inputs)?;
    files::write(arguments.output.as_deref(), &files::csv(&outputs))
}

/// The defaults with the named values in their places, or everything that is wrong with them.
fn read_parameters(values: &Value, model: &ModelDescription) -> Result<Vec<f64>, Vec<Fault>> {
    let Some(values) = values.as_object() else {
        return Err(vec![Fault::new(
            "",
            "not_an_object",
            "an object of names and numbers is needed",
        )]);
    };
    let mut parameters = model.defaults();
    let mut faults = Vec::new();
    for (name, value) in values {
        match read_parameter(name, value, model) {
            Ok((index, value)) => parameters[index] = value,
            Err(detail) => {
                let pointer = crate::job::fault::pointer_to("", name);
                faults.push(Fault::new(pointer, "wrong_parameter", detail));
            }
        }
    }
    if faults.is_empty() {
        Ok(parameters)
    } else {
        Err(faults)
    }
}

fn read_parameter(
    name: &str,
    value: &Value,
    model: &ModelDescription,
) -> Result<(usize, f64), String> {
    let index = model
        .parameter_index(name)
        .ok_or_else(|| format!("`{}` has no parameter of this name", model.name))?;
    let value = value
        .as_f64()
        .ok_or_else(|| format!("{value} is not a number"))?;
    let parameter = &model.parameters[index];
    match (parameter.minimum, parameter.maximum) {
        (Some(minimum), _) if value < minimum => Err(format!("{value} is below {minimum}")),
        (_, Some(maximum)) if value > maximum => Err(format!("{value} is above {maximum}")),
        _ => Ok((index, value)),
    }
}

/// The recording as far as it drives the model: by the first set of inputs that it has.
struct Inputs {
    input_set: usize,
    experiment: Experiment,
}

fn inputs(recording: &Recording, model: &ModelDescription) -> Result<Inputs, String> {
    let has = |input: &str| recording.signal(input).is_some();
    let mut sets = model.input_sets.iter();
    let input_set = sets.position(|set| set.iter().all(|input| has(input)));
    let input_set = input_set.ok_or_else(|| {
        let sets: Vec<String> = model.input_sets.iter().map(|set| set.join(" + ")).collect();
        let (name, sets) = (&model.name, sets.join(" or by "));
        format!("`{name}` is driven by {sets}, which the recording does not have")
    })?;
    let names = model.input_sets[input_set].iter();
    let names: Vec<Mapped> = names.map(|name| Mapped::held(name, name)).collect();
    let experiment = recording.experiment(&names, Selection::default());
    let experiment = experiment.map_err(|error| error.to_string())?;
    let has_gaps = |values: &[f64]| values.iter().any(|value| value.is_nan());
    let mut signals = experiment.signals.iter();
    if let Some((name, _)) = signals.find(|(_, values)| has_gaps(values)) {
        let why = "an input must be known at all times";
        return Err(format!("`{name}` has missing samples; {why}"));
    }
    Ok(Inputs {
        input_set,
        experiment,
    })
}

/// All outputs of the model, as a recording.
fn outputs(model: &Model, parameters: &[f64], inputs: Inputs) -> Result<Recording, CommandError> {
    let Experiment {
        sample_time,
        instants,
        samples,
        signals,
        ..
    } = inputs.experiment;
    let values: Vec<Vec<f64>> = signals.into_iter().map(|(_, values)| values).collect();
    let excitation = Excitation {
        sample_time,
        instants: instants.as_deref(),
        samples,
        input_set: inputs.input_set,
        inputs: &values,
        accuracy: Accuracy::Full,
    };
    let description = model.description();
    let candidate = Candidate {
        parameters,
        initial_state: &vec![None; description.states.len()],
    };
    let never = AtomicBool::new(false);
    let simulated = single::outputs(model.plant(), &[(excitation, candidate)], &never)
        .expect("nobody stops this simulation")
        .map_err(|failure| {
            CommandError::failed(format!("the simulation ended early: {}", failure.name()))
        })?;
    let columns = simulated.into_iter().flatten();
    let signals = description.outputs.iter().zip(columns);
    let signals = signals.map(|(signal, values)| Signal::new(&*signal.name, &*signal.unit, values));
    let time = match &instants {
        Some(instants) => TimeAxis::Instants(instants.clone()),
        None => TimeAxis::Uniform {
            sample_time,
            samples,
        },
    };
    Ok(Recording::new(time, signals.collect()))
}
