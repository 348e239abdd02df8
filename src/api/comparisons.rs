//! Comparisons: the same problem by several methods and seeds, each run a job of its own.
//!
//! A comparison and its jobs come to be together or not at all. The jobs are as durable as any other
//! and can be followed and cancelled alone; the table is made of their results whenever it is asked
//! for. They carry the comparison's identifier in the label `comparison` so that lists of jobs show
//! them together; the label alone makes no job one of them.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, Uri, header};
use jiff::Timestamp;
use serde::Serialize;
use serde_json::{Value, json as object};
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Problem};
use super::extract::Named;
use super::http_headers::json;
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, NoQuery, Params, QueryReader};
use super::{ApiState, submit};
use crate::job::comparison::{self, Comparison, Trial};
use crate::job::{ComparisonId, Status};
use crate::store::{
    ComparisonRow, ComparisonSummary, Comparisons, JobRow, NewComparison, Results, StoredResult,
    Submitted,
};
use greybox::identification::spec::MethodName;
use greybox::identification::{JobId, JobSpec};
use greybox::parsing::reader::{Field, read_document};

/// The label that the jobs of a comparison carry.
const LABEL: &str = "comparison";

/// Runs of each method at the most.
const MOST_SEEDS: u64 = 50;

/// What a comparison is asked to do.
#[derive(ToSchema)]
#[schema(example = json!({
    "job": {"model": "single_rod_servo", "experiments": [{"dataset": "ds_0192d3a4b5c67d8e9f00112233445566"}]},
    "methods": ["icra_genetic", "multistart_lm"],
    "seeds": 10
}))]
#[allow(dead_code, reason = "it describes a body that is read field by field")]
pub struct ComparisonSpec {
    /// The job, as it is submitted alone. Its method's settings hold for all methods, whatever it
    /// calls its own; its seed, else 1, is that of the first run of each.
    job: JobSpec,
    /// The methods, each once; left out, all.
    #[schema(required = false, min_items = 1, max_items = 4)]
    methods: Vec<MethodName>,
    /// Runs of each method, each with the seed after the one before.
    #[schema(required = false, minimum = 1, maximum = 50, default = 10)]
    seeds: u64,
}

/// How far a comparison has come.
#[derive(Serialize, ToSchema)]
pub struct ComparisonState {
    /// The identifier of the comparison; the jobs carry the identifier in the label `comparison`.
    id: ComparisonId,
    /// When the comparison was accepted.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    /// How many runs have ended.
    ended: usize,
    /// Whether every run has come to its end.
    finished: bool,
    /// The methods side by side, as far as their runs have ended.
    #[serde(flatten)]
    comparison: Comparison,
    /// The jobs.
    jobs: Vec<ComparedJob>,
}

/// One run.
#[derive(Serialize, ToSchema)]
pub struct ComparedJob {
    /// The job.
    id: JobId,
    /// The method of the job.
    #[schema(example = "icra_genetic")]
    method: String,
    /// The seed of the job.
    seed: u64,
    /// The state of the job.
    status: Status,
}

struct Asked {
    job: Value,
    methods: Vec<String>,
    seeds: u64,
    first_seed: u64,
}

fn read(root: &Field<'_>) -> Option<Asked> {
    let mut object = root.object()?;
    let job = object.required("job");
    if let Some(job) = &job {
        job.object();
    }
    let methods = object
        .optional("methods")
        .and_then(|field| read_methods(&field));
    let seeds = object.optional("seeds");
    let seeds = seeds.and_then(|field| field.integer(1, MOST_SEEDS));
    object.finish();
    let job = job?.value;
    Some(Asked {
        // A seed that is none is told by each job.
        first_seed: job["seed"].as_u64().unwrap_or(1),
        job: job.clone(),
        methods: methods.unwrap_or_else(all_methods),
        seeds: seeds.unwrap_or(10),
    })
}

fn all_methods() -> Vec<String> {
    let all = [
        MethodName::IcraGenetic,
        MethodName::DifferentialEvolution,
        MethodName::CmaEs,
        MethodName::MultistartLm,
    ];
    all.iter().map(|method| name_of(*method)).collect()
}

fn name_of(method: MethodName) -> String {
    let name = serde_json::to_value(method).expect("a name");
    name.as_str().unwrap_or_default().to_owned()
}

fn read_methods(field: &Field<'_>) -> Option<Vec<String>> {
    let possible = all_methods();
    let mut methods: Vec<String> = Vec::new();
    let entries = field.array()?;
    if entries.len() == 0 || entries.len() > possible.len() {
        let most = possible.len();
        let detail = format!("{} methods: there are 1 to {most}", entries.len());
        field.fault("out_of_range", detail);
        return None;
    }
    for entry in entries {
        let name = entry.text()?;
        if !possible.iter().any(|method| method == name) {
            let detail = format!("the methods are {}", possible.join(", "));
            entry.fault("unknown_method", detail);
        } else if methods.iter().any(|before| before == name) {
            entry.fault("duplicate", format!("`{name}` is named twice"));
        }
        methods.push(name.to_owned());
    }
    Some(methods)
}

/// Compare methods.
///
/// Makes a job for each method and seed: all of them, or none. The same `Idempotency-Key` never makes
/// two comparisons.
#[utoipa::path(
    post, path = "/v1/comparisons", operation_id = "submit_comparison", tag = "jobs",
    params(
        ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
         description = "Makes the submission safe to repeat: the same key and body give the same \
                        answer again. The key counts for 7 days (`--keep-keys-days`) and at the \
                        least until its jobs have ended")
    ),
    request_body(content = ComparisonSpec, content_type = "application/json"),
    responses(
        (status = 202, description = "The jobs are stored", body = ComparisonState,
         headers(("Location" = String, description = "Where the comparison is"),
                 ("Idempotent-Replayed" = String,
                  description = "`true` when this answers an earlier submission again"))),
        (status = 409, description = "The comparison that this key made has been deleted")
    )
)]
pub async fn submit_comparison(
    State(state): State<ApiState>,
    _: Params<NoQuery>,
    headers: HeaderMap,
    client: Client,
    document: JsonDocument,
) -> Answer {
    let idempotency = submit::idempotency(&headers, &client, &document)?;
    if let Some(idempotency) = &idempotency
        && let Some(earlier) = state.store.comparisons().earlier(idempotency).await?
    {
        return accepted(&state, earlier).await;
    }
    let asked = read_document(&document.value, read).map_err(Problem::of_document)?;
    let mut new = NewComparison {
        id: ComparisonId::new(),
        project: client.project.clone(),
        jobs: Vec::new(),
        model: None,
        idempotency,
    };
    for method in &asked.methods {
        for run in 0..asked.seeds {
            let seed = asked.first_seed.saturating_add(run);
            let job = run_of(&asked.job, &new.id, (method, seed));
            let ready = submit::checked(&state, &job, &client).await;
            let ready = ready.map_err(|problem| problem.below("/job"))?;
            new.jobs.push(ready.new_job(None));
            new.model = ready.new;
        }
    }
    let submitted = state.store.comparisons().submit(new).await?;
    accepted(&state, submitted).await
}

async fn accepted(state: &ApiState, submitted: Submitted<ComparisonRow>) -> Answer {
    let (row, replayed) = submit::stored(submitted)?;
    let mut response = json(
        StatusCode::ACCEPTED,
        &shown(state.store.results(), &row).await?,
    );
    let headers = response.headers_mut();
    let location = HeaderValue::from_str(&path_of(row.id));
    let location = location.expect("an identifier is visible ASCII");
    headers.insert(header::LOCATION, location);
    if replayed {
        let name = HeaderName::from_static("idempotent-replayed");
        headers.insert(name, HeaderValue::from_static("true"));
    }
    Ok(response)
}

fn path_of(id: ComparisonId) -> String {
    format!("/v1/comparisons/{id}")
}

/// The job with one method and seed.
fn run_of(job: &Value, id: &ComparisonId, (method, seed): (&str, u64)) -> Value {
    let mut job = job.clone();
    for (section, name, value) in [
        ("method", "name", object!(method)),
        ("labels", LABEL, object!(id.to_string())),
    ] {
        let section = &mut job[section];
        if section.is_null() {
            *section = object!({});
        }
        // A section that is no object is the job's fault, and told as such.
        if let Some(section) = section.as_object_mut() {
            section.insert(name.to_owned(), value);
        }
    }
    job["seed"] = object!(seed);
    job
}

/// A comparison in a list.
#[derive(Serialize, ToSchema)]
pub struct ListedComparison {
    /// The identifier of the comparison.
    id: ComparisonId,
    /// When the comparison was accepted.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    /// How many runs the comparison has.
    runs: u64,
    /// How many runs have ended.
    ended: u64,
    /// Whether every run has come to its end.
    finished: bool,
}

impl From<&ComparisonSummary> for ListedComparison {
    fn from(row: &ComparisonSummary) -> Self {
        Self {
            id: row.id,
            created_at: row.created_at,
            runs: row.runs,
            ended: row.ended,
            finished: row.ended == row.runs,
        }
    }
}

/// The page of a list.
pub struct WhichComparisons(Cursor<ComparisonId>);

impl FromQuery for WhichComparisons {
    fn read(query: &mut QueryReader) -> Self {
        Self(Cursor::read(query))
    }
}

/// List comparisons, newest first.
#[utoipa::path(
    get, path = "/v1/comparisons", operation_id = "list_comparisons", tag = "jobs",
    params(PageParams),
    responses((status = 200, description = "A page of comparisons", body = Page<ListedComparison>,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(comparisons): State<Comparisons>,
    client: Client,
    Params(WhichComparisons(cursor)): Params<WhichComparisons>,
    uri: Uri,
) -> Answer {
    let page = comparisons.list(&client.project, cursor.before, cursor.limit);
    let page = page.await?;
    let items = page.rows.iter().map(ListedComparison::from).collect();
    Ok(Page::new(items, page.next.map(|id| id.to_string())).answer(&uri))
}

/// Read a comparison.
#[utoipa::path(
    get, path = "/v1/comparisons/{id}", operation_id = "read_comparison", tag = "jobs",
    params(("id" = ComparisonId, Path, description = "The comparison")),
    responses((status = 200, description = "The methods side by side", body = ComparisonState))
)]
pub async fn show(
    State(comparisons): State<Comparisons>,
    State(results): State<Results>,
    Named(id): Named<ComparisonId>,
    _: Params<NoQuery>,
) -> Answer {
    let row = comparisons.find(id).await?;
    let row = row.ok_or_else(|| Problem::not_found("comparison", &id.to_string()))?;
    Ok(json(StatusCode::OK, &shown(&results, &row).await?))
}

async fn shown(results: &Results, row: &ComparisonRow) -> Answer<ComparisonState> {
    let rows = &row.jobs;
    let mut methods: Vec<String> = Vec::new();
    let mut trials = Vec::new();
    for row in rows {
        let method = method_of(row);
        if !methods.contains(&method) {
            methods.push(method);
        }
        if row.status.is_terminal()
            && let Some(result) = results.find(row.id).await?
        {
            trials.extend(trial(row, &result));
        }
    }
    let ended = rows.iter().filter(|row| row.status.is_terminal()).count();
    Ok(ComparisonState {
        id: row.id,
        created_at: row.created_at,
        ended,
        finished: ended == rows.len(),
        comparison: comparison::compare(&methods, &trials),
        jobs: rows
            .iter()
            .map(|row| ComparedJob {
                id: row.id,
                method: method_of(row),
                seed: seed_of(row),
                status: row.status,
            })
            .collect(),
    })
}

fn method_of(row: &JobRow) -> String {
    let spec = row.task.identification();
    spec.map_or_else(String::new, |spec| name_of(spec.method.name))
}

fn seed_of(row: &JobRow) -> u64 {
    row.task.identification().map_or(0, |spec| spec.seed)
}

fn trial(row: &JobRow, result: &StoredResult) -> Option<Trial> {
    let outcome = result.outcome().ok()?;
    let estimates = outcome.parameters.iter();
    let estimates = estimates.map(|parameter| (parameter.key(), parameter.estimate.estimate));
    let (started, finished) = (row.started_at?, row.finished_at?);
    Some(Trial {
        method: method_of(row),
        seed: seed_of(row),
        cost: outcome.criteria.cost,
        evaluations: outcome.search.evaluations,
        seconds: finished.duration_since(started).as_secs_f64(),
        estimates: estimates.collect::<BTreeMap<String, f64>>(),
    })
}
