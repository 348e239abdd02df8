//! `greybox simulate`: the outputs of a model with given parameters under recorded inputs.

use super::error::CommandError;
use super::files;
use super::reading::Reading;
use clap::Args;
use greybox::identification::simulation;
use greybox::identification::spec::simulation::SimulationSpec;
use greybox::parsing::Fault;
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

/// Where the parameters stand in a document that asks for a simulation.
const PARAMETERS: &str = "/parameters";

/// What `simulate` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording with the model's inputs under the model's names, in any format that the service reads
    recording: PathBuf,

    /// Values of parameters, a JSON object {"mass": 58, …}; what is not named has its default
    parameters: Option<PathBuf>,

    /// The model: a name of the catalogue, or the file of a model document, JSON or YAML
    #[arg(long, default_value = "single_rod_servo")]
    model: String,

    /// The file to write, CSV [default: standard output]
    #[arg(long, short)]
    output: Option<PathBuf>,

    #[command(flatten)]
    reading: Reading,
}

/// Writes the outputs.
pub fn simulate(arguments: &Arguments) -> Result<(), CommandError> {
    let model = files::model(&arguments.model)?;
    let recording = files::recording(&arguments.recording, &arguments.reading)?;
    let parameters = arguments.parameters.as_deref();
    let values = parameters.map_or(Ok(json!({})), files::document)?;
    let document = json!({
        "model": model.description().name,
        "inputs": {},
        "parameters": values,
    });
    let told = |faults: Vec<Fault>| {
        let sentences = faults.iter().map(|fault| {
            let parameter = fault.pointer().strip_prefix(PARAMETERS);
            let (file, pointer) = match (parameters, parameter) {
                (Some(file), Some(parameter)) => (file, parameter),
                _ => (arguments.recording.as_path(), fault.pointer()),
            };
            let fault_of_file = Fault {
                pointer: Some(pointer.into()),
                ..fault.clone()
            };
            format!("{}: {fault_of_file}", file.display())
        });
        CommandError::inputs(sentences)
    };
    let summary = recording.summary();
    let spec = SimulationSpec::read(&document, &[model.description()], Some(&summary));
    let never = AtomicBool::new(false);
    let outputs = simulation::simulate(&spec.map_err(told)?, &model, &recording, &never);
    let outputs = outputs
        .expect("nobody stops this simulation")
        .map_err(told)?;
    files::write(arguments.output.as_deref(), &files::csv(&outputs.recording))
}
