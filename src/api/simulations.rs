//! Simulating one parameter set, while the client waits.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::Serialize;
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::body::JsonDocument;
use super::client::Client;
use super::datasets::{RecordingDocument, csv};
use super::error::{Answer, Problem};
use super::http_headers::{json, prefers};
use super::query::{FromQuery, Params, QueryReader};
use super::work::stopped;
use greybox::identification::spec::simulation::{SimulationSpec, Source};
use greybox::identification::spec::{
    FixedValue, InitialStateSpec, ModelOfJob, ProcessNoiseSpec, WindowSpec,
};
use greybox::identification::{DatasetId, simulation};
use greybox::intake;
use greybox::recording::{Recording, SampledSignal};

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
    /// What moves the plant beside its inputs. Where it is given, the outputs are what is expected
    /// from all samples before, by an extended Kalman filter, and `log_likelihood` is answered.
    #[schema(nullable = false, max_items = 8)]
    pub process_noise: Option<Vec<ProcessNoiseSpec>>,
    /// The noise of each output that the recording has, where `process_noise` is given.
    #[schema(required = false)]
    pub outputs: BTreeMap<String, SensorNoise>,
}

/// The noise of a sensor.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SensorNoise {
    /// One standard deviation, SI.
    #[schema(exclusive_minimum = 0, example = 1e-5)]
    pub noise_std: f64,
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
    /// Every output of the model by name. Where `process_noise` is given, each as it is expected from
    /// all samples before, and as `OUTPUT_std` the standard deviation of what was expected, the noise
    /// of the sensor among it.
    outputs: BTreeMap<String, SampledSignal>,
    /// The natural logarithm of the likelihood of the measured outputs, where `process_noise` is
    /// given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    log_likelihood: Option<f64>,
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
    let permit = state.work.recording_permit().await?;
    let recording = recording(&state, &client, &document.value).await?;
    let asked = state.library.asked(&document.value, &client).await?;
    let models = state.library.descriptions(&asked);
    let summary = recording.as_deref().map(Recording::summary);
    let spec = SimulationSpec::read(&asked.document, &models, summary.as_ref());
    let spec = spec.map_err(Problem::of_document)?;
    let recording = recording.expect("a specification that exists has a source");
    let model = match asked.model {
        Some(model) => model,
        None => state.library.model(&client.project, &spec.model).await?,
    };

    let name = spec.model.clone();
    let simulated = state.work.compute(move |stop| {
        let outputs = simulation::simulate(&spec, &model, &recording, stop);
        let outputs = outputs.ok_or_else(stopped)?;
        Ok((outputs.map_err(Problem::of_document)?, permit))
    });
    let (simulated, permit) = simulated.await?;
    let (outputs, log_likelihood) = (simulated.recording, simulated.log_likelihood);
    if prefers(&headers, "text/csv") {
        return csv::answer(&state.bodies, outputs, permit).await;
    }
    let points = query.max_points.unwrap_or(MAX_POINTS);
    let points = usize::try_from(points).expect("the limit is small");
    let written = state.work.convert_bytes(outputs.bytes(), move || {
        let _permit = permit;
        let simulated = outputs.time.samples();
        let samples = outputs.decimate(None, None, None, points);
        let simulation = Simulation {
            model: name,
            samples: simulated as u64,
            decimated: samples.time_s.len() < simulated,
            time_s: samples.time_s,
            outputs: samples.signals.into_iter().collect(),
            log_likelihood,
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
) -> Answer<Option<Arc<Recording>>> {
    match SimulationSpec::source(document) {
        Source::Dataset(id) => {
            let row = state.store.datasets().find(id).await?;
            match row.filter(|row| row.project == client.project) {
                Some(_) => Ok(state.store.datasets().recording(id).await?),
                None => Ok(None),
            }
        }
        Source::Inline(inputs) => {
            let inputs = inputs.clone();
            let read = state.work.convert(move || inline(&inputs));
            Ok(Some(Arc::new(read.await?)))
        }
        Source::Unclear => Ok(None),
    }
}

fn inline(inputs: &Value) -> Answer<Recording> {
    let text = inputs.to_string();
    let recording = intake::json::read(text.as_bytes(), intake::ReadingPurpose::Recording);
    recording.map_err(|error| {
        let faults = error.faults().iter().cloned();
        Problem::of_document(faults.map(|fault| fault.below("/inputs")).collect())
    })
}
