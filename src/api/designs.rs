//! Designing the next experiment, while the client waits or as a job.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde_json::Value;
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::finished_job::FinishedJob;
use super::http_headers::{json, prefers_job};
use super::jobs::Job;
use super::query::{NoQuery, Params};
use super::work::stopped;
use super::{ApiState, submit};
use crate::job::{DesignTask, JobTask};
use crate::store::{Idempotency, NewJob, NewModel};
use greybox::identification::design::Design;
use greybox::identification::spec::design::{DesignRequest, DesignSpec};
use greybox::identification::spec::{InitialStateSpec, LimitsSpec, ModelOfJob, ParameterSpec};
use greybox::identification::{JobId, assemble};
use greybox::model::Model;

/// What a design is asked for: a model with what is known of its parameters, or a finished job to go
/// on from; what is measured; and what may be played.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "model": "positioning_drive",
    "parameters": {"mass": {"estimate": {}, "prior": {"mean": 95.0, "std": 10.0}},
                   "viscous_friction": {"estimate": {}, "prior": {"mean": 200.0, "std": 50.0}},
                   "coulomb_friction": {"value": 20.0, "tolerance": "10 %"},
                   "offset": {"value": 0.0}},
    "initial_state": {"position": 0.0, "velocity": 0.0},
    "outputs": {"position": {"noise_std": 1e-5}},
    "inputs": {"force": {"lower": -100.0, "upper": 100.0, "rate_per_s": 1e4}},
    "sample_time_s": 0.01,
    "duration_s": 5.0,
    "wanted": ["mass"]
}))]
pub struct DesignDocument {
    /// The model: a name that `/v1/models` lists, or a model document.
    #[schema(value_type = Option<ModelOfJob>, nullable = false)]
    pub model: Option<String>,
    /// A finished job to go on from, in the place of `model` and `parameters`: its data count too.
    #[schema(nullable = false)]
    pub job: Option<JobId>,
    /// What is known of each parameter, as in a job.
    #[schema(required = false)]
    pub parameters: BTreeMap<String, ParameterSpec>,
    /// Where states start in the experiment, as in a job; left out, as the model says.
    #[schema(required = false)]
    pub initial_state: BTreeMap<String, InitialStateSpec>,
    /// The outputs that are measured; left out, those of the job with the noise that it found.
    #[schema(required = false)]
    pub outputs: BTreeMap<String, PlannedOutput>,
    /// Outputs of which one may be measured too: each is compared.
    #[schema(required = false)]
    pub sensors: BTreeMap<String, PlannedOutput>,
    /// Where each input of one set may be.
    #[schema(required = false)]
    pub inputs: BTreeMap<String, InputLimits>,
    /// The time from one sample to the next `[s]`.
    #[schema(exclusive_minimum = 0, nullable = false)]
    pub sample_time_s: Option<f64>,
    /// How long the experiment takes `[s]`.
    #[schema(exclusive_minimum = 0, nullable = false)]
    pub duration_s: Option<f64>,
    /// The families that are searched; left out, all, or none where something is proposed.
    #[schema(required = false, example = json!(["prbs", "multisine", "steps", "sine"]))]
    pub families: Vec<String>,
    /// Excitations that are compared with them: `kind` and its numbers, or samples, and a `name`.
    #[schema(required = false, max_items = 32, value_type = Vec<Object>,
             example = json!([{"kind": "prbs", "clock_s": 0.2, "bits": 7},
                              {"name": "sweep", "kind": "multisine", "lowest_hz": 0.1, "highest_hz": 5.0}]))]
    pub proposals: Vec<Value>,
    /// The instants that may be measured, of a model that nothing drives.
    #[schema(nullable = false)]
    pub instants: Option<PlannedInstants>,
    /// The parameters whose uncertainty shall become small: one, or several together (the
    /// determinant of their covariance); left out, all that are estimated.
    #[schema(required = false, example = json!(["mass"]))]
    pub wanted: Vec<String>,
    /// Points of what is known at present that experiments are looked at.
    #[schema(required = false, minimum = 1, maximum = 16, default = 5)]
    pub points: u64,
    /// Where the points come from.
    #[schema(required = false, maximum = 9007199254740991_i64, default = 1)]
    pub seed: u64,
}

/// An output that is to be measured.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PlannedOutput {
    /// The standard deviation of its measurement noise, SI.
    #[schema(exclusive_minimum = 0, example = 1e-5)]
    pub noise_std: f64,
}

/// Where an input may be.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct InputLimits {
    /// The least value, SI.
    pub lower: f64,
    /// The largest value, SI.
    pub upper: f64,
    /// How fast it may change, SI per second.
    #[schema(exclusive_minimum = 0, nullable = false)]
    pub rate_per_s: Option<f64>,
}

/// Instants to choose from, in seconds from the start of the experiment.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PlannedInstants {
    /// The candidates.
    #[schema(max_items = 500)]
    pub candidates_s: Vec<f64>,
    /// How many measurements.
    #[schema(minimum = 1, maximum = 50)]
    pub count: u64,
    /// Whether an instant may be measured more than once.
    #[schema(required = false, default = true)]
    pub may_repeat: bool,
    /// Instants that are measured in any case.
    #[schema(required = false, max_items = 500)]
    pub measured_s: Vec<f64>,
}

/// Design the next experiment.
///
/// Answers the excitation that most shrinks the total uncertainty of what is wanted, with what is
/// predicted of each unknown before and after, and a ranking. It is looked for while the client
/// waits; where the time for that is up, the answer is the best so far and says so. With `Prefer:
/// respond-async` it is stored as a job instead: worked like any other, with `design` events, and
/// this answer as its result.
#[utoipa::path(
    post, path = "/v1/designs", operation_id = "design", tag = "models",
    params(
        ("Prefer" = Option<String>, Header, example = "respond-async",
         description = "`respond-async`: make it a job; with `wait=N` the answer comes when that \
                        has ended, or after N seconds (at most 60)"),
        ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
         description = "Makes a job of its own safe to submit again: the same key and body give \
                        the same answer. The key counts for 7 days (`--keep-keys-days`) and at the \
                        least until its job has ended")
    ),
    request_body(content = DesignDocument, content_type = "application/json"),
    responses((status = 200, description = "The experiment", body = Design),
              (status = 202, description = "With `respond-async`: the job is stored", body = Job,
               headers(("Location" = String, description = "Where the job is"),
                       ("Retry-After" = u32,
                        description = "When to ask again, on unfinished jobs"),
                       ("Preference-Applied" = String,
                        description = "The wait that was applied"),
                       ("Idempotent-Replayed" = String,
                        description = "`true` when this answers an earlier submission again"))),
              (status = 409, description = "The job has no result, or not yet, or its recording is \
                                            gone; or the job that this key made has been deleted"))
)]
pub async fn design(
    State(state): State<ApiState>,
    _: Params<NoQuery>,
    headers: HeaderMap,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let idempotency = submit::idempotency(&headers, &client, &document)?;
    if prefers_job(&headers) {
        return submit(state, client, &headers, document, idempotency).await;
    }
    let Ready {
        past, spec, model, ..
    } = ready(&state, &client, &document.value).await?;
    let designed = state.work.compute(move |stop| {
        let past = past.as_ref().map(FinishedJob::as_past);
        let design = assemble::design(spec, &model, past, stop);
        let design = design.map_err(Problem::of_document)?.ok_or_else(stopped)?;
        Ok(json(StatusCode::OK, &design))
    });
    designed.await
}

/// A design that has been read.
struct Ready {
    past: Option<FinishedJob>,
    spec: DesignSpec,
    model: Arc<Model>,
    /// The model of the design, where the request brings a new model.
    new: Option<NewModel>,
    /// The document, with the model's name in the place of the model.
    request: DesignRequest,
}

/// Reads a design, or says everything that is wrong with it.
async fn ready(state: &ApiState, client: &Client, document: &Value) -> Answer<Ready> {
    let past = past(state, client, document).await?;
    let mut asked = state.library.asked(document, client).await?;
    let request = DesignRequest::new(std::mem::take(&mut asked.document));
    let mut models = state.library.descriptions(&asked);
    if let Some(past) = &past {
        models.push(past.model().description());
    }
    let before = past.as_ref().map(FinishedJob::as_past_job);
    let spec = request.read(&models, before.as_ref());
    let spec = spec.map_err(Problem::of_document)?;
    let model = match (&past, asked.model) {
        (Some(past), _) => past.shared_model(),
        (None, Some(model)) => model,
        (None, None) => {
            state
                .library
                .model(&client.project, &spec.job.model)
                .await?
        }
    };
    Ok(Ready {
        spec,
        model,
        new: asked.new,
        request,
        past,
    })
}

/// Stores a design as a job.
async fn submit(
    state: ApiState,
    client: Client,
    headers: &HeaderMap,
    document: JsonDocument,
    idempotency: Option<Idempotency>,
) -> Answer {
    if let Some(earlier) = submit::earlier(&state, idempotency.as_ref()).await? {
        return submit::answer(&state, earlier, headers).await;
    }
    let ready = ready(&state, &client, &document.value).await?;
    if let Some(past) = ready
        .past
        .as_ref()
        .filter(|past| !past.row.status.is_terminal())
    {
        let detail = format!(
            "the job {} may go on and change its result; end it first",
            past.row.id
        );
        return Err(Problem::new(Kind::WrongState, detail));
    }
    let before = ready.past.as_ref().map(FinishedJob::as_past_job);
    let longest = LimitsSpec::default().max_duration_s;
    let longest = longest.min(state.limits.max_duration_s);
    let task = DesignTask::new(ready.request, before.as_ref(), longest);
    let task = JobTask::Design(task);
    let job = NewJob {
        project: client.project,
        name: Some(format!(
            "design for {}",
            ready.spec.wanted.join(", ").replace('_', " ")
        )),
        labels: BTreeMap::new(),
        model: ready.spec.job.model.clone(),
        datasets: task.recordings(),
        task,
        idempotency,
    };
    let (past, spec, model) = (ready.past, ready.spec, ready.model);
    let checked = state.work.compute(move |stop| {
        let past = past.as_ref().map(FinishedJob::as_past);
        let checked = assemble::check_design(&spec, &model, past, assemble::COST_OF_JOB, stop);
        let is_whole = checked.map_err(Problem::of_document)?;
        is_whole.then_some(()).ok_or_else(stopped)
    });
    checked.await?;
    if let Some(new) = ready.new {
        state.store.models().insert(new).await?;
    }
    submit::answer(
        &state,
        state.store.submissions().submit(job).await?,
        headers,
    )
    .await
}

/// The finished job that a document names, if it is there for this client.
async fn past(state: &ApiState, client: &Client, document: &Value) -> Answer<Option<FinishedJob>> {
    let Some(id) = DesignRequest::past_job(document) else {
        return Ok(None);
    };
    let row = state.store.jobs().find(id).await?;
    match row.filter(|row| row.project == client.project) {
        Some(_) => Ok(Some(FinishedJob::read(state, id).await?)),
        None => Ok(None),
    }
}
