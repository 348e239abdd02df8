//! What is kept for how long. What goes, goes in small transactions, the oldest first, and the space
//! of it is given back to the disk bit by bit.

use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::columns;
use super::database::{self, Kind, QueryBuilder};
use super::shared_database::Database;
use super::streams::answers;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, audit, datasets, idempotency};
use crate::access::Project;

/// Jobs that go in one transaction.
const JOBS_AT_ONCE: i64 = 10;
/// Rows of a log that go in one transaction.
const ROWS_AT_ONCE: i64 = 1000;
/// The audit log is kept so long at the least: a little longer than the database insists on.
const AUDIT_AT_LEAST: Duration = Duration::from_hours(30 * 24 + 1);
/// Pages of the file that are given back in one transaction.
const PAGES_AT_ONCE: i64 = 2000;

/// For how long things are kept; nothing for ever.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Retention {
    /// Jobs that have ended, with their events, history and result.
    pub jobs: Option<Duration>,
    /// Jobs of each project that have ended, the newest.
    pub most_jobs: Option<u32>,
    /// The candidates of jobs that have ended.
    pub candidates: Option<Duration>,
    /// The audit log, 30 days at the least.
    pub audit: Option<Duration>,
    /// Entries of the audit log, the newest, about.
    pub most_audit: Option<u64>,
    /// Idempotency keys, with the answers to batches.
    pub keys: Option<Duration>,
    /// Deliveries that are over.
    pub deliveries: Option<Duration>,
}

/// What went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tidied {
    /// Jobs.
    pub jobs: u64,
    /// Jobs whose candidates went.
    pub candidates: u64,
    /// Entries of the audit log.
    pub audit: u64,
    /// Deliveries.
    pub deliveries: u64,
    /// Idempotency keys.
    pub keys: u64,
}

impl Tidied {
    /// Whether something went, so that there may be more.
    #[must_use]
    pub fn is_some(self) -> bool {
        self != Self::default()
    }
}

/// Lets some of what is older than it is kept for go, and gives some space back. Says what went.
pub(super) async fn tidy(database: &Database, retention: Retention) -> Result<Tidied, StoreError> {
    let tidied = in_transaction!(database, |tx| remove(tx, retention, Timestamp::now())).await?;
    datasets::remove_abandoned(database).await?;
    in_transaction!(database, |tx| give_space_back(tx)).await?;
    Ok(tidied)
}

async fn remove(tx: &mut Tx, retention: Retention, now: Timestamp) -> Result<Tidied, StoreError> {
    let before = |age: Option<Duration>| {
        let age = SignedDuration::try_from(age?).ok()?;
        Some(now.checked_sub(age).ok()?.to_string())
    };
    let mut tidied = Tidied::default();
    let mut going: Vec<String> = Vec::new();
    if let Some(cutoff) = before(retention.jobs) {
        going = database::query_scalar(
            "select id from jobs where finished_at < $1 order by id limit $2",
        )
        .bind(cutoff)
        .bind(JOBS_AT_ONCE)
        .fetch_all(&mut **tx)
        .await?;
    }
    if let Some(most) = retention.most_jobs {
        going.extend(too_many(tx, most).await?);
    }
    going.sort();
    going.dedup();
    for id in &going {
        database::query("delete from jobs where id = $1")
            .bind(id)
            .execute(&mut **tx)
            .await?;
        tx.announce(Change::Job(columns::parse_id(id)?));
    }
    if !going.is_empty() {
        database::query(
            "delete from comparisons where id not in (select comparison from comparison_jobs)",
        )
        .execute(&mut **tx)
        .await?;
    }
    tidied.jobs = going.len() as u64;
    if let Some(cutoff) = before(retention.candidates) {
        tidied.candidates = forget_candidates(tx, &cutoff).await?;
    }
    let audit_age = retention.audit.map(|age| age.max(AUDIT_AT_LEAST));
    if let Some(cutoff) = before(audit_age) {
        tidied.audit = audit::forget_before(tx, &cutoff, ROWS_AT_ONCE).await?;
    }
    if let Some(most) = retention.most_audit {
        tidied.audit += audit::shorten(tx, most, ROWS_AT_ONCE).await?;
    }
    if let Some(cutoff) = before(retention.keys) {
        let made = idempotency::forget(tx, &cutoff, ROWS_AT_ONCE).await?;
        answers::forget(tx, &made).await?;
        tidied.keys = made.len() as u64;
    }
    if let Some(cutoff) = before(retention.deliveries) {
        let over = "state <> 'waiting' and created_at < ?";
        tidied.deliveries = forget(tx, "deliveries", over, &cutoff).await?;
    }
    Ok(tidied)
}

/// Some of the oldest jobs of each project that has more than it keeps.
async fn too_many(tx: &mut Tx, most: u32) -> Result<Vec<String>, StoreError> {
    let projects: Vec<(String, i64)> = database::query_as(
        "select project, count(*) from jobs where finished_at is not null \
         group by project having count(*) > $1",
    )
    .bind(most)
    .fetch_all(&mut **tx)
    .await?;
    let mut going = Vec::new();
    for (project, finished) in projects {
        let project: Project = columns::project("a job", &project)?;
        let ids: Vec<String> = database::query_scalar(
            "select id from jobs where project = $1 and finished_at is not null order by id limit $2",
        )
        .bind(project.as_str())
        .bind((finished - i64::from(most)).min(JOBS_AT_ONCE))
        .fetch_all(&mut **tx)
        .await?;
        going.extend(ids);
    }
    Ok(going)
}

async fn forget_candidates(tx: &mut Tx, cutoff: &str) -> Result<u64, StoreError> {
    let of: Vec<String> = database::query_scalar(
        "select job from candidate_records join jobs on id = job where finished_at < $1 \
         order by job limit $2",
    )
    .bind(cutoff)
    .bind(JOBS_AT_ONCE)
    .fetch_all(&mut **tx)
    .await?;
    for job in &of {
        for table in ["candidates", "candidate_records"] {
            let mut removal = QueryBuilder::new("delete from ");
            removal.push(table).push(" where job = ").push_bind(job);
            removal.build().execute(&mut **tx).await?;
        }
    }
    Ok(of.len() as u64)
}

/// Removes some rows of a table that are older than `cutoff`, which stands for `?` in `which`.
async fn forget(
    tx: &mut Tx,
    table: &'static str,
    which: &'static str,
    cutoff: &str,
) -> Result<u64, StoreError> {
    let (before, after) = which.split_once('?').unwrap_or((which, ""));
    let mut removal = QueryBuilder::new("delete from ");
    removal.push(table).push(" where id in (select id from ");
    removal.push(table).push(" where ").push(before);
    removal
        .push_bind(cutoff)
        .push(after)
        .push(" order by id limit ");
    removal.push_bind(ROWS_AT_ONCE).push(")");
    let removed = removal.build().execute(&mut **tx).await?;
    Ok(removed)
}

/// Gives pages that hold nothing back to the disk, in a file that was made so that it can.
/// PostgreSQL sees to that itself.
async fn give_space_back(tx: &mut Tx) -> Result<(), StoreError> {
    if tx.kind() == Kind::Postgres {
        return Ok(());
    }
    let mut query = QueryBuilder::new("pragma incremental_vacuum(");
    query.push(PAGES_AT_ONCE).push(")");
    query.build().fetch_all(&mut **tx).await?;
    Ok(())
}
