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
use crate::store::{JobFilter, JobSummaryRow, Jobs, NamedDataset};
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
    /// Only those with this text in the name, the identifier, the model, a label or the name of a
    /// recording.
    #[param(max_length = 200)]
    pub text: Option<String>,
    /// How much of each is shown.
    #[param(inline)]
    pub view: Option<JobView>,
}

/// The filter, the place in the list, and how much of each job is shown.
pub struct WhichJobs(JobFilter, JobView);

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
        Self(filter, view)
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
            status: row.status,
            model: row.model,
            method: row.method,
            datasets: row.datasets.into_iter().map(DatasetName::from).collect(),
            trust: row.trust,
            progress: row.progress,
            created_at: row.created_at,
            started_at: row.started_at,
            finished_at: row.finished_at,
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
    Params(WhichJobs(mut filter, view)): Params<WhichJobs>,
    uri: Uri,
) -> Answer {
    filter.project = client.project;
    if view == JobView::Summary {
        let page = jobs.summaries(&filter).await?;
        let items = page.rows.into_iter().map(JobSummary::from).collect();
        return Ok(Page::new(items, page.next.map(|id| id.to_string())).answer(&uri));
    }
    let page = jobs.list(&filter).await?;
    let items = page.rows.iter().map(Job::from).collect();
    Ok(Page::new(items, page.next.map(|id| id.to_string())).answer(&uri))
}
