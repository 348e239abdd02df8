//! The queue entries of jobs, kept by River in the same database.
//!
//! A job that is not ended or paused has one entry that may begin its slices; `jobs.queue_entry`
//! says which. The others are stale and do nothing. Who hands a job on, and who takes it over from a dead
//! node, makes a new entry in the same transaction: River ends an entry without looking at who works it,
//! so that a node which had stood still would end that of another.

use std::sync::Arc;

use std::collections::BTreeSet;
use std::time::Duration;

use riverqueue::{Client, ClientBuilder, InsertOpts, JobArgs};
use serde::{Deserialize, Serialize};

use super::columns;
use super::database::{self, Kind, Pool, QueryBuilder, Transaction};
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, corrupt};
use crate::access::Project;
use greybox::identification::JobId;

/// The queue that slices of jobs wait in: this one those of the project `default`, one of its own
/// those of each other project, so that no project has to wait for the queue of another.
pub const QUEUE: &str = "jobs";
/// What stands between that and the name of another project.
const SEPARATOR: char = '|';
/// What entries of all these queues are.
const KIND: &str = "slice";

/// What the queue knows a node by, before the number of its life.
const CLIENT_NAME: &str = "greybox-";

/// A slice may be tried as often as it takes; how often is too often is the job's affair
/// (its `attempt`), not the entry's.
const ENTRY_ATTEMPTS: i32 = i32::MAX;

/// Entries of jobs whose node was cut off come first in a queue: these jobs had their places.
const CUT_OFF: i16 = 1;
/// All other entries come in the order in which they were made.
const USUAL: i16 = 2;

/// How often River may write that there are new entries. Nobody reads it: a commit itself tells of
/// them.
const NOTIFY_COOLDOWN: Duration = Duration::from_hours(24);

/// The entry of a job in the queue: "work a slice of this job".
#[derive(Clone, Debug, Serialize, Deserialize, JobArgs)]
#[river(kind = "slice")]
pub struct SliceOfJob {
    /// Which job.
    pub job: JobId,
}

/// The queue that slices of a project's jobs wait in.
#[must_use]
pub fn queue_of(project: &Project) -> String {
    if *project == Project::default() {
        QUEUE.to_owned()
    } else {
        format!("{QUEUE}{SEPARATOR}{project}")
    }
}

/// The project whose slices wait in a queue.
#[must_use]
pub fn project_of(queue: &str) -> Project {
    let name = queue.split_once(SEPARATOR).map(|(_, name)| name.parse());
    name.and_then(Result::ok).unwrap_or_default()
}

/// How the queue knows the node of a life.
pub(super) fn client_name(life: i64) -> String {
    format!("{CLIENT_NAME}{life}")
}

/// Whether the node that works an entry of the queue lives, in SQL.
fn worker_lives(kind: Kind) -> String {
    let worker = kind.either(
        "json_extract(river_job.attempted_by, '$[#-1]')",
        "river_job.attempted_by[array_upper(river_job.attempted_by, 1)]",
    );
    format!(
        "exists (select 1 from nodes where nodes.state = 'live' \
         and '{CLIENT_NAME}' || nodes.life = {worker})"
    )
}

/// Whether an entry of the queue is one that may begin slices of its job, in SQL.
pub(super) fn is_entry_of_its_job(kind: Kind) -> String {
    let job = kind.either(
        "case when json_valid(river_job.args, 8) then river_job.args ->> '$.job' end",
        "river_job.args ->> 'job'",
    );
    format!(
        "river_job.kind = '{KIND}' and coalesce({job}, '') = jobs.id and river_job.queue = \
         case jobs.project when 'default' then '{QUEUE}' else '{QUEUE}{SEPARATOR}' || jobs.project end"
    )
}

/// What a client is made with.
pub(super) fn builder(pool: &Pool) -> ClientBuilder {
    match pool {
        Pool::Sqlite(pool) => Client::builder(pool.clone()),
        Pool::Postgres(pool, _) => Client::builder(pool.clone()),
    }
}

/// A client that only inserts.
pub(super) fn inserter(pool: &Pool) -> Result<Client, StoreError> {
    Ok(builder(pool).fetch_cooldown(NOTIFY_COOLDOWN).build()?)
}

/// Adds an entry for a job in the caller's transaction and returns the entry's id.
async fn enqueue(
    tx: &mut Tx,
    job: JobId,
    project: &Project,
    priority: i16,
) -> Result<i64, StoreError> {
    let queue = tx.queue.clone();
    let options = options(project).with_priority(priority);
    let insert = queue.insert(SliceOfJob { job }).opts(options);
    let inserted = match tx.transaction() {
        Transaction::Sqlite(transaction) => insert.tx(transaction).await,
        Transaction::Postgres(transaction) => insert.tx(transaction).await,
    };
    tx.announce(Change::SliceWaits(project.clone()));
    Ok(inserted.map_err(not_inserted)?.id())
}

/// Adds an entry for each of many jobs; the ids come in the order of the jobs.
pub(super) async fn enqueue_all(
    tx: &mut Tx,
    jobs: &[(JobId, Project)],
) -> Result<Vec<i64>, StoreError> {
    if jobs.is_empty() {
        return Ok(Vec::new());
    }
    let entries = jobs.iter();
    let entries = entries.map(|(job, project)| (SliceOfJob { job: *job }, options(project)));
    let queue = tx.queue.clone();
    let insert = queue.insert_many(entries);
    let inserted = match tx.transaction() {
        Transaction::Sqlite(transaction) => insert.tx(transaction).await,
        Transaction::Postgres(transaction) => insert.tx(transaction).await,
    };
    let projects: BTreeSet<&Project> = jobs.iter().map(|(_, project)| project).collect();
    for project in projects {
        tx.announce(Change::SliceWaits(project.clone()));
    }
    let entries = inserted.map_err(not_inserted)?;
    Ok(entries.iter().map(|entry| entry.id()).collect())
}

/// Why an entry cannot be added. The database numbers entries, so that one with the next number was changed.
fn not_inserted(error: riverqueue::Error) -> StoreError {
    match &error {
        riverqueue::Error::Database(why)
            if why
                .as_database_error()
                .is_some_and(|why| why.is_unique_violation()) =>
        {
            corrupt("entry of the queue", "the next number", why)
        }
        _ => error.into(),
    }
}

fn options(project: &Project) -> InsertOpts {
    InsertOpts::default()
        .with_queue(queue_of(project))
        .with_max_attempts(ENTRY_ATTEMPTS)
        .with_priority(USUAL)
}

/// The queue in which slices of jobs wait.
#[derive(Clone)]
pub struct SliceQueue {
    pub(super) database: Arc<Database>,
}

impl SliceQueue {
    /// What makes a client of the queue, on the connections of the writer.
    pub fn client(&self) -> ClientBuilder {
        builder(&self.database.writer_pool).id(client_name(self.database.life))
    }

    /// The projects that have unfinished jobs.
    pub async fn projects_at_work(&self) -> Result<Vec<Project>, StoreError> {
        let names: Vec<String> = database::query_scalar(
            "select distinct project from jobs where status in ('queued', 'running')",
        )
        .fetch_all(&self.database.readers)
        .await?;
        let names = names.iter();
        names.map(|name| columns::project("a job", name)).collect()
    }

    /// Lets entries go on that wait for a time which the queue never asks anyone to wait for: the
    /// clock has been set back since they were made.
    pub async fn free_entries_of_the_future(&self) -> Result<(), StoreError> {
        let mut query = QueryBuilder::new("select exists (select 1 from river_job where kind = ");
        query
            .push_bind(KIND)
            .push(" and state in ('available', 'scheduled', 'retryable') and scheduled_at > ")
            .push(in_three_seconds(self.database.readers.kind()))
            .push(")");
        let waits: bool = query
            .build_query_scalar()
            .fetch_one(&self.database.readers)
            .await?;
        if waits {
            in_transaction!(self.database, |tx| free_entries(tx)).await?;
        }
        Ok(())
    }

    /// Lets all entries wait for a time, as they do when the clock is set back by as much.
    #[cfg(test)]
    pub(crate) async fn postpone_entries(&self, by: &'static str) -> Result<(), StoreError> {
        let postpone = async move |tx: &mut Tx| {
            database::query(tx.kind().either(
                "update river_job set scheduled_at = datetime(scheduled_at, 'subsec', $1) \
                 where state <> 'running'",
                "update river_job set scheduled_at = scheduled_at + cast($1::text as interval) \
                 where state <> 'running'",
            ))
            .bind(by)
            .execute(&mut **tx)
            .await?;
            Ok(())
        };
        in_transaction!(self.database, |tx| async move { postpone(tx).await }).await
    }

    /// Gives an entry that was taken and not worked back to the queue.
    pub async fn give_back(&self, job: JobId, entry: i64) -> Result<(), StoreError> {
        in_transaction!(self.database, |tx| give_back(tx, job, entry)).await
    }

    /// Makes what dead servers left ready to go on: any unfinished job that has no entry which waits
    /// or is worked by a node that lives.
    pub(super) async fn recover(&self) -> Result<(), StoreError> {
        in_transaction!(self.database, |tx| recover(tx)).await
    }
}

/// The time of the database as the queue writes it.
fn now(kind: Kind) -> &'static str {
    kind.either("datetime('now', 'subsec')", "now()")
}

/// Longer than the queue ever asks anyone to wait.
fn in_three_seconds(kind: Kind) -> &'static str {
    kind.either(
        "datetime('now', 'subsec', '+3 seconds')",
        "now() + interval '3 seconds'",
    )
}

/// Makes entries available now: those that the conditions say which are pushed next.
fn freeing(kind: Kind) -> QueryBuilder {
    let mut query = QueryBuilder::new("update river_job set state = 'available', scheduled_at = ");
    query.push(now(kind)).push(" where kind = ").push_bind(KIND);
    query.push(" and ");
    query
}

async fn free_entries(tx: &mut Tx) -> Result<(), StoreError> {
    let mut freeing = freeing(tx.kind());
    freeing
        .push("state in ('available', 'scheduled', 'retryable') and scheduled_at > ")
        .push(in_three_seconds(tx.kind()));
    let freed = freeing.build().execute(&mut **tx).await?;
    tracing::warn!(
        slices = freed,
        "the clock was set back; slices no longer wait for it"
    );
    tx.announce(Change::SliceWaits(Project::default()));
    Ok(())
}

async fn recover(tx: &mut Tx) -> Result<(), StoreError> {
    let mut freeing = freeing(tx.kind());
    freeing
        .push("(state = 'retryable' or (state in ('available', 'scheduled') ")
        .push("and scheduled_at > ")
        .push(now(tx.kind()))
        .push("))");
    let freed = freeing.build().execute(&mut **tx).await?;
    if tx.kind() == Kind::Sqlite {
        forget_what_nobody_works(tx).await?;
    }
    let jobs = reassign(tx).await?;
    if freed > 0 || jobs > 0 {
        tracing::info!(
            slices = freed,
            jobs,
            "took over the jobs of the server before"
        );
    }
    Ok(())
}

/// Brings what the queue of a file has for itself to what it has at the first start: a byte of it that changed would
/// keep entries from being taken.
async fn forget_what_nobody_works(tx: &mut Tx) -> Result<(), StoreError> {
    for statement in [
        "delete from river_leader",
        "delete from river_queue",
        "delete from river_notification",
        "delete from river_job where id not in \
         (select queue_entry from jobs where status in ('queued', 'running'))",
        "update river_job set metadata = jsonb('{}'), tags = jsonb('[]'), errors = null, unique_key = null, \
         unique_states = null, created_at = datetime('now', 'subsec'), scheduled_at = datetime('now', 'subsec'), \
         attempted_at = null, attempted_by = jsonb('[]'), attempt = 0, max_attempts = 2147483647, \
         priority = case priority when 1 then 1 else 2 end",
    ] {
        database::query(statement).execute(&mut **tx).await?;
    }
    Ok(())
}

/// Makes a new entry for each unfinished job that has none which waits or is worked by a node that
/// lives. Answers how many.
pub(super) async fn reassign(tx: &mut Tx) -> Result<usize, StoreError> {
    let mut stranded = QueryBuilder::new(
        "select id, project, queue_entry from jobs where status in ('queued', 'running') \
         and not exists (select 1 from river_job where river_job.id = jobs.queue_entry and ",
    );
    stranded
        .push(is_entry_of_its_job(tx.kind()))
        .push(" and (river_job.state in ('available', 'pending', 'scheduled', 'retryable') ")
        .push("or (river_job.state = 'running' and ")
        .push(worker_lives(tx.kind()))
        .push(")))");
    let stranded: Vec<(String, String, i64)> =
        stranded.build_query_as().fetch_all(&mut **tx).await?;
    for (id, project, left) in &stranded {
        database::query(tx.kind().either(
            "update river_job set state = 'completed', finalized_at = datetime('now', 'subsec') \
             where id = $1 and state = 'running'",
            "update river_job set state = 'completed', finalized_at = now() \
             where id = $1 and state = 'running'",
        ))
        .bind(*left)
        .execute(&mut **tx)
        .await?;
        let job = columns::parse_id(id)?;
        let project = columns::project(id, project)?;
        renew_as(tx, job, &project, CUT_OFF).await?;
    }
    Ok(stranded.len())
}

async fn give_back(tx: &mut Tx, job: JobId, entry: i64) -> Result<(), StoreError> {
    let id = job.to_string();
    let project: Option<String> = database::query_scalar(
        "select project from jobs where id = $1 and queue_entry = $2 \
         and status in ('queued', 'running')",
    )
    .bind(&id)
    .bind(entry)
    .fetch_optional(&mut **tx)
    .await?;
    match project {
        Some(project) => renew(tx, job, &columns::project(&id, &project)?).await,
        None => Ok(()),
    }
}

/// Gives a job a new entry, which is the one that may begin its slices from now on.
pub(super) async fn renew(tx: &mut Tx, job: JobId, project: &Project) -> Result<(), StoreError> {
    renew_as(tx, job, project, USUAL).await
}

async fn renew_as(
    tx: &mut Tx,
    job: JobId,
    project: &Project,
    priority: i16,
) -> Result<(), StoreError> {
    let entry = enqueue(tx, job, project, priority).await?;
    database::query("update jobs set queue_entry = $1 where id = $2")
        .bind(entry)
        .bind(job.to_string())
        .execute(&mut **tx)
        .await?;
    Ok(())
}

/// Whether a slice of any job waits in the queue.
pub(super) async fn is_waited_for(tx: &mut Tx) -> Result<bool, StoreError> {
    let mut waits = QueryBuilder::new(
        "select exists (select 1 from river_job where state = 'available' and scheduled_at <= ",
    );
    waits.push(now(tx.kind())).push(")");
    Ok(waits.build_query_scalar().fetch_one(&mut **tx).await?)
}

/// Lets another node do what the queue has one do for all, where a node did so.
pub(super) async fn let_go_of_leadership(tx: &mut Tx, client: &str) -> Result<(), StoreError> {
    database::query("delete from river_leader where leader_id = $1")
        .bind(client)
        .execute(&mut **tx)
        .await?;
    Ok(())
}
