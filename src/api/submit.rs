//! Submitting a job: read it whole, say everything that is wrong, store it once.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::Response;
use serde::Serialize;
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::ApiState;
use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::http_headers::{idempotency_key, json, preferred_wait};
use super::jobs::{self, Job};
use super::model_library::Asked;
use super::query::{FromQuery, Params, QueryReader};
use super::spec_cache::SpecKey;
use crate::access::Project;
use crate::job::{JobTask, Status};
use crate::store::{Idempotency, JobRow, NewJob, NewModel, Submitted};
use greybox::identification::JobSpec;
use greybox::identification::assemble::{self, Assembly, Finding, Identifiability, Preflight};
use greybox::identification::budget::BudgetLine;
use greybox::identification::spec::Context;
use greybox::model::Model;
use greybox::parsing::Fault;

/// How to treat the submitted job.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct SubmitQuery {
    /// Say what would happen, and create nothing.
    #[param(required = false)]
    pub validate_only: bool,
}

impl FromQuery for SubmitQuery {
    fn read(query: &mut QueryReader) -> Self {
        Self {
            validate_only: query.flag("validate_only"),
        }
    }
}

/// What a job would do.
#[derive(Serialize, ToSchema)]
pub struct Validation {
    /// The specification with every default completed.
    spec: JobSpec,
    /// What the job will cost.
    predicted_cost: PredictedCost,
    /// The parameters that the job's data could fix.
    identifiability: Identifiability,
    /// What is taken as known, and what that will do to the parameters, in the middle of the search
    /// ranges.
    budget: Vec<BudgetLine>,
    /// Findings that the job's user should know before the job runs.
    findings: Vec<Finding>,
}

/// What a job will cost.
#[derive(Serialize, ToSchema)]
pub struct PredictedCost {
    /// Numbers that are estimated: parameters and initial states.
    unknowns: u64,
    /// Measured samples that they are estimated from.
    residuals: u64,
    /// Candidates that are judged in the search at the most.
    evaluations: u64,
    /// Derivatives that one candidate takes, at the middle of the search box.
    derivatives_per_evaluation: u64,
}

/// What can be said of a job before it runs.
type Outlook = (Preflight, Identifiability);

impl Validation {
    fn new(spec: JobSpec, (preflight, mut identifiability): Outlook) -> Self {
        let predicted_cost = PredictedCost {
            unknowns: preflight.unknowns,
            residuals: preflight.residuals,
            evaluations: preflight.evaluations,
            derivatives_per_evaluation: preflight.derivatives_per_evaluation,
        };
        Self {
            spec,
            predicted_cost,
            budget: std::mem::take(&mut identifiability.budget),
            identifiability,
            findings: preflight.findings,
        }
    }
}

/// Submit an estimation.
///
/// The answer means that the job is stored and will be worked on, whatever happens to the server.
/// The same `Idempotency-Key` never makes two jobs.
#[utoipa::path(
    post, path = "/v1/jobs", operation_id = "submit_job", tag = "jobs",
    params(
        SubmitQuery,
        ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
         description = "Makes the submission safe to repeat: the same key and body give the same \
                        answer again. The key counts for 7 days (`--keep-keys-days`) and at the \
                        least until its jobs have ended"),
        ("Prefer" = Option<String>, Header, example = "wait=30",
         description = "`wait=N`: answer when the job has ended or was paused, or after N seconds \
                        (at most 60)")
    ),
    request_body(content = JobSpec, content_type = "application/json"),
    responses(
        (status = 202, description = "The job is stored", body = Job,
         headers(("Location" = String, description = "Where the job is"),
                 ("Retry-After" = u32, description = "When to ask again, on unfinished jobs"),
                 ("Preference-Applied" = String, description = "The wait that was applied"),
                 ("Idempotent-Replayed" = String,
                  description = "`true` when this answers an earlier submission again"))),
        (status = 200, description = "With `validate_only`: what the job would do",
         body = Validation),
        (status = 409, description = "The job that this key made has been deleted")
    )
)]
pub async fn submit(
    State(state): State<ApiState>,
    Params(query): Params<SubmitQuery>,
    headers: HeaderMap,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let idempotency = idempotency(&headers, &client, &document)?;
    let asked_before = idempotency.as_ref().filter(|_| !query.validate_only);
    if let Some(earlier) = earlier(&state, asked_before).await? {
        return answer(&state, earlier, &headers).await;
    }
    let Ready {
        project,
        spec,
        model,
        new,
    } = ready(&state, &document.value, &client).await?;
    if query.validate_only {
        let method = spec.method.clone();
        let look_ahead = move |assembly: &Assembly, stop: &AtomicBool| {
            let mut preflight = assemble::preflight(assembly, &method, stop);
            let ahead = assemble::forecast(assembly, &mut preflight, stop);
            Ok((preflight, ahead))
        };
        let forecast = assembled(&state, &spec, model, look_ahead).await?;
        check_cost(&state, &spec, forecast.0.derivatives_per_evaluation)?;
        return Ok(json(StatusCode::OK, &Validation::new(spec, forecast)));
    }
    let ready = Ready {
        project,
        spec,
        model,
        new,
    };
    check(&state, &ready.spec, Arc::clone(&ready.model)).await?;
    store(&state, ready, idempotency, &headers).await
}

/// Submits a document that the server itself made of an earlier job.
pub(super) async fn submit_document(
    state: &ApiState,
    document: &Value,
    client: &Client,
    idempotency: Option<Idempotency>,
    headers: &HeaderMap,
) -> Answer {
    let ready = checked(state, document, client).await?;
    store(state, ready, idempotency, headers).await
}

/// Stores a job that was checked.
async fn store(
    state: &ApiState,
    ready: Ready,
    idempotency: Option<Idempotency>,
    headers: &HeaderMap,
) -> Answer {
    let job = ready.new_job(idempotency);
    if let Some(new) = ready.new {
        state.store.models().insert(new).await?;
    }
    answer(state, state.store.submissions().submit(job).await?, headers).await
}

/// What makes a submission safe to repeat, where the client asks for it.
pub(super) fn idempotency(
    headers: &HeaderMap,
    client: &Client,
    document: &JsonDocument,
) -> Answer<Option<Idempotency>> {
    let key = idempotency_key(headers)?;
    Ok(key.map(|key| Idempotency {
        project: client.project.clone(),
        key,
        body_digest: document.digest.clone(),
    }))
}

/// What became of the submission that came with this key before, if one did.
pub(super) async fn earlier(
    state: &ApiState,
    idempotency: Option<&Idempotency>,
) -> Answer<Option<Submitted>> {
    match idempotency {
        Some(idempotency) => Ok(state.store.submissions().earlier(idempotency).await?),
        None => Ok(None),
    }
}

/// A job that has been read.
pub(super) struct Ready {
    project: Project,
    spec: JobSpec,
    model: Arc<Model>,
    /// The model of the job, where the request brings a new model.
    pub(super) new: Option<NewModel>,
}

/// Reads a job, or says everything that is wrong with it.
async fn ready(state: &ApiState, document: &Value, client: &Client) -> Answer<Ready> {
    let asked = state.library.asked(document, client).await?;
    let spec = read(state, &client.project, &asked).await?;
    let model = match asked.model {
        Some(model) => model,
        None => state.library.model(&client.project, &spec.model).await?,
    };
    let new = asked.new;
    Ok(Ready {
        project: client.project.clone(),
        spec,
        model,
        new,
    })
}

/// Reads a job and holds it against its recordings.
pub(super) async fn checked(state: &ApiState, document: &Value, client: &Client) -> Answer<Ready> {
    let ready = ready(state, document, client).await?;
    check(state, &ready.spec, Arc::clone(&ready.model)).await?;
    Ok(ready)
}

impl Ready {
    /// The job as it is stored.
    pub(super) fn new_job(&self, idempotency: Option<Idempotency>) -> NewJob {
        let spec = &self.spec;
        let task = JobTask::Identification(Box::new(spec.clone()));
        NewJob {
            project: self.project.clone(),
            name: spec.name.clone(),
            labels: spec.labels.clone(),
            model: spec.model.clone(),
            datasets: task.recordings(),
            task,
            idempotency,
        }
    }
}

/// 202 for what was stored, or why it was not.
pub(super) async fn answer(state: &ApiState, submitted: Submitted, headers: &HeaderMap) -> Answer {
    let (row, replayed) = stored(submitted)?;
    accepted(state, row, replayed, headers).await
}

/// What is stored, and whether it was before; or why it was not stored.
pub(super) fn stored<T>(submitted: Submitted<T>) -> Answer<(T, bool)> {
    match submitted {
        Submitted::Created(row) => Ok((row, false)),
        Submitted::Replayed(row) => Ok((row, true)),
        Submitted::KeyReused => {
            let detail = "the key came before with another body; use a new key for something new";
            Err(Problem::new(Kind::KeyReused, detail))
        }
        Submitted::Forgotten(id) => {
            let detail = format!("what this key made, {id}, has been deleted");
            Err(Problem::new(Kind::WrongState, detail))
        }
        Submitted::NoModel(name) => {
            let detail = format!("there is no model `{name}` any more");
            let fault = Fault::new("/model", "unknown_model", detail);
            Err(Problem::of_document(vec![fault]))
        }
        Submitted::Refused(exceeded) => Err(exceeded.into()),
        Submitted::NoDataset(id) => {
            let detail = format!("there is no dataset {id}");
            let fault = Fault::new("/experiments", "unknown_dataset", detail);
            Err(Problem::of_document(vec![fault]))
        }
    }
}

/// The completed specification, or everything that is wrong with the document.
async fn read(state: &ApiState, project: &Project, asked: &Asked) -> Answer<JobSpec> {
    let (mut datasets, mut versions) = (HashMap::new(), HashMap::new());
    for id in JobSpec::datasets_named(&asked.document) {
        let stored = state.store.datasets();
        let row = stored.find(id).await?;
        if let Some(row) = row.filter(|row| row.project == *project) {
            datasets.insert(id, row.summary.clone());
            let named = JobSpec::versions_named(&asked.document, id);
            versions.insert(id, stored.versions_named(id, named).await?);
        }
    }
    let context = Context {
        models: state.library.descriptions(asked),
        datasets: &datasets,
        versions: Some(&versions),
        max_duration_s: state.limits.max_duration_s,
    };
    JobSpec::read(&asked.document, &context).map_err(Problem::of_document)
}

/// Says what speaks against the job once its recordings are looked at.
async fn check(state: &ApiState, spec: &JobSpec, model: Arc<Model>) -> Answer<()> {
    let checked = SpecKey::of(spec);
    let checked_before = state.checked.get(checked);
    let each = match checked_before {
        Some(each) => each,
        None => {
            let method = spec.method.clone();
            let look = move |assembly: &Assembly, stop: &AtomicBool| {
                Ok(assemble::preflight(assembly, &method, stop).derivatives_per_evaluation)
            };
            let each = assembled(state, spec, model, look).await?;
            state.checked.insert(checked, each);
            each
        }
    };
    check_cost(state, spec, each)
}

/// Refuses a search that would take too much, and says what would not; one candidate takes so many
/// derivatives.
fn check_cost(state: &ApiState, spec: &JobSpec, each: u64) -> Answer<()> {
    let limit = state.limits.job_derivatives;
    let (population, generations) = (spec.method.population, spec.method.generations);
    let one_generation = each as f64 * f64::from(population);
    let predicted = one_generation * f64::from(generations);
    if predicted <= limit {
        return Ok(());
    }
    let fits = (limit / one_generation).floor();
    let would = if fits >= 1.0 {
        format!("{fits} generations of {population} candidates would fit")
    } else {
        "a shorter window or fewer candidates may fit".to_owned()
    };
    let detail = format!(
        "the search takes up to {predicted:.1e} derivatives ({generations} generations of \
         {population} candidates with {each} each), more than the {limit:.1e} that a job may take \
         here (--max-job-derivatives); {would}"
    );
    let fault = Fault::new("/method/generations", "too_costly", detail);
    Err(Problem::of_document(vec![fault]))
}

/// Cuts the experiments out of their recordings, as the worker will, and looks at what comes out;
/// says what speaks against it.
async fn assembled<T: Send + 'static>(
    state: &ApiState,
    spec: &JobSpec,
    model: Arc<Model>,
    look: impl FnOnce(&Assembly, &AtomicBool) -> Answer<T> + Send + 'static,
) -> Answer<T> {
    let permit = state.work.recording_permit().await?;
    let recordings = state.recordings(spec).await?;
    let recordings = recordings.map_err(Problem::of_document)?;
    let spec = spec.clone();
    let looked = state.work.compute(move |stop| {
        let _permit = permit;
        let assembly = assemble::problem(&spec, &model, &recordings);
        let assembly = assembly.map_err(Problem::of_document)?;
        look(&assembly, stop)
    });
    looked.await
}

/// 202, after the wait that the client prefers.
async fn accepted(state: &ApiState, row: JobRow, replayed: bool, headers: &HeaderMap) -> Answer {
    let id = row.id;
    let wait = preferred_wait(headers);
    let mut row = Arc::new(row);
    if let Some(wait) = wait {
        let finished = |row: &JobRow| row.status.is_terminal() || row.status == Status::Paused;
        let later = jobs::wait_until(state.store.jobs(), &state.hub, id, wait, finished).await?;
        row = later.ok_or_else(|| jobs::no_job(id))?;
    }
    let mut response = jobs::answer(StatusCode::ACCEPTED, &row);
    let mut say = |name: HeaderName, value: String| {
        let value = HeaderValue::from_str(&value).expect("paths and numbers are visible ASCII");
        response.headers_mut().insert(name, value);
    };
    say(header::LOCATION, jobs::path_of(id));
    if let Some(wait) = wait {
        let applied = format!("wait={}", wait.as_secs());
        say(HeaderName::from_static("preference-applied"), applied);
    }
    if replayed {
        say(
            HeaderName::from_static("idempotent-replayed"),
            "true".to_owned(),
        );
    }
    Ok::<Response, Problem>(response)
}
