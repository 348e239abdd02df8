//! `greybox simulate`: the outputs of a model with given parameters under recorded inputs.

use super::error::CommandError;
use super::files;
use crate::dataset::{Recording, Signal, TimeAxis};
use crate::estimation::problem::{Experiment, Problem};
use crate::estimation::trajectory;
use crate::job::Fault;
use crate::model::{Catalogue, Model, ModelDescription};
use clap::Args;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What `simulate` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording with the model's inputs under the model's names, CSV or JSON
    recording: PathBuf,

    /// Values of parameters, a JSON object {"mass": 58, …}; what is not named has its default
    parameters: Option<PathBuf>,

    /// The model
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
    let model = model_of_name(&arguments.model)?;
    let recording = files::recording(&arguments.recording, arguments.time.as_deref())?;
    let parameters = match &arguments.parameters {
        Some(path) => {
            let values = files::document(path)?;
            read_parameters(&values, model.description())
                .map_err(|faults| CommandError::faults(path.display(), &faults))?
        }
        None => model.description().defaults(),
    };
    let experiment = experiment(&recording, model.description()).map_err(|error| {
        CommandError::input(format!("{}: {error}", arguments.recording.display()))
    })?;
    let outputs = outputs(model, parameters, experiment)?;
    files::write(arguments.output.as_deref(), &files::csv(&outputs))
}

fn model_of_name(name: &str) -> Result<Arc<Model>, CommandError> {
    let models = Catalogue::built_in();
    let known: Vec<&str> = models
        .iter()
        .map(|model| model.description().name)
        .collect();
    models.get(name).cloned().ok_or_else(|| {
        CommandError::input(format!(
            "--model {name}: the models are {}",
            known.join(", ")
        ))
    })
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

/// The recording as an experiment without measured outputs, driven by the first set of inputs
/// that it has.
fn experiment(recording: &Recording, model: &ModelDescription) -> Result<Experiment, String> {
    let has = |input: &&str| recording.signal(input).is_some();
    let input_set = model
        .input_sets
        .iter()
        .position(|set| set.iter().all(|input| has(&input)));
    let input_set = input_set.ok_or_else(|| {
        let sets: Vec<String> = model.input_sets.iter().map(|set| set.join(" + ")).collect();
        format!(
            "`{}` is driven by {}, which the recording does not have",
            model.name,
            sets.join(" or by ")
        )
    })?;
    let inputs = model.input_sets[input_set].iter();
    let names: Vec<(String, String)> = inputs
        .map(|name| ((*name).to_owned(), (*name).to_owned()))
        .collect();
    let cut = recording
        .experiment(&names, None)
        .map_err(|error| error.to_string())?;
    if let Some((name, _)) = cut
        .signals
        .iter()
        .find(|(_, values)| values.iter().any(|v| v.is_nan()))
    {
        return Err(format!(
            "`{name}` has missing samples, and an input must be known at all times"
        ));
    }
    Ok(Experiment {
        sample_time: cut.sample_time,
        samples: cut.samples,
        estimation_samples: cut.samples,
        input_set,
        inputs: cut.signals.into_iter().map(|(_, values)| values).collect(),
        measured: Vec::new(),
        initial_state: vec![None; model.states.len()],
    })
}

/// All outputs of the model, as a recording.
fn outputs(
    model: Arc<Model>,
    parameters: Vec<f64>,
    experiment: Experiment,
) -> Result<Recording, CommandError> {
    let time = TimeAxis::Uniform {
        sample_time: experiment.sample_time,
        samples: experiment.samples,
    };
    let problem = Problem {
        model,
        parameters,
        coordinates: Vec::new(),
        outputs: Vec::new(),
        experiments: vec![experiment],
    };
    let never = AtomicBool::new(false);
    let simulated = trajectory::simulate(&problem, &[], &never)
        .expect("nobody stops this simulation")
        .map_err(|failure| CommandError::failed(format!("the simulation failed: {failure:?}")))?;
    let columns = simulated
        .into_iter()
        .flat_map(|trajectory| trajectory.outputs);
    let signals = problem.model.description().outputs.iter().zip(columns);
    let signals = signals.map(|(signal, values)| Signal::new(signal.name, signal.unit, values));
    Ok(Recording::new(time, signals.collect()))
}
