//! Selecting the windows of a stream that fix the parameters of a finished job, as a job; and estimating from them.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::http::HeaderMap;
use jiff::Timestamp;
use serde_json::{Value, json};
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::finished_job::{FinishedJob, result_of, unreadable};
use super::http_headers::idempotency_key;
use super::jobs::{Job, no_job};
use super::query::{NoQuery, Params};
use super::streams::cut::cut_out;
use super::{ApiState, submit};
use crate::job::{JobTask, SelectionTask};
use crate::store::{Idempotency, JobRow, NewJob, StreamRow};
use greybox::identification::assemble::SelectedSpan;
use greybox::identification::selection::Selection;
use greybox::identification::spec::selection::{MAX_WINDOWS, SelectionRequest, SelectionSpec};
use greybox::identification::spec::{ExperimentRole, InitialStateSpec, LimitsSpec};
use greybox::identification::{JobId, JobSpec};
use greybox::model::ToleranceText;
use greybox::parsing::Fault;
use greybox::parsing::reader::listed;

/// What a selection is asked for: a finished job whose parameters are to be fixed, a stream, and how closely or with
/// how many samples.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(example = json!({
    "job": "job_0192d3a4b5c67d8e9f00112233445566", "stream": "press_7",
    "from": "2026-01-01T00:00:00Z", "to": "2026-07-01T00:00:00Z",
    "window_s": 3600, "target": {"gain": "2 %"}
}))]
pub struct SelectionDocument {
    /// The finished job: its model, ranges, tolerances and noise, and its estimate.
    pub job: JobId,
    /// The stream, whose signals have the names that the job's recording had.
    pub stream: String,
    /// Where the first window begins; left out, where the stream begins.
    #[schema(value_type = Option<String>, format = DateTime, nullable = false)]
    pub from: Option<Timestamp>,
    /// Where the last window ends; left out, where the stream ends.
    #[schema(value_type = Option<String>, format = DateTime, nullable = false)]
    pub to: Option<Timestamp>,
    /// How long a window is `[s]`.
    #[schema(exclusive_minimum = 0)]
    pub window_s: f64,
    /// By the model's name, where each state starts in every window, as in a job; left out, as the job says. A plant at
    /// work begins a window wherever the plant is.
    #[schema(required = false)]
    pub initial_state: BTreeMap<String, InitialStateSpec>,
    /// The parameters that matter; left out, those of `target`, or all.
    #[schema(required = false, example = json!(["gain"]))]
    pub wanted: Vec<String>,
    /// The total standard error that is asked for of each parameter: SI, or a share of the estimate.
    #[schema(required = false, value_type = BTreeMap<String, ToleranceText>, example = json!({"gain": "2 %"}))]
    pub target: BTreeMap<String, String>,
    /// Samples of all chosen windows together at the most; needed where there is no `target`.
    #[schema(minimum = 1, nullable = false)]
    pub budget_samples: Option<u64>,
    /// Chosen windows at the most.
    #[schema(required = false, minimum = 1, maximum = 32, default = 32)]
    pub max_windows: u64,
    /// Spans of time whose windows are left out.
    #[schema(required = false, max_items = 256)]
    pub exclude: Vec<ExcludedTime>,
    /// Where the windows come from that are drawn to be compared with.
    #[schema(required = false, maximum = 9007199254740991_i64, default = 1)]
    pub seed: u64,
}

/// A span of time whose windows are left out.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ExcludedTime {
    /// Where the span begins.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
    /// Where the span ends.
    #[schema(value_type = String, format = DateTime)]
    pub to: Timestamp,
}

/// Select the windows of a stream that fix the parameters of a finished job.
///
/// The job looks at every window, with the model at the finished job's estimate, and chooses those that together fix
/// what is wanted: its result says which, what is known with them, with as many that are drawn, and with all. Windows
/// are judged by what drives the plant in them, not by how the outputs look.
#[utoipa::path(
    post, path = "/v1/selections", operation_id = "select_windows", tag = "streams",
    params(
        ("Prefer" = Option<String>, Header, example = "wait=30",
         description = "`wait=N`: answer when the job has ended or was paused, or after N seconds (at most 60)"),
        ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
         description = "Makes the submission safe to repeat: the same key and body give the same answer again")
    ),
    request_body(content = SelectionDocument, content_type = "application/json"),
    responses(
        (status = 202, description = "The job is stored", body = Job,
         headers(("Location" = String, description = "Where the job is"),
                 ("Retry-After" = u32, description = "When to ask again, on unfinished jobs"),
                 ("Preference-Applied" = String, description = "The wait that was applied"),
                 ("Idempotent-Replayed" = String,
                  description = "`true` when this answers an earlier submission again"))),
        (status = 409, description = "The job has no result, or not yet; or the job that this key made has been deleted")
    )
)]
pub async fn select(
    State(state): State<ApiState>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let idempotency = submit::idempotency(&headers, &client, &document)?;
    if let Some(earlier) = submit::earlier(&state, idempotency.as_ref()).await? {
        return submit::answer(&state, earlier, &headers).await;
    }
    let request = SelectionRequest::new(document.value);
    let past = match request.job() {
        Some(id) => finished(&state, &client, id).await?,
        None => None,
    };
    let before = past.as_ref().map(FinishedJob::as_past_job);
    let model = past.as_ref().map(|past| past.model().description());
    let spec = request
        .read(model, before.as_ref())
        .map_err(Problem::of_document)?;
    let past = past.as_ref().ok_or_else(|| no_job(spec.job))?;
    let stream = state
        .store
        .streams()
        .find(&client.project, &spec.stream)
        .await?;
    let stream = stream.ok_or_else(|| unknown_stream(&spec.stream))?;
    let span = span(&spec, &stream).map_err(|fault| Problem::of_document(vec![fault]))?;
    let longest = LimitsSpec::default()
        .max_duration_s
        .min(state.limits.max_duration_s);
    let task = JobTask::Selection(SelectionTask::new(
        request,
        &past.as_past_job(),
        span,
        longest,
    ));
    let job = NewJob {
        project: client.project,
        name: Some(format!(
            "windows of {} for {}",
            spec.stream,
            spec.wanted.join(", ").replace('_', " ")
        )),
        labels: BTreeMap::new(),
        model: past.spec.model.clone(),
        datasets: task.recordings(),
        task,
        idempotency,
    };
    check_signals(&past.spec, &stream).map_err(|fault| Problem::of_document(vec![fault]))?;
    let submitted = state.store.submissions().submit(job).await?;
    submit::answer(&state, submitted, &headers).await
}

/// Estimate from the windows that a selection chose.
///
/// Cuts each window out of the stream as a recording, and submits the job that the selection began from with these as
/// its experiments.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/estimation", operation_id = "estimate_from_selection", tag = "jobs",
    params(
        ("id" = JobId, Path, description = "The selection"),
        ("Prefer" = Option<String>, Header, example = "wait=30",
         description = "`wait=N`: answer when the job has ended or was paused, or after N seconds (at most 60)"),
        ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
         description = "Makes the submission safe to repeat: the same key gives the same answer again")
    ),
    responses(
        (status = 202, description = "The estimation is stored", body = Job,
         headers(("Location" = String, description = "Where the job is"),
                 ("Retry-After" = u32, description = "When to ask again, on unfinished jobs"),
                 ("Preference-Applied" = String, description = "The wait that was applied"),
                 ("Idempotent-Replayed" = String,
                  description = "`true` when this answers an earlier submission again"))),
        (status = 409, description = "The job is no selection, chose no window or has no result yet, or what it began \
                                      from is gone; or the job that this key made has been deleted")
    )
)]
pub async fn estimate(
    State(state): State<ApiState>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
    headers: HeaderMap,
    client: Client,
) -> Answer {
    let key = idempotency_key(&headers)?;
    let idempotency = key.map(|key| Idempotency {
        project: client.project.clone(),
        key,
        body_digest: format!("estimation {id}"),
    });
    if let Some(earlier) = submit::earlier(&state, idempotency.as_ref()).await? {
        return submit::answer(&state, earlier, &headers).await;
    }
    let selection = selection(&state, id).await?;
    let before = finished(&state, &client, selection.job).await?;
    let gone = |what: String| Problem::new(Kind::WrongState, format!("{what} is gone"));
    let before = before.ok_or_else(|| gone(format!("the job {}", selection.job)))?;
    let stream = state
        .store
        .streams()
        .find(&client.project, &selection.stream)
        .await?;
    let stream = stream.ok_or_else(|| gone(format!("the stream `{}`", selection.stream)))?;
    let mut datasets = Vec::with_capacity(selection.chosen.len());
    for window in &selection.chosen {
        let name = format!("{}, {}", selection.stream, window.from);
        let new = cut_out(&state, &stream, Some(name), (window.from, window.to)).await?;
        datasets.push(state.store.datasets().insert(new).await?.0.id);
    }
    let document = estimation(id, &selection, &before.spec, &json!(datasets));
    submit::submit_document(&state, &document, &client, idempotency, &headers).await
}

/// The finished job with an identifier, if it is there for this client.
async fn finished(state: &ApiState, client: &Client, id: JobId) -> Answer<Option<FinishedJob>> {
    let row = state.store.jobs().find(id).await?;
    match row.filter(|row| row.project == client.project) {
        Some(row) => {
            let finished = FinishedJob::read(state, id).await?;
            ended(&row)?;
            Ok(Some(finished))
        }
        None => Ok(None),
    }
}

/// Faults a stream that lacks a signal which a job takes.
fn check_signals(spec: &JobSpec, stream: &StreamRow) -> Result<(), Fault> {
    let mut experiments = spec.experiments.iter();
    let first = experiments.find(|experiment| experiment.role == ExperimentRole::Estimation);
    let taken = first.into_iter().flat_map(|first| first.signals.values());
    let is_there = |name: &&String| stream.signals.iter().any(|signal| signal.name == **name);
    let mut missing = taken.filter(|name| !is_there(name));
    match missing.next() {
        None => Ok(()),
        Some(name) => {
            let names: Vec<&str> = stream
                .signals
                .iter()
                .map(|signal| signal.name.as_str())
                .collect();
            let detail = format!("the job takes `{name}`; the stream has {}", listed(&names));
            Err(Fault::new("/stream", "unknown_signal", detail))
        }
    }
}

/// Refuses a job that may go on and change its result.
fn ended(row: &JobRow) -> Answer<()> {
    if row.status.is_terminal() {
        return Ok(());
    }
    let detail = format!("the job {} has not ended: its result may change", row.id);
    Err(Problem::new(Kind::WrongState, detail))
}

/// The result of a selection that chose something.
async fn selection(state: &ApiState, id: JobId) -> Answer<Selection> {
    let row = state
        .store
        .jobs()
        .find(id)
        .await?
        .ok_or_else(|| no_job(id))?;
    if !matches!(row.task, JobTask::Selection(_)) {
        let detail = "the job is no selection: there are no windows to estimate from";
        return Err(Problem::new(Kind::WrongState, detail));
    }
    ended(&row)?;
    let result = result_of(state.store.results(), &row).await?;
    let selection = result.selection().map_err(unreadable)?;
    match selection.chosen.is_empty() {
        false => Ok(selection),
        true => {
            let detail = "the selection chose no window: none says anything of what is wanted";
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}

/// The job that a selection began from, on recordings of the chosen windows.
fn estimation(id: JobId, selection: &Selection, before: &JobSpec, datasets: &Value) -> Value {
    // A note is of the job that it was written for.
    let before = &JobSpec {
        note: None,
        ..before.clone()
    };
    let mut document = serde_json::to_value(before).expect("a specification has only text keys");
    let mut experiments = before.experiments.iter();
    let first = experiments.find(|experiment| experiment.role == ExperimentRole::Estimation);
    let experiment = |dataset: &Value| {
        let mut experiment = json!({ "dataset": dataset });
        if let Some(first) = first {
            experiment["signals"] = json!(first.signals);
            let mut starts = first.initial_state.clone();
            starts.extend(selection.initial_state.clone());
            experiment["initial_state"] = json!(starts);
            experiment["parameters"] = json!(first.parameters);
        }
        experiment
    };
    let datasets = datasets.as_array().into_iter().flatten();
    document["experiments"] = datasets.map(experiment).collect();
    let windows = selection.chosen.len();
    document["name"] = json!(format!("{windows} windows of {}", selection.stream));
    document["labels"]["selection"] = json!(id);
    document
}

fn unknown_stream(name: &str) -> Problem {
    let detail = format!("there is no stream `{name}`");
    Problem::of_document(vec![Fault::new("/stream", "unknown_stream", detail)])
}

/// From where to where the windows of a selection are.
fn span(spec: &SelectionSpec, stream: &StreamRow) -> Result<(Timestamp, Timestamp), Fault> {
    let (Some(first), Some(last)) = (stream.first, stream.last) else {
        let detail = format!("the stream `{}` has no samples", spec.stream);
        return Err(Fault::new("/stream", "too_few_samples", detail));
    };
    let from = spec.span.0.unwrap_or(first);
    let to = spec.span.1.unwrap_or(last);
    if from >= to {
        let detail =
            format!("from {from} is not before to {to}; the stream is from {first} to {last}");
        return Err(Fault::new("/from", "bounds_reversed", detail));
    }
    let nanoseconds = super::streams::stamps::nanoseconds;
    let windows = SelectedSpan {
        from: nanoseconds(from),
        until: nanoseconds(to),
        window: (spec.window * 1e9).max(1.0) as i64,
    };
    if windows.count() as u64 > MAX_WINDOWS {
        let detail = format!(
            "{} windows: {MAX_WINDOWS} at the most; make windows longer, or the time between from and to shorter",
            windows.count()
        );
        return Err(Fault::new("/window_s", "too_many_windows", detail));
    }
    Ok((from, to))
}
