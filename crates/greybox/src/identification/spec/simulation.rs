//! What a simulation is asked to do: a model, what drives it, and a value for each of its numbers.

use std::collections::BTreeMap;

use serde_json::Value;

use super::experiment::SignalMatch;
use super::initial_state::read_initial_state;
use super::{InitialStateSpec, WindowSpec, parameter, process_noise, read_model, window};
use crate::estimation::process_noise::ProcessNoise;
use crate::identification::DatasetId;
use greybox_numerics::parsing::fault::Fault;
use greybox_numerics::parsing::reader::{Field, read_document};
use greybox_recording::Summary;
use greybox_simulation::model::ModelDescription;

/// A simulation that can run.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationSpec {
    /// The model.
    pub model: String,
    /// From the model's signals to the recording's.
    pub signals: BTreeMap<String, String>,
    /// The part of the recording to use.
    pub window: Option<WindowSpec>,
    /// A value for each parameter, in the order of the model, SI.
    pub parameters: Vec<f64>,
    /// Where states start that do not start where the model says.
    pub initial_state: BTreeMap<String, InitialStateSpec>,
    /// What moves the plant beside its inputs; none: the simulation runs freely.
    pub process_noise: Option<KnownNoise>,
}

/// Disturbances and sensors whose numbers are given.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownNoise {
    /// The disturbances.
    pub disturbances: Vec<ProcessNoise>,
    /// For each measured output the standard deviation of its sensor's noise, SI.
    pub sensors: Vec<(String, f64)>,
}

/// What drives a simulation.
#[derive(Clone, Debug, PartialEq)]
pub enum Source<'v> {
    /// A stored recording.
    Dataset(DatasetId),
    /// A recording in the document itself.
    Inline(&'v Value),
    /// Neither, or not to be understood: [`SimulationSpec::read`] says why.
    Unclear,
}

impl SimulationSpec {
    /// What a document names as its source, whether or not the rest of it makes sense.
    pub fn source(document: &Value) -> Source<'_> {
        let dataset = document.get("dataset").and_then(Value::as_str);
        match (dataset, document.get("inputs")) {
            (Some(dataset), None) => dataset.parse().map_or(Source::Unclear, Source::Dataset),
            (None, Some(inputs @ Value::Object(_))) => Source::Inline(inputs),
            _ => Source::Unclear,
        }
    }

    /// Reads a document against the recording that its source names, or says everything that is
    /// wrong with it.
    pub fn read(
        document: &Value,
        models: &[&ModelDescription],
        recording: Option<&Summary>,
    ) -> Result<SimulationSpec, Vec<Fault>> {
        read_document(document, |field| read(field, models, recording))
    }
}

fn read(
    document: &Field<'_>,
    models: &[&ModelDescription],
    recording: Option<&Summary>,
) -> Option<SimulationSpec> {
    let mut root = document.object()?;
    let model = root
        .required("model")
        .and_then(|field| read_model(&field, models));
    let dataset = root.optional("dataset");
    let inputs = root.optional("inputs");
    match (&dataset, &inputs) {
        (Some(_), Some(_)) => root.fault(
            "dataset_and_inputs",
            "`dataset` and `inputs` exclude each other",
        ),
        (None, None) => root.fault(
            "missing_field",
            "either `dataset` or `inputs` is needed to drive the model",
        ),
        (Some(dataset), None) => check_dataset(dataset, recording.is_some()),
        (None, Some(inputs)) => {
            inputs.object();
        }
    }
    let signals = root.optional("signals");
    let signals = match (model, recording) {
        (Some(model), Some(recording)) => {
            SignalMatch { model, recording }.read(&root, signals.as_ref(), false)
        }
        _ => None,
    };
    let window = root.optional("window");
    let window = window.map(|field| window::read(&field, recording));
    let parameters = root.optional("parameters");
    let parameters = model.map(|model| parameter::read_values(parameters.as_ref(), model));
    let initial_state = root.optional("initial_state");
    let initial_state = match (&initial_state, model) {
        (Some(field), Some(model)) => {
            let states = read_initial_state(field, model, signals.as_ref());
            refuse_free(field, &states);
            states
        }
        _ => BTreeMap::new(),
    };
    let process_noise = root.optional("process_noise");
    let outputs = root.optional("outputs");
    let process_noise = process_noise
        .zip(model)
        .map(|(field, model)| read_noise(&field, outputs.as_ref(), model, signals.as_ref()));
    if let (None, Some(outputs)) = (&process_noise, &outputs) {
        let detail = "`outputs` say what a filter believes: `process_noise` is needed beside it";
        outputs.fault("process_noise_needed", detail);
    }
    root.finish();
    Some(SimulationSpec {
        model: model?.name.to_string(),
        signals: signals?,
        window: window.flatten(),
        parameters: parameters?,
        initial_state,
        process_noise,
    })
}

/// The disturbances, and the sensor of every output that is measured.
fn read_noise(
    field: &Field<'_>,
    outputs: Option<&Field<'_>>,
    model: &ModelDescription,
    signals: Option<&BTreeMap<String, String>>,
) -> KnownNoise {
    let is_measured = |name: &str| signals.is_none_or(|signals| signals.contains_key(name));
    let disturbances = process_noise::read_known(field, model);
    let sensors = outputs.map(|outputs| read_sensors(outputs, is_measured));
    let sensors = sensors.unwrap_or_default();
    let is_missing = |name: &str| {
        let is_used = signals.is_some_and(|signals| signals.contains_key(name));
        is_used && !sensors.iter().any(|(sensor, _)| sensor == name)
    };
    for output in model
        .outputs
        .iter()
        .filter(|output| is_missing(&output.name))
    {
        let detail = format!(
            "the noise of `{name}` is needed: `outputs: {{\"{name}\": {{\"noise_std\": …}}}}`",
            name = output.name
        );
        field.fault("noise_needed", detail);
    }
    KnownNoise {
        disturbances,
        sensors,
    }
}

fn check_dataset(field: &Field<'_>, is_stored: bool) {
    let Some(text) = field.text() else {
        return;
    };
    match text.parse::<DatasetId>() {
        Ok(id) if !is_stored => field.fault("unknown_dataset", format!("there is no dataset {id}")),
        Ok(_) => {}
        Err(error) => field.fault("unknown_dataset", error.to_string()),
    }
}

/// Nothing is estimated in a simulation.
fn refuse_free(field: &Field<'_>, states: &BTreeMap<String, InitialStateSpec>) {
    let free = |state: &InitialStateSpec| matches!(state, InitialStateSpec::Free(_));
    for (name, _) in states.iter().filter(|(_, state)| free(state)) {
        let detail = format!("a simulation estimates nothing: `{name}` needs a value");
        field.fault("estimate_in_simulation", detail);
    }
}

/// The standard deviation of the noise of each output that is named; every name must be one that the
/// recording has.
fn read_sensors(field: &Field<'_>, is_measured: impl Fn(&str) -> bool) -> Vec<(String, f64)> {
    let mut sensors = Vec::new();
    let entries = field.object().map(|object| object.entries());
    for (name, field) in entries.into_iter().flatten() {
        if !is_measured(name) {
            let detail = format!("no signal of the recording is the output `{name}`");
            field.fault("output_not_measured", detail);
        }
        let Some(mut object) = field.object() else {
            continue;
        };
        let noise = object.required("noise_std");
        let noise = noise.and_then(|field| field.positive());
        object.finish();
        sensors.extend(noise.map(|noise| (name.to_owned(), noise)));
    }
    sensors
}
