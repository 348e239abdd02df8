//! Comparisons: many jobs that come to be together, in one transaction, or not at all.

use std::sync::Arc;

use jiff::Timestamp;

use super::columns::{self, time};
use super::database::{self, Connection, QueryBuilder};
use super::idempotency::{self, Idempotency};
use super::jobs::{self, JobRow};
use super::models::{self, ModelStored, NewModel};
use super::page::Page;
use super::quota_checks::JobRoom;
use super::sealed::{COMPARISON_JOBS, COMPARISONS};
use super::shared_database::Database;
use super::submit::batch::{self, Known};
use super::submit::{self, Idempotent, NewJob, Submitted};
use super::writer::{Tx, in_transaction};
use super::{StoreError, corrupt};
use crate::access::Project;
use crate::job::ComparisonId;
use greybox::identification::JobId;

/// A comparison to be stored.
#[derive(Clone, Debug)]
pub struct NewComparison {
    /// The identifier of the comparison.
    pub id: ComparisonId,
    /// The project that the comparison belongs to.
    pub project: Project,
    /// The runs, in order. No run has an idempotency key of its own.
    pub jobs: Vec<NewJob>,
    /// The model of all runs, where the request brings a new model.
    pub model: Option<NewModel>,
    /// Makes the submission safe to repeat.
    pub idempotency: Option<Idempotency>,
}

/// A comparison with its runs.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparisonRow {
    /// The identifier of the comparison.
    pub id: ComparisonId,
    /// When the comparison was accepted.
    pub created_at: Timestamp,
    /// The runs, in the order in which they were asked for; deleted runs are missing.
    pub jobs: Vec<JobRow>,
}

/// A comparison as it is listed.
#[derive(Clone, Debug, PartialEq)]
pub struct ComparisonSummary {
    /// The identifier of the comparison.
    pub id: ComparisonId,
    /// When the comparison was accepted.
    pub created_at: Timestamp,
    /// How many runs the comparison has.
    pub runs: u64,
    /// How many runs have ended.
    pub ended: u64,
}

/// Comparisons of jobs.
#[derive(Clone)]
pub struct Comparisons {
    pub(super) database: Arc<Database>,
}

impl Comparisons {
    /// Stores a comparison with its jobs: all of them or none. The answer means that they are on
    /// disk.
    pub async fn submit(&self, new: NewComparison) -> Result<Submitted<ComparisonRow>, StoreError> {
        in_transaction!(self.database, |tx| write(tx, new)).await
    }

    /// What became of the comparison that came with this key before, if one did.
    pub async fn earlier(
        &self,
        idempotency: &Idempotency,
    ) -> Result<Option<Submitted<ComparisonRow>>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        submit::earlier(&mut connection, idempotency).await
    }

    /// Whose a comparison is, if there is one.
    pub async fn project_of(&self, id: ComparisonId) -> Result<Option<Project>, StoreError> {
        let key = id.to_string();
        let name: Option<String> =
            database::query_scalar("select project from comparisons where id = $1")
                .bind(&key)
                .fetch_optional(&self.database.readers)
                .await?;
        name.map(|name| columns::project(&key, &name)).transpose()
    }

    /// A comparison that has runs, if there is one.
    pub async fn find(&self, id: ComparisonId) -> Result<Option<ComparisonRow>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        ComparisonRow::fetch(&mut connection, id).await
    }

    /// Comparisons of a project, newest first, older than `before`.
    pub async fn list(
        &self,
        project: &Project,
        before: Option<ComparisonId>,
        limit: u32,
    ) -> Result<Page<ComparisonSummary, ComparisonId>, StoreError> {
        let mut query = QueryBuilder::new(
            "select comparisons.id, comparisons.created_at, count(*), \
             count(*) filter (where finished_at is not null) from comparisons \
             join comparison_jobs on comparison = comparisons.id join jobs on jobs.id = job \
             where comparisons.project = ",
        );
        query.push_bind(project.as_str());
        if let Some(before) = before {
            query
                .push(" and comparisons.id < ")
                .push_bind(before.to_string());
        }
        query
            .push(" group by comparisons.id order by comparisons.id desc limit ")
            .push_bind(i64::from(limit) + 1);
        let rows: Vec<(String, String, i64, i64)> = query
            .build_query_as()
            .fetch_all(&self.database.readers)
            .await?;
        let summary = |(id, created_at, runs, ended): (String, String, i64, i64)| {
            Ok(ComparisonSummary {
                created_at: time(&id, &created_at)?,
                id: id.parse().map_err(|why| corrupt("identifier", &id, why))?,
                runs: runs.unsigned_abs(),
                ended: ended.unsigned_abs(),
            })
        };
        let rows = rows
            .into_iter()
            .map(summary)
            .collect::<Result<Vec<_>, StoreError>>()?;
        Ok(Page::cut(rows, limit, |row| row.id))
    }
}

async fn write(tx: &mut Tx, new: NewComparison) -> Result<Submitted<ComparisonRow>, StoreError> {
    if let Some(idempotency) = &new.idempotency
        && let Some(earlier) = submit::earlier(tx, idempotency).await?
    {
        return Ok(earlier);
    }
    if let Some(model) = new.model {
        let (ModelStored::Created(_) | ModelStored::There(_)) = models::insert(tx, model).await?;
    }
    let known = Known::look_up(tx, &new.jobs).await?;
    if let Some(missing) = new.jobs.iter().find_map(|job| known.missing(job)) {
        return Ok(missing);
    }
    let mut room = JobRoom::default();
    if let Err(exceeded) = room.take(tx, &new.project, new.jobs.len() as u64).await? {
        return Err(exceeded.into());
    }
    let jobs = batch::store(tx, new.jobs).await?;
    let created_at = Timestamp::now();
    let id = new.id.to_string();
    database::query("insert into comparisons (id, project, created_at) values ($1, $2, $3)")
        .bind(&id)
        .bind(new.project.as_str())
        .bind(created_at.to_string())
        .execute(&mut **tx)
        .await?;
    for (position, job) in (0_i64..).zip(&jobs) {
        database::query(
            "insert into comparison_jobs (comparison, position, job) values ($1, $2, $3)",
        )
        .bind(&id)
        .bind(position)
        .bind(job.id.to_string())
        .execute(&mut **tx)
        .await?;
    }
    if let Some(idempotency) = &new.idempotency {
        idempotency::remember(tx, idempotency, &id).await?;
    }
    Ok(Submitted::Created(ComparisonRow {
        id: new.id,
        created_at,
        jobs,
    }))
}

impl Idempotent for ComparisonRow {
    type Id = ComparisonId;
    const PREFIX: &'static str = ComparisonId::PREFIX;

    async fn fetch(
        connection: &mut Connection,
        id: ComparisonId,
    ) -> Result<Option<Self>, StoreError> {
        let key = id.to_string();
        let mut select = COMPARISONS.select();
        select.push("comparisons where id = ").push_bind(&key);
        let Some(comparison) = select.build().fetch_optional(&mut *connection).await? else {
            return Ok(None);
        };
        COMPARISONS.verify(&comparison)?;
        let mut select = COMPARISON_JOBS.select();
        select
            .push("comparison_jobs where comparison = ")
            .push_bind(&key);
        select.push(" order by position");
        let runs = select.build().fetch_all(&mut *connection).await?;
        let ids = runs.iter().map(|run| {
            COMPARISON_JOBS.verify(run)?;
            columns::parse_id(run.try_get("job")?)
        });
        let ids = ids.collect::<Result<Vec<JobId>, StoreError>>()?;
        let mut rows = Vec::with_capacity(ids.len());
        for id in ids {
            rows.extend(jobs::fetch(connection, id).await?);
        }
        let row = ComparisonRow {
            id,
            created_at: time(&key, comparison.try_get("created_at")?)?,
            jobs: rows,
        };
        Ok((!row.jobs.is_empty()).then_some(row))
    }

    fn into_made(self) -> Self {
        let jobs = self.jobs.into_iter().map(JobRow::into_submitted);
        Self {
            jobs: jobs.collect(),
            ..self
        }
    }
}
