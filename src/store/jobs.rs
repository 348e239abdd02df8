//! Jobs as they are shown and listed.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use jiff::Timestamp;

use super::columns::{from_json, optional, optional_time, parse_id, parse_status, project, time};
use super::database::{self, Connection, Kind, QueryBuilder, Row};
use super::page::Page;
use super::row_cache::RowCache;
use super::sealed::{JOB_STATES, JOBS};
use super::shared_database::Database;
use super::stop_request::StopRequest;
use super::writer::{Tx, in_transaction};
use super::{StoreError, corrupt, unsigned};
use crate::access::Project;
use crate::job::{Failure, JobTask, Status};
use greybox::estimation::Progress;
use greybox::identification::{DatasetId, JobId};

/// A job as it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct JobRow {
    /// The identifier of the job.
    pub id: JobId,
    /// The project that the job belongs to.
    pub project: Project,
    /// The name for people.
    pub name: Option<String>,
    /// Labels to find the job by.
    pub labels: BTreeMap<String, String>,
    /// The model's name.
    pub model: String,
    /// What the job is asked to do.
    pub task: JobTask,
    /// The state of the job.
    pub status: Status,
    /// A request to stop the job that has not taken effect yet.
    pub stop_request: Option<StopRequest>,
    /// How far the job came; nothing before the first slice.
    pub progress: Option<Progress>,
    /// Slices begun since the last checkpoint: 1 in a life without crashes, 0 before the first.
    pub attempt: u32,
    /// Why the job failed.
    pub error: Option<Failure>,
    /// When the job was accepted.
    pub created_at: Timestamp,
    /// When the first slice of the job began.
    pub started_at: Option<Timestamp>,
    /// When the job ended.
    pub finished_at: Option<Timestamp>,
    /// The id of the last event of the job.
    pub last_event: i64,
    /// Grows with every change of what is shown.
    pub revision: i64,
}

/// A row whose task is a text of so many bytes at the most is kept in memory: some 40 KB.
const SMALL_TASK_BYTES: usize = 8 * 1024;

impl JobRow {
    /// The row as it was when the job was submitted.
    pub(super) fn into_submitted(self) -> Self {
        Self {
            status: Status::Queued,
            stop_request: None,
            progress: None,
            attempt: 0,
            error: None,
            started_at: None,
            finished_at: None,
            last_event: 1,
            revision: 1,
            ..self
        }
    }
}

/// Which jobs to list.
#[derive(Clone, Debug, Default)]
pub struct JobFilter {
    /// Only jobs of this project.
    pub project: Project,
    /// Only jobs in this state.
    pub status: Option<Status>,
    /// Only jobs with this label, and with this value where a value is given.
    pub label: Option<(String, Option<String>)>,
    /// Only jobs of this model.
    pub model: Option<String>,
    /// Only jobs that read this recording.
    pub dataset: Option<DatasetId>,
    /// Only jobs of this method.
    pub method: Option<String>,
    /// Only jobs whose verdict has this grade: `high`, `moderate` or `low`.
    pub trust: Option<String>,
    /// Only jobs with this text in the name, the identifier, the model, a label, the note or the name of a
    /// recording, in letters of either case.
    pub text: Option<String>,
    /// Only jobs older than this job: the last job of the previous page.
    pub before: Option<JobId>,
    /// How many jobs to list at the most.
    pub limit: u32,
}

/// What became of a wish to delete a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobRemoval {
    /// It is gone, with its events, history and result.
    Removed,
    /// There is no such job.
    NotFound,
    /// It has not ended.
    Unfinished(Status),
}

pub(super) const COLUMNS: &str = "id, project, name, labels, model, spec, status, request, progress, attempt, error, \
     created_at, started_at, finished_at, last_event, revision, epoch, queue_entry, running_ms, told_generation, \
     told_refinements, told_at_ms, deaths, at_work_in, is_shared, seal, state_seal";

/// Jobs as they are shown, listed, stopped and deleted.
#[derive(Clone)]
pub struct Jobs {
    pub(super) database: Arc<Database>,
    /// The rows of jobs that were read lately.
    pub(super) rows: RowCache<JobId, JobRow>,
}

impl Jobs {
    /// A job, if there is one.
    pub async fn find(&self, id: JobId) -> Result<Option<Arc<JobRow>>, StoreError> {
        let reading = match self.rows.get(id) {
            Ok(row) => return Ok(Some(row)),
            Err(reading) => reading,
        };
        let mut connection = self.database.readers.acquire().await?;
        let Some(stored) = fetch_stored(&mut connection, id).await? else {
            return Ok(None);
        };
        let row = Arc::new(read(&stored)?);
        if stored.try_get::<&str>("spec")?.len() <= SMALL_TASK_BYTES {
            reading.keep(&row);
        }
        Ok(Some(row))
    }

    /// Whose a job is, if there is one.
    pub async fn project_of(&self, id: JobId) -> Result<Option<Project>, StoreError> {
        let key = id.to_string();
        let name: Option<String> = database::query_scalar("select project from jobs where id = $1")
            .bind(&key)
            .fetch_optional(&self.database.readers)
            .await?;
        name.map(|name| project(&key, &name)).transpose()
    }

    /// Jobs, newest first.
    pub async fn list(&self, filter: &JobFilter) -> Result<Page<JobRow, JobId>, StoreError> {
        let mut query = QueryBuilder::new("select ");
        query
            .push(COLUMNS)
            .push(" from jobs where project = ")
            .push_bind(filter.project.as_str().to_owned());
        push_filter(&mut query, self.database.readers.kind(), filter);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, filter.limit, |row| row.id))
    }

    /// How many jobs are in each state.
    pub async fn counts(&self) -> Result<Vec<(Status, u64)>, StoreError> {
        let rows: Vec<(String, i64)> =
            database::query_as("select status, count(*) from jobs group by status")
                .fetch_all(&self.database.readers)
                .await?;
        rows.into_iter()
            .map(|(status, count)| Ok((parse_status("a job", &status)?, count.unsigned_abs())))
            .collect()
    }

    /// The time that the jobs of each project were at work so far.
    pub async fn work_by_project(&self) -> Result<Vec<(Project, Duration)>, StoreError> {
        let rows: Vec<(String, i64)> = database::query_as(
            "select project, cast(sum(worked_ms) as bigint) from project_days group by project",
        )
        .fetch_all(&self.database.readers)
        .await?;
        let rows = rows.into_iter().map(|(name, worked_ms)| {
            let worked = Duration::from_millis(worked_ms.unsigned_abs());
            Ok((project("a day", &name)?, worked))
        });
        rows.collect()
    }

    /// Forgets a job that has ended.
    pub async fn delete(&self, id: JobId) -> Result<JobRemoval, StoreError> {
        in_transaction!(self.database, |tx| delete(tx, id)).await
    }
}

/// The conditions of a list, its order and its length.
pub(super) fn push_filter(query: &mut QueryBuilder, kind: Kind, filter: &JobFilter) {
    let mut equal = |column: &str, value: Option<String>| {
        if let Some(value) = value {
            query
                .push(format_args!(" and {column} = "))
                .push_bind(value);
        }
    };
    equal(
        "status",
        filter.status.map(|status| status.as_str().to_owned()),
    );
    equal("model", filter.model.clone());
    equal(method(kind), filter.method.clone());
    if let Some((label, value)) = &filter.label {
        query
            .push(" and id in (select job from job_labels where label = ")
            .push_bind(label.clone());
        if let Some(value) = value {
            query.push(" and value = ").push_bind(value.clone());
        }
        query.push(")");
    }
    if let Some(dataset) = filter.dataset {
        query
            .push(" and id in (select job from job_datasets where dataset = ")
            .push_bind(dataset.to_string())
            .push(")");
    }
    if let Some(trust) = &filter.trust {
        query
            .push(format_args!(
                " and id in (select job from results where {} = ",
                self::trust(kind)
            ))
            .push_bind(trust.clone())
            .push(")");
    }
    if let Some(text) = &filter.text {
        push_search(query, kind, text);
    }
    if let Some(before) = filter.before {
        query.push(" and id < ").push_bind(before.to_string());
    }
    query
        .push(" order by id desc limit ")
        .push_bind(i64::from(filter.limit) + 1);
}

/// The name of a job's method; nothing where its specification is damaged so that it cannot be read.
pub(super) fn method(kind: Kind) -> &'static str {
    kind.either("case when json_valid(spec) then method end", "method")
}

/// The grade of a result's verdict; nothing where the result is damaged so that it cannot be read.
pub(super) fn trust(kind: Kind) -> &'static str {
    kind.either("case when json_valid(outcome) then trust end", "trust")
}

/// The note of a job; nothing where its specification has none, or is damaged so that it cannot be read.
pub(super) fn note(kind: Kind) -> &'static str {
    kind.either(
        "case when instr(spec, '\"note\"') > 0 and json_valid(spec) then json_extract(spec, '$.note') end",
        "case when strpos(spec, '\"note\"') > 0 then spec::json ->> 'note' end",
    )
}

fn push_search(query: &mut QueryBuilder, kind: Kind, text: &str) {
    // Both take a letter for its capital.
    let like = kind.either("like", "ilike");
    let escaped = text
        .replace('\\', "\\\\")
        .replace('%', "\\%")
        .replace('_', "\\_");
    let pattern = format!("%{escaped}%");
    query.push(" and (");
    for (place, column) in ["name", "id", "model", "labels", note(kind)]
        .into_iter()
        .enumerate()
    {
        let or = if place == 0 { "" } else { " or " };
        query
            .push(format_args!("{or}{column} {like} "))
            .push_bind(pattern.clone())
            .push(" escape '\\'");
    }
    query
        .push(
            " or id in (select job from job_datasets join datasets on datasets.id = dataset where ",
        )
        .push(format_args!("datasets.name {like} "))
        .push_bind(pattern)
        .push(" escape '\\'))");
}

pub(super) async fn delete(tx: &mut Tx, id: JobId) -> Result<JobRemoval, StoreError> {
    let status = match fetch(&mut *tx, id).await {
        Ok(None) => return Ok(JobRemoval::NotFound),
        Ok(Some(row)) => row.status,
        Err(error) if error.corrupt_row().is_some() => match status(tx, id).await? {
            Status::Running => Status::Running,
            // A damaged job can neither go on nor be cancelled.
            _ => Status::Failed,
        },
        Err(error) => return Err(error),
    };
    if !status.is_terminal() {
        return Ok(JobRemoval::Unfinished(status));
    }
    database::query("delete from jobs where id = $1")
        .bind(id.to_string())
        .execute(&mut **tx)
        .await?;
    tx.announce(super::Change::Job(id));
    Ok(JobRemoval::Removed)
}

/// The state of a job that is there.
pub(super) async fn status(tx: &mut Tx, id: JobId) -> Result<Status, StoreError> {
    let key = id.to_string();
    let word: String = database::query_scalar("select status from jobs where id = $1")
        .bind(&key)
        .fetch_one(&mut **tx)
        .await?;
    parse_status(&key, &word)
}

pub(super) async fn fetch(
    connection: &mut Connection,
    id: JobId,
) -> Result<Option<JobRow>, StoreError> {
    let stored = fetch_stored(connection, id).await?;
    stored.as_ref().map(read).transpose()
}

async fn fetch_stored(connection: &mut Connection, id: JobId) -> Result<Option<Row>, StoreError> {
    let mut query = QueryBuilder::new("select ");
    query
        .push(COLUMNS)
        .push(" from jobs where id = ")
        .push_bind(id.to_string());
    Ok(query.build().fetch_optional(connection).await?)
}

pub(super) fn read(row: &Row) -> Result<JobRow, StoreError> {
    JOBS.verify(row)?;
    JOB_STATES.verify(row)?;
    let id: String = row.try_get("id")?;
    let status: String = row.try_get("status")?;
    let request: Option<String> = row.try_get("request")?;
    Ok(JobRow {
        name: row.try_get("name")?,
        labels: from_json("labels", &id, row.try_get("labels")?)?,
        model: row.try_get("model")?,
        task: JobTask::read(row.try_get("spec")?)
            .map_err(|why| corrupt("specification", &id, why))?,
        status: parse_status(&id, &status)?,
        stop_request: request
            .map(|word| StopRequest::read(&word, &id))
            .transpose()?,
        progress: optional(row, "progress", &id)?,
        attempt: unsigned("attempt", &id, row.try_get("attempt")?)?,
        error: optional(row, "error", &id)?,
        created_at: time(&id, row.try_get("created_at")?)?,
        started_at: optional_time(&id, row.try_get("started_at")?)?,
        finished_at: optional_time(&id, row.try_get("finished_at")?)?,
        last_event: row.try_get("last_event")?,
        revision: row.try_get("revision")?,
        project: project(&id, row.try_get("project")?)?,
        id: parse_id(&id)?,
    })
}
