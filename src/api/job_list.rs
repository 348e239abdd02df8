//! Lists of jobs: whole, or in short where there are many.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::http::Uri;
use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};

use super::client::Client;
use super::error::Answer;
use super::jobs::{Job, read_status};
use super::page::{Cursor, Page, PageParams};
use super::query::{FromQuery, Params, QueryReader};
use crate::access::Project;
use crate::job::Status;
use crate::store::{EstimateInShort, JobFilter, JobSummaryRow, Jobs, NamedDataset};
use greybox::estimation::Progress;
use greybox::identification::outcome::Trust;
use greybox::identification::spec::{MAX_NAME_CHARS, MethodName};
use greybox::identification::{DatasetId, JobId};

/// How much of each job a list shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum JobView {
    /// The job with its whole specification.
    #[default]
    Whole,
    /// What tells it from others, with its trust and the names of its recordings.
    Summary,
}

/// Which jobs to list.
#[derive(IntoParams)]
#[into_params(parameter_in = Query)]
pub struct JobsQuery {
    /// Only those in this state.
    #[param(inline)]
    pub status: Option<Status>,
    /// Only those with this label, `site`, or with this value of it, `site:hall 2`.
    pub label: Option<String>,
    /// Only those of this model.
    pub model: Option<String>,
    /// Only those that read this recording.
    pub dataset: Option<DatasetId>,
    /// Only those of this method.
    #[param(inline)]
    pub method: Option<MethodName>,
    /// Only those whose verdict has this grade.
    #[param(inline)]
    pub trust: Option<Trust>,
    /// Only those with this text in the name, the identifier, the model, a label, the note or the name of a
    /// recording.
    #[param(max_length = 200)]
    pub text: Option<String>,
    /// How much of each is shown.
    #[param(inline)]
    pub view: Option<JobView>,
    /// Names of parameters, separated by commas, whose estimates are shown in short: `mass`, or `load[1]` of the
    /// second experiment alone. 20 at the most, with `view=summary`.
    #[param(value_type = Option<String>, example = "mass,damping")]
    pub estimates: Option<Vec<String>>,
}

/// Names of estimates at the most.
const MAX_ESTIMATES: usize = 20;

/// Which jobs are listed, and how much of each is shown.
pub struct WhichJobs {
    filter: JobFilter,
    view: JobView,
    /// The names of the estimates that are shown; nothing where none is asked for.
    estimates: Option<Vec<String>>,
}

impl FromQuery for WhichJobs {
    fn read(query: &mut QueryReader) -> Self {
        let status = query.parsed("status", read_status);
        let label = query
            .text("label")
            .map(|label| match label.split_once([':', '=']) {
                Some((label, value)) => (label.to_owned(), Some(value.to_owned())),
                None => (label, None),
            });
        let model = query.text("model");
        let dataset = query.parsed("dataset", |id| {
            id.parse::<DatasetId>().map_err(|error| error.to_string())
        });
        let method = query.parsed("method", |word| {
            named::<MethodName>(word).map(|_| word.to_owned())
        });
        let trust = query.parsed("trust", |word| {
            named::<Trust>(word).map(|_| word.to_owned())
        });
        let text = query.parsed("text", short);
        let view = query.parsed("view", named::<JobView>).unwrap_or_default();
        let estimates = query.parsed("estimates", |names| match view {
            JobView::Summary => names_of_estimates(names),
            JobView::Whole => Err("estimates are shown with `view=summary`".to_owned()),
        });
        let cursor = Cursor::read(query);
        let filter = JobFilter {
            project: Project::default(),
            status,
            label,
            model,
            dataset,
            method,
            trust,
            text,
            before: cursor.before,
            limit: cursor.limit,
        };
        Self {
            filter,
            view,
            estimates,
        }
    }
}

fn names_of_estimates(names: &str) -> Result<Vec<String>, String> {
    let names: Vec<String> = names.split(',').map(str::to_owned).collect();
    match names.len() {
        0..=MAX_ESTIMATES => Ok(names),
        count => Err(format!("{count} names are more than {MAX_ESTIMATES}")),
    }
}

/// One of the words of a type; the fault names them all.
fn named<T: for<'de> Deserialize<'de>>(word: &str) -> Result<T, String> {
    serde_json::from_value(Value::from(word)).map_err(|error| error.to_string())
}

fn short(text: &str) -> Result<String, String> {
    let length = text.chars().count();
    if length <= MAX_NAME_CHARS {
        Ok(text.to_owned())
    } else {
        Err(format!(
            "{length} characters are more than {MAX_NAME_CHARS}"
        ))
    }
}

/// A job in short.
#[derive(Serialize, ToSchema)]
pub struct JobSummary {
    /// The identifier of the job.
    id: JobId,
    /// A name for people.
    name: Option<String>,
    /// Words to find the job by.
    labels: BTreeMap<String, String>,
    /// A note for people.
    note: Option<String>,
    /// The state of the job.
    status: Status,
    /// The model whose parameters the job estimates.
    #[schema(example = "single_rod_servo")]
    model: String,
    /// The method of the job.
    #[schema(example = "icra_genetic")]
    method: Option<String>,
    /// The recordings that the job reads.
    datasets: Vec<DatasetName>,
    /// The grade of the verdict: `high`, `moderate` or `low`; `null` without a verdict.
    #[schema(example = "high")]
    trust: Option<String>,
    /// How far the job came; `null` before the first slice.
    progress: Option<Progress>,
    /// When the job was accepted.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    /// When the first slice of the job began.
    #[schema(value_type = Option<String>, format = DateTime)]
    started_at: Option<Timestamp>,
    /// When the job ended.
    #[schema(value_type = Option<String>, format = DateTime)]
    finished_at: Option<Timestamp>,
    /// The estimates that `estimates` names, by their names, as far as the job has them; absent where none is asked
    /// for.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    estimates: Option<BTreeMap<String, ListedEstimate>>,
}

/// An estimate in a list of jobs.
#[derive(Serialize, ToSchema)]
pub struct ListedEstimate {
    /// The estimate, SI.
    value: f64,
    /// The SI unit.
    #[schema(example = "kg")]
    unit: String,
    /// One standard deviation of the estimate's error, with what was taken as known, SI.
    total_error: Option<f64>,
    /// How far the total interval can be relied on.
    trust: Option<Trust>,
}

impl From<EstimateInShort> for ListedEstimate {
    fn from(estimate: EstimateInShort) -> Self {
        Self {
            value: estimate.value,
            unit: estimate.unit,
            total_error: estimate.total_error,
            trust: estimate.trust,
        }
    }
}

/// A recording by its name.
#[derive(Serialize, ToSchema)]
struct DatasetName {
    /// The identifier of the recording.
    id: String,
    /// A name for people; `null` where the recording has no name or was removed.
    name: Option<String>,
}

impl From<NamedDataset> for DatasetName {
    fn from(NamedDataset { id, name }: NamedDataset) -> Self {
        Self { id, name }
    }
}

impl From<JobSummaryRow> for JobSummary {
    fn from(row: JobSummaryRow) -> Self {
        Self {
            id: row.id,
            name: row.name,
            labels: row.labels,
            note: row.note,
            status: row.status,
            model: row.model,
            method: row.method,
            datasets: row.datasets.into_iter().map(DatasetName::from).collect(),
            trust: row.trust,
            progress: row.progress,
            created_at: row.created_at,
            started_at: row.started_at,
            finished_at: row.finished_at,
            estimates: None,
        }
    }
}

/// A page of jobs: of `Job`, or of `JobSummary` with `view=summary`.
#[derive(Serialize, ToSchema)]
#[serde(untagged)]
#[allow(dead_code, reason = "it describes an answer that is one of two pages")]
pub enum JobsPage {
    /// Jobs with their specifications.
    Whole(Page<Job>),
    /// Jobs in short.
    Summaries(Page<JobSummary>),
}

/// List jobs, newest first.
#[utoipa::path(
    get, path = "/v1/jobs", operation_id = "list_jobs", tag = "jobs",
    params(JobsQuery, PageParams),
    responses((status = 200, description = "A page of jobs", body = JobsPage,
               headers(("Link" = String, description = "The next page, `rel=\"next\"`"))))
)]
pub async fn list(
    State(jobs): State<Jobs>,
    client: Client,
    Params(which): Params<WhichJobs>,
    uri: Uri,
) -> Answer {
    let WhichJobs {
        mut filter,
        view,
        estimates,
    } = which;
    filter.project = client.project;
    if view == JobView::Summary {
        let page = jobs.summaries(&filter).await?;
        let next = page.next.map(|id| id.to_string());
        let mut items: Vec<JobSummary> = page.rows.into_iter().map(JobSummary::from).collect();
        if let Some(names) = estimates {
            add_estimates(&jobs, &names, &mut items).await?;
        }
        return Ok(Page::new(items, next).answer(&uri));
    }
    let page = jobs.list(&filter).await?;
    let items = page.rows.iter().map(Job::from).collect();
    Ok(Page::new(items, page.next.map(|id| id.to_string())).answer(&uri))
}

/// Adds the estimates of these names to jobs in short.
async fn add_estimates(jobs: &Jobs, names: &[String], items: &mut [JobSummary]) -> Answer<()> {
    let judged: Vec<JobId> = items
        .iter()
        .filter(|job| job.trust.is_some())
        .map(|job| job.id)
        .collect();
    let mut by_job = jobs.estimates(&judged, names).await?;
    for job in items {
        let estimates = by_job.remove(&job.id).unwrap_or_default();
        let shown = estimates
            .into_iter()
            .map(|(name, estimate)| (name, estimate.into()));
        job.estimates = Some(shown.collect());
    }
    Ok(())
}
