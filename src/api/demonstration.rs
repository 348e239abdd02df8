//! A recording whose true parameters are known, with its job: what a newcomer tries the service with.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::http::HeaderMap;
use serde::Serialize;
use serde_json::{Value, json};
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::datasets::RecordingDocument;
use super::error::Answer;
use super::http_headers::tagged_json;
use super::query::{FromQuery, Params, QueryReader};
use greybox::demo::{self, Demo};
use greybox::recording::Recording;

/// The seed of the recording.
const SEED: u64 = 1;

/// Which recording.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct DemonstrationQuery {
    /// The recording: `a`, the nominal rig under a rich excitation; `b`, an imperfect rig that is hardly moved,
    /// whose result must not be trusted; `c`, as `a` with both chamber pressures; `d`, the rig of `b` excited
    /// as `a`.
    #[param(inline)]
    pub recording: Option<Demo>,
}

impl FromQuery for DemonstrationQuery {
    fn read(query: &mut QueryReader) -> Self {
        let recording = query.parsed("recording", |word| {
            serde_json::from_value(Value::from(word)).map_err(|error| error.to_string())
        });
        Self { recording }
    }
}

/// A demonstration.
#[derive(Serialize, ToSchema)]
pub struct Demonstration {
    /// The recording, to be stored with `POST /v1/datasets`.
    #[schema(value_type = RecordingDocument)]
    recording: Value,
    /// The job, as `POST /v1/jobs` takes it once its experiment names the stored recording.
    #[schema(value_type = Object)]
    job: Value,
    /// The parameters that the recording was made with, SI.
    #[schema(example = json!({"supply_pressure": 7e6}))]
    true_parameters: BTreeMap<String, f64>,
}

/// Read a recording whose true parameters are known, and the job that looks for them.
///
/// The recording is of the rig of the paper, simulated and measured as a data logger would. Nothing is stored.
#[utoipa::path(
    get, path = "/v1/demonstration", operation_id = "demonstration", tag = "models",
    params(
        DemonstrationQuery,
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` that the client has")
    ),
    responses(
        (status = 200, description = "The demonstration", body = Demonstration,
         headers(("ETag" = String, description = "Changes with the answer"))),
        (status = 304, description = "The client has this already")
    )
)]
pub async fn show(
    State(state): State<ApiState>,
    Params(query): Params<DemonstrationQuery>,
    headers: HeaderMap,
) -> Answer {
    let demo = query.recording.unwrap_or(Demo::A);
    let made = state.work.compute(move |_stop| {
        Ok(Demonstration {
            recording: document(&demo::recording(demo, SEED)),
            job: demo::job(demo),
            true_parameters: demo::true_parameters(demo).into_iter().collect(),
        })
    });
    Ok(tagged_json(&headers, &made.await?))
}

/// Writes a recording of uniform samples as the service's own JSON.
fn document(recording: &Recording) -> Value {
    let signal = |signal: &greybox::recording::Signal| {
        let content = json!({"unit": signal.unit, "values": signal.values});
        (signal.name.clone(), content)
    };
    let signals: serde_json::Map<String, Value> = recording.signals.iter().map(signal).collect();
    json!({
        "name": recording.name,
        "sample_time_s": demo::SAMPLE_TIME,
        "signals": signals,
    })
}
