//! Simulating one parameter set, while the client waits.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::Serialize;
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::body::JsonDocument;
use super::datasets::{RecordingDocument, csv_answer};
use super::error::{Answer, Problem};
use super::extract::Client;
use super::http_headers::{json, prefers};
use super::query::{FromQuery, Params, QueryReader};
use super::work::stopped;
use super::{ApiState, models};
use crate::intake;
use crate::job::fault::Fault;
use crate::job::spec::simulation::{SimulationSpec, Source};
use crate::job::spec::{InitialStateSpec, ModelOfJob, WindowSpec};
use crate::job::{DatasetId, spec::FixedValue};
use crate::model::{InitialState, Model};
use crate::recording::{Mapped, Recording, SampledSignal, Selection, Signal, TimeAxis, Window};
use crate::simulation::{Accuracy, Candidate, Excitation, single};

/// Points of the answer at the most.
const MAX_POINTS: u64 = 100_000;

/// How finely.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct SimulationQuery {
    /// Points of the answer at the most; the extremes of each stretch are kept.
    #[param(minimum = 2, maximum = 100_000, default = 100_000)]
    pub max_points: Option<u64>,
}

impl FromQuery for SimulationQuery {
    fn read(query: &mut QueryReader) -> Self {
        Self {
            max_points: query.integer("max_points", 2, MAX_POINTS),
        }
    }
}

/// A simulation, as submitted: driven by a stored recording or by inline inputs.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "model": "positioning_drive",
    "inputs": {"sample_time_s": 0.01,
               "signals": {"force": {"unit": "N", "values": [50.0, 50.0, -50.0, -50.0]}}},
    "parameters": {"mass": {"value": 95.0}},
    "initial_state": {"velocity": 0.0}
}))]
pub struct SimulationDocument {
    /// The model: a name that `/v1/models` lists, or a model document.
    #[schema(value_type = ModelOfJob)]
    pub model: String,
    /// A stored recording that has the inputs.
    #[schema(nullable = false)]
    pub dataset: Option<DatasetId>,
    /// The inputs themselves.
    #[schema(nullable = false)]
    pub inputs: Option<RecordingDocument>,
    /// From the model's signals to the recording's; left out, equal names are taken.
    #[schema(required = false)]
    pub signals: BTreeMap<String, String>,
    /// The part of the recording to use; left out, all of it.
    #[schema(nullable = false)]
    pub window: Option<WindowSpec>,
    /// Values by the model's names; left out, the model's defaults.
    #[schema(required = false)]
    pub parameters: BTreeMap<String, FixedValue>,
    /// Where states start; left out, as the model says.
    #[schema(required = false)]
    pub initial_state: BTreeMap<String, InitialStateSpec>,
}

/// Simulated outputs.
#[derive(Serialize, ToSchema)]
pub struct Simulation {
    /// The model.
    model: String,
    /// The samples that were simulated.
    samples: u64,
    /// Whether only some of them are here, the extremes of each stretch among them: there are more
    /// than `max_points`. As `text/csv` all of them are answered.
    decimated: bool,
    /// The instants, from the recording's first sample `[s]`.
    time_s: Vec<f64>,
    /// Every output of the model by name.
    outputs: BTreeMap<String, SampledSignal>,
}

/// Simulate one parameter set and answer the outputs: as JSON, or every sample as CSV.
#[utoipa::path(
    post, path = "/v1/simulations", operation_id = "simulate", tag = "models",
    params(SimulationQuery),
    request_body(content = SimulationDocument, content_type = "application/json"),
    responses((status = 200, description = "The outputs in SI",
               content((Simulation = "application/json"), (String = "text/csv"))))
)]
pub async fn simulate(
    State(state): State<ApiState>,
    Params(query): Params<SimulationQuery>,
    headers: HeaderMap,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let permit = state.recording_permit().await?;
    let recording = recording(&state, &client, &document.value).await?;
    let asked = models::asked(&state, &document.value, &client).await?;
    let models = asked.descriptions(&state);
    let summary = recording.as_ref().map(Recording::summary);
    let spec = SimulationSpec::read(&asked.document, &models, summary.as_ref());
    let spec = spec.map_err(Problem::of_document)?;
    let recording = recording.expect("a specification that exists has a source");
    let model = match asked.model {
        Some(model) => model,
        None => state.model(&client.project, &spec.model).await?,
    };

    let name = spec.model.clone();
    let simulated = state.compute(move |stop| {
        let run = SimulationRun::new(&spec, &model, &recording)?;
        Ok((run.outputs(stop)?, permit))
    });
    let (outputs, permit) = simulated.await?;
    if prefers(&headers, "text/csv") {
        return csv_answer(&state, outputs, permit).await;
    }
    let points = query.max_points.unwrap_or(MAX_POINTS);
    let points = usize::try_from(points).expect("the limit is small");
    let written = state.convert(move || {
        let _permit = permit;
        let simulated = outputs.time.samples();
        let samples = outputs.decimate(None, None, None, points);
        let simulation = Simulation {
            model: name,
            samples: simulated as u64,
            decimated: samples.time_s.len() < simulated,
            time_s: samples.time_s,
            outputs: samples.signals.into_iter().collect(),
        };
        Ok(json(StatusCode::OK, &simulation))
    });
    written.await
}

/// The recording that drives the simulation, if the document names one.
async fn recording(
    state: &ApiState,
    client: &Client,
    document: &Value,
) -> Answer<Option<Recording>> {
    match SimulationSpec::source(document) {
        Source::Dataset(id) => {
            let row = state.store.dataset(id).await?;
            match row.filter(|row| row.project == client.project) {
                Some(_) => Ok(state.store.recording(id).await?),
                None => Ok(None),
            }
        }
        Source::Inline(inputs) => {
            let inputs = inputs.clone();
            let read = state.convert(move || inline(&inputs));
            Ok(Some(read.await?))
        }
        Source::Unclear => Ok(None),
    }
}

fn inline(inputs: &Value) -> Answer<Recording> {
    let text = inputs.to_string();
    let recording = intake::json::read(text.as_bytes());
    recording.map_err(|error| {
        let faults = error.faults().iter().map(|fault| {
            let pointer = fault.pointer.as_deref().unwrap_or_default();
            Fault::new(
                format!("/inputs{pointer}"),
                fault.code,
                fault.detail.clone(),
            )
        });
        Problem::of_document(faults.collect())
    })
}

/// All that one simulation needs.
struct SimulationRun<'m> {
    model: &'m Model,
    sample_time: f64,
    /// When the samples were taken, where they are not uniform, from the recording's first `[s]`.
    instants: Option<Vec<f64>>,
    samples: usize,
    /// When the first sample was taken `[s]`.
    from: f64,
    input_set: usize,
    inputs: Vec<Vec<f64>>,
    parameters: Vec<f64>,
    initial_state: Vec<Option<f64>>,
}

impl<'m> SimulationRun<'m> {
    fn new(spec: &SimulationSpec, model: &'m Model, recording: &Recording) -> Answer<Self> {
        let description = model.description();
        let window = spec.window.map(|window| Window {
            from_s: window.from_s,
            to_s: window.to_s,
        });
        let mapped = spec.signals.iter();
        let mapped = mapped.map(|(model, recorded)| Mapped::held(model, recorded));
        let mapped: Vec<Mapped> = mapped.collect();
        let selection = Selection {
            window,
            ..Selection::default()
        };
        let data = recording.experiment(&mapped, selection);
        let data = data.map_err(|error| {
            let fault = Fault::new("", "experiment_not_possible", error.to_string());
            Problem::of_document(vec![fault])
        })?;
        let mapped = |set: &Vec<Cow<'static, str>>| {
            set.iter().all(|name| spec.signals.contains_key(&**name))
        };
        let input_set = description.input_sets.iter().position(mapped);
        let input_set = input_set.expect("a specification that exists maps one set of inputs");
        let mut inputs = Vec::new();
        for name in &description.input_sets[input_set] {
            let values = data.signal(name).unwrap_or_default().to_vec();
            refuse_missing(name, &values)?;
            inputs.push(values);
        }
        let first = |name: &str| {
            let values = data.signal(name).unwrap_or_default().iter();
            values.copied().find(|value| !value.is_nan())
        };
        let initial_state =
            description
                .states
                .iter()
                .map(|state| match spec.initial_state.get(&*state.name) {
                    Some(InitialStateSpec::Fixed(FixedValue { value, .. })) => Some(*value),
                    Some(InitialStateSpec::Number(value)) => Some(*value),
                    Some(InitialStateSpec::Measured(_)) => first(&state.name),
                    Some(InitialStateSpec::Free(_)) => None,
                    None => match state.initial {
                        InitialState::FirstSample { output } => {
                            first(&description.outputs[output].name)
                        }
                        _ => None,
                    },
                });
        Ok(Self {
            model,
            sample_time: data.sample_time,
            instants: data.instants.clone(),
            samples: data.samples,
            from: spec.window.and_then(|window| window.from_s).unwrap_or(0.0),
            input_set,
            inputs,
            parameters: spec.parameters.clone(),
            initial_state: initial_state.collect(),
        })
    }

    /// The outputs as a recording.
    fn outputs(&self, stop: &AtomicBool) -> Answer<Recording> {
        let excitation = Excitation {
            sample_time: self.sample_time,
            instants: self.instants.as_deref(),
            samples: self.samples,
            input_set: self.input_set,
            inputs: &self.inputs,
            accuracy: Accuracy::Full,
        };
        let candidate = Candidate {
            parameters: &self.parameters,
            initial_state: &self.initial_state,
        };
        let simulated = single::outputs(self.model.plant(), &[(excitation, candidate)], stop);
        let outputs = simulated.ok_or_else(stopped)?.map_err(|failure| {
            let detail = format!("the simulation fails: {}", failure.name());
            Problem::of_document(vec![Fault::new("/parameters", "simulation_fails", detail)])
        })?;
        let described = self.model.description().outputs.iter();
        let signals = described
            .zip(outputs.into_iter().flatten())
            .map(|(output, values)| Signal::new(&*output.name, &*output.unit, values));
        let instants = (0..self.samples).map(|k| match &self.instants {
            Some(instants) => instants[k],
            None => self.from + k as f64 * self.sample_time,
        });
        Ok(Recording::new(
            TimeAxis::Instants(instants.collect()),
            signals.collect(),
        ))
    }
}

/// An input must be known at every instant.
fn refuse_missing(name: &str, values: &[f64]) -> Answer<()> {
    let missing = values.iter().filter(|value| value.is_nan()).count();
    if missing == 0 {
        return Ok(());
    }
    let detail = format!("{missing} samples of the input `{name}` are missing");
    let fault = Fault::new("/signals", "input_missing", detail);
    Err(Problem::of_document(vec![fault]))
}
