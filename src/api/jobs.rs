//! Jobs: show, cancel, pause, resume, delete.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use tokio::time::Instant;
use utoipa::{IntoParams, ToSchema};

use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::http_headers::{MAX_WAIT_S, json, tagged};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use crate::event::EventHub;
use crate::job::{Failure, IllegalTransition, JobKind, JobTask, Status};
use crate::store::{Control, JobRemoval, JobRow, Jobs, StoreError};
use greybox::estimation::{Phase, Progress};
use greybox::identification::JobId;

/// When a client may ask again if nothing better is known `[s]`.
const RETRY_S: f64 = 2.0;
/// The longest that a client is told to stay away `[s]`.
const MAX_RETRY_S: f64 = 60.0;

/// A job.
#[derive(Serialize, ToSchema)]
pub struct Job {
    /// The identifier of the job.
    id: JobId,
    /// A name for people.
    name: Option<String>,
    /// Words to find the job by.
    labels: BTreeMap<String, String>,
    /// What people should know of the job.
    note: Option<String>,
    /// What the job does.
    kind: JobKind,
    /// The state of the job.
    status: Status,
    /// What can be asked of the job in this state: each is the last part of an address to POST to.
    #[schema(value_type = Vec<String>, example = json!(["pause", "cancel"]))]
    actions: Vec<&'static str>,
    /// The model whose parameters the job estimates.
    #[schema(example = "single_rod_servo")]
    model: String,
    /// The specification of the job; of an identification, with every default completed.
    spec: JobTask,
    /// How far the job came.
    progress: Progress,
    /// Slices begun since the last checkpoint: 1 in a life without crashes, 0 before the first.
    attempt: u32,
    /// Why the job failed; `null` unless the job failed.
    error: Option<Failure>,
    /// When the job was accepted.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    /// When the first slice of the job began.
    #[schema(value_type = Option<String>, format = DateTime)]
    started_at: Option<Timestamp>,
    /// When the job ended.
    #[schema(value_type = Option<String>, format = DateTime)]
    finished_at: Option<Timestamp>,
    /// Where the other resources of the job are.
    links: Links,
}

/// Where the resources of a job are.
#[derive(Serialize, ToSchema)]
struct Links {
    /// The job.
    #[serde(rename = "self")]
    job: String,
    /// What happens to the job, as a stream of events.
    events: String,
    /// The history of the search.
    generations: String,
    /// The result of the job.
    result: String,
    /// Measured beside simulated outputs.
    trajectory: String,
    /// What acted on the plant beside its inputs, where the result has process noise.
    disturbance: String,
    /// Draws from the posterior distribution, where the job asks for them.
    posterior: String,
    /// The result as one page for the file.
    report: String,
    /// POST here to end the job.
    cancel: String,
}

impl From<&JobRow> for Job {
    fn from(row: &JobRow) -> Self {
        let path = path_of(row.id);
        let links = Links {
            events: format!("{path}/events"),
            generations: format!("{path}/generations"),
            result: format!("{path}/result"),
            trajectory: format!("{path}/trajectory"),
            disturbance: format!("{path}/disturbance"),
            posterior: format!("{path}/posterior"),
            report: format!("{path}/report"),
            cancel: format!("{path}/cancel"),
            job: path,
        };
        Self {
            id: row.id,
            name: row.name.clone(),
            labels: row.labels.clone(),
            note: row.task.note().map(str::to_owned),
            kind: row.task.kind(),
            status: row.status,
            actions: row.status.actions().collect(),
            model: row.model.clone(),
            progress: row
                .progress
                .clone()
                .unwrap_or_else(|| no_progress(&row.task)),
            spec: row.task.clone(),
            attempt: row.attempt,
            error: row.error.clone(),
            created_at: row.created_at,
            started_at: row.started_at,
            finished_at: row.finished_at,
            links,
        }
    }
}

/// The progress of a job before its first slice.
fn no_progress(task: &JobTask) -> Progress {
    let generations = task.identification().map(|spec| spec.method.generations);
    Progress {
        phase: Phase::Search,
        generation: 0,
        generations: generations.unwrap_or(0),
        evaluations: 0,
        best_cost: None,
        best_credit: None,
        fraction: 0.0,
        eta_s: None,
    }
}

/// The path of a job.
pub fn path_of(id: JobId) -> String {
    format!("/v1/jobs/{id}")
}

/// The job, and when to ask again if it is not at its end.
pub fn answer(status: StatusCode, row: &JobRow) -> Response {
    let mut response = json(status, &Job::from(row));
    insert_retry(&mut response, retry_after(row));
    response
}

/// When a client may ask again for an unfinished job.
pub fn retry_after(row: &JobRow) -> Option<HeaderValue> {
    if row.status.is_terminal() {
        return None;
    }
    let eta = row.progress.as_ref().and_then(|progress| progress.eta_s);
    let seconds = eta.unwrap_or(RETRY_S).clamp(1.0, MAX_RETRY_S).ceil();
    Some(HeaderValue::from(seconds as u32))
}

fn insert_retry(response: &mut Response, retry: Option<HeaderValue>) {
    if let Some(retry) = retry {
        response.headers_mut().insert(header::RETRY_AFTER, retry);
    }
}

/// The job as it is once `done` holds, or after `wait`, or when the server shuts down.
pub async fn wait_until(
    jobs: &Jobs,
    hub: &EventHub,
    id: JobId,
    wait: Duration,
    done: impl Fn(&JobRow) -> bool,
) -> Result<Option<Arc<JobRow>>, StoreError> {
    let deadline = Instant::now() + wait;
    let mut changes = hub.subscribe(id);
    loop {
        let row = jobs.find(id).await?;
        if row.as_deref().is_none_or(&done) {
            return Ok(row);
        }
        tokio::select! {
            more = changes.changed() => if !more { return Ok(row) },
            () = tokio::time::sleep_until(deadline) => return Ok(row),
        }
    }
}

/// How long to wait for a change.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct WaitQuery {
    /// Answer when the job's status changes, or after so many seconds.
    #[param(minimum = 0, maximum = 60)]
    pub wait: Option<u64>,
    /// The status that the client knows: where the job has another already, the answer comes at once.
    #[param(inline, required = false)]
    pub r#while: Option<Status>,
}

impl FromQuery for WaitQuery {
    fn read(query: &mut QueryReader) -> Self {
        Self {
            wait: query.integer("wait", 0, MAX_WAIT_S),
            r#while: query.parsed("while", read_status),
        }
    }
}

/// A status of a job by its word.
pub(super) fn read_status(word: &str) -> Result<Status, String> {
    word.parse::<Status>().map_err(|error| error.to_string())
}

/// Show a job.
#[utoipa::path(
    get, path = "/v1/jobs/{id}", operation_id = "show_job", tag = "jobs",
    params(
        ("id" = JobId, Path, description = "The job"),
        WaitQuery,
        ("If-None-Match" = Option<String>, Header, description = "The `ETag` that the client has")
    ),
    responses(
        (status = 200, description = "The job", body = Job,
         headers(("ETag" = String, description = "Changes with the answer"),
                 ("Retry-After" = u32, description = "When to ask again, on unfinished jobs"))),
        (status = 304, description = "The client has this already")
    )
)]
pub async fn show(
    State(jobs): State<Jobs>,
    State(hub): State<EventHub>,
    Named(id): Named<JobId>,
    Params(query): Params<WaitQuery>,
    headers: HeaderMap,
) -> Answer {
    let mut row = jobs.find(id).await?;
    if let (Some(wait), Some(before)) = (query.wait, &row) {
        let before = query.r#while.unwrap_or(before.status);
        let changed = |row: &JobRow| row.status != before || row.status.is_terminal();
        row = wait_until(&jobs, &hub, id, Duration::from_secs(wait), changed).await?;
    }
    let row = row.ok_or_else(|| no_job(id))?;
    let mut response = tagged(&headers, &tag_of(&row), || Job::from(&*row));
    insert_retry(&mut response, retry_after(&row));
    Ok(response)
}

/// The strong tag of a job as it is shown: its revision grows with every change of that, and
/// another build may show it in other bytes.
fn tag_of(row: &JobRow) -> String {
    format!("\"{}-{}\"", env!("CARGO_PKG_VERSION"), row.revision)
}

/// There is no such job.
pub fn no_job(id: JobId) -> Problem {
    Problem::not_found("job", &id.to_string())
}

/// End a job; the best estimate so far stays readable. Idempotent.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/cancel", operation_id = "cancel_job", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    responses((status = 200, description = "The job, which is or soon will be cancelled",
               body = Job),
              (status = 409, description = "The job has ended in another way"))
)]
pub async fn cancel(
    State(jobs): State<Jobs>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
) -> Answer {
    controlled(id, Status::Cancelled, jobs.cancel(id).await?)
}

/// Hold a job; the best estimate so far stays readable. Idempotent.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/pause", operation_id = "pause_job", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    responses((status = 200, description = "The job, which is or soon will be paused",
               body = Job),
              (status = 409, description = "The job has ended"))
)]
pub async fn pause(
    State(jobs): State<Jobs>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
) -> Answer {
    controlled(id, Status::Paused, jobs.pause(id).await?)
}

/// Let a paused job go on. Idempotent.
#[utoipa::path(
    post, path = "/v1/jobs/{id}/resume", operation_id = "resume_job", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    responses((status = 200, description = "The job, which is queued or running", body = Job),
              (status = 409, description = "The job has ended"))
)]
pub async fn resume(
    State(jobs): State<Jobs>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
) -> Answer {
    controlled(id, Status::Queued, jobs.resume(id).await?)
}

fn controlled(id: JobId, to: Status, control: Control) -> Answer {
    match control {
        Control::Accepted(row) => Ok(answer(StatusCode::OK, &row)),
        Control::NotFound => Err(no_job(id)),
        Control::Refused(from) => Err(IllegalTransition { from, to }.into()),
    }
}

/// Forget a job that has ended, with its events, history and result.
#[utoipa::path(
    delete, path = "/v1/jobs/{id}", operation_id = "remove_job", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    responses((status = 204, description = "It is forgotten"),
              (status = 409, description = "The job has not ended"))
)]
pub async fn remove(
    State(jobs): State<Jobs>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
) -> Answer {
    match jobs.delete(id).await? {
        JobRemoval::Removed => Ok(StatusCode::NO_CONTENT.into_response()),
        JobRemoval::NotFound => Err(no_job(id)),
        JobRemoval::Unfinished(status) => {
            let detail = format!("the job is {status}; cancel it first");
            Err(Problem::new(Kind::WrongState, detail))
        }
    }
}
