//! Jobs in short, for lists of many.

use std::collections::{BTreeMap, HashMap};
use std::time::Duration;

use jiff::Timestamp;
use serde::Deserialize;

use super::columns::{from_json, optional, optional_time, parse_id, parse_status, time};
use super::database::{Kind, QueryBuilder, Row};
use super::jobs::{Jobs, method, note, push_filter, trust};
use super::sealed::RESULTS;
use super::{JobFilter, Page, StoreError, corrupt};
use crate::access::Project;
use crate::job::Status;
use greybox::estimation::Progress;
use greybox::identification::JobId;
use greybox::identification::outcome::{ParameterEstimate, Trust};

/// A job in short.
#[derive(Clone, Debug)]
pub struct JobSummaryRow {
    /// The project that the job belongs to.
    pub project: Project,
    /// The identifier of the job.
    pub id: JobId,
    /// The name for people.
    pub name: Option<String>,
    /// Labels to find the job by.
    pub labels: BTreeMap<String, String>,
    /// A note for people.
    pub note: Option<String>,
    /// The model's name.
    pub model: String,
    /// The method's name.
    pub method: Option<String>,
    /// The recordings that the job reads.
    pub datasets: Vec<NamedDataset>,
    /// The state of the job.
    pub status: Status,
    /// How far the job came; nothing before the first slice.
    pub progress: Option<Progress>,
    /// The grade of the verdict: `high`, `moderate` or `low`; nothing without a verdict.
    pub trust: Option<String>,
    /// When the job was accepted.
    pub created_at: Timestamp,
    /// When the first slice of the job began.
    pub started_at: Option<Timestamp>,
    /// When the job ended.
    pub finished_at: Option<Timestamp>,
}

/// An estimate of a job in short, SI.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateInShort {
    /// The estimate.
    pub value: f64,
    /// The SI unit.
    pub unit: String,
    /// One standard deviation of the estimate's error, with what was taken as known.
    pub total_error: Option<f64>,
    /// How far the total interval can be relied on.
    pub trust: Option<Trust>,
}

/// The part of a result that a list shows.
#[derive(Deserialize)]
struct Estimates {
    /// The estimated parameters; none in the results of other kinds of jobs.
    #[serde(default)]
    parameters: Vec<ParameterEstimate>,
}

/// A recording by its name.
#[derive(Clone, Debug, Deserialize)]
pub struct NamedDataset {
    /// The identifier of the recording.
    pub id: String,
    /// The name for people; nothing where the recording has no name or was removed.
    pub name: Option<String>,
}

/// Results that are in memory at once, which have some hundred kilobytes each.
const RESULTS_AT_ONCE: usize = 20;

const COLUMNS: &str = "id, project, name, labels, model, status, progress, created_at, started_at, \
     finished_at, ";

/// The columns that are computed from others: the method and the note of a job, its recordings as JSON, the grade of its result.
fn made(kind: Kind) -> String {
    format!(
        "{} as method, {} as note, {}, (select {} from results where job = jobs.id) as trust",
        method(kind),
        note(kind),
        datasets(kind),
        trust(kind)
    )
}

/// The recordings of a job as JSON.
fn datasets(kind: Kind) -> &'static str {
    kind.either(
        "(select json_group_array(json_object('id', dataset, 'name', \
          (select name from datasets where datasets.id = dataset))) from job_datasets \
          where job = jobs.id) as datasets",
        "(select coalesce(json_agg(json_build_object('id', dataset, 'name', \
          (select name from datasets where datasets.id = dataset))), '[]')::text \
          from job_datasets where job = jobs.id) as datasets",
    )
}

impl Jobs {
    /// Jobs in short, newest first.
    pub async fn summaries(
        &self,
        filter: &JobFilter,
    ) -> Result<Page<JobSummaryRow, JobId>, StoreError> {
        let mut query = QueryBuilder::new("select ");
        query
            .push(COLUMNS)
            .push(made(self.database.readers.kind()))
            .push(" from jobs where project = ")
            .push_bind(filter.project.as_str().to_owned());
        push_filter(&mut query, self.database.readers.kind(), filter);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, filter.limit, |row| row.id))
    }

    /// The estimates of these names, by the jobs that have any of them.
    pub async fn estimates(
        &self,
        jobs: &[JobId],
        names: &[String],
    ) -> Result<HashMap<JobId, BTreeMap<String, EstimateInShort>>, StoreError> {
        let mut estimates = HashMap::new();
        for portion in jobs.chunks(RESULTS_AT_ONCE) {
            estimates.extend(self.estimates_of(portion, names).await?);
        }
        Ok(estimates)
    }

    async fn estimates_of(
        &self,
        jobs: &[JobId],
        names: &[String],
    ) -> Result<HashMap<JobId, BTreeMap<String, EstimateInShort>>, StoreError> {
        let mut query = QueryBuilder::new("select job, outcome, seal from results where job in (");
        let mut listed = query.separated(", ");
        for job in jobs {
            listed.push_bind(job.to_string());
        }
        query.push(")");
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let of_job = |row: &Row| {
            RESULTS.verify(row)?;
            let job: String = row.try_get("job")?;
            let result: Estimates = from_json("result", &job, row.try_get("outcome")?)?;
            let estimates = result.parameters.into_iter().filter_map(|parameter| {
                let key = parameter.key();
                names.contains(&key).then(|| (key, in_short(parameter)))
            });
            Ok((parse_id(&job)?, estimates.collect()))
        };
        rows.iter().map(of_job).collect()
    }

    /// How long the newest jobs of the same project, model and method took that succeeded, from their first slice to
    /// their end, `limit` of them at the most.
    pub async fn times_like(
        &self,
        job: &JobSummaryRow,
        limit: u32,
    ) -> Result<Vec<Duration>, StoreError> {
        let filter = JobFilter {
            status: Some(Status::Succeeded),
            model: Some(job.model.clone()),
            method: job.method.clone(),
            limit,
            ..JobFilter::default()
        };
        let mut query =
            QueryBuilder::new("select id, started_at, finished_at from jobs where project = ");
        query.push_bind(job.project.as_str().to_owned());
        push_filter(&mut query, self.database.readers.kind(), &filter);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let took = |row: &Row| {
            let id: String = row.try_get("id")?;
            let started_at = optional_time(&id, row.try_get("started_at")?)?;
            let finished_at = optional_time(&id, row.try_get("finished_at")?)?;
            let took = finished_at
                .zip(started_at)
                .map(|(end, begin)| end.duration_since(begin));
            Ok(took.and_then(|took| Duration::try_from(took).ok()))
        };
        let took = rows
            .iter()
            .map(took)
            .collect::<Result<Vec<_>, StoreError>>()?;
        Ok(took.into_iter().flatten().collect())
    }

    /// Summaries of the jobs in `jobs` that exist, in no order.
    pub async fn summaries_of(&self, jobs: &[JobId]) -> Result<Vec<JobSummaryRow>, StoreError> {
        if jobs.is_empty() {
            return Ok(Vec::new());
        }
        let mut query = QueryBuilder::new("select ");
        query.push(COLUMNS).push(made(self.database.readers.kind()));
        query.push(" from jobs where id in (");
        let mut listed = query.separated(", ");
        for job in jobs {
            listed.push_bind(job.to_string());
        }
        query.push(")");
        let rows = query.build().fetch_all(&self.database.readers).await?;
        rows.iter().map(read).collect()
    }
}

fn in_short(parameter: ParameterEstimate) -> EstimateInShort {
    EstimateInShort {
        value: parameter.estimate.estimate,
        unit: parameter.unit,
        total_error: parameter.estimate.total_standard_error,
        trust: parameter.estimate.trust,
    }
}

fn read(row: &Row) -> Result<JobSummaryRow, StoreError> {
    let id: String = row.try_get("id")?;
    let status: String = row.try_get("status")?;
    Ok(JobSummaryRow {
        project: row
            .try_get::<String>("project")?
            .parse()
            .map_err(|why| corrupt("project", &id, why))?,
        name: row.try_get("name")?,
        labels: from_json("labels", &id, row.try_get("labels")?)?,
        note: row.try_get("note")?,
        model: row.try_get("model")?,
        method: row.try_get("method")?,
        datasets: from_json("recordings", &id, row.try_get("datasets")?)?,
        status: parse_status(&id, &status)?,
        progress: optional(row, "progress", &id)?,
        trust: row.try_get("trust")?,
        created_at: time(&id, row.try_get("created_at")?)?,
        started_at: optional_time(&id, row.try_get("started_at")?)?,
        finished_at: optional_time(&id, row.try_get("finished_at")?)?,
        id: parse_id(&id)?,
    })
}
