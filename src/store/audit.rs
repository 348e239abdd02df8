//! Who changed what, and who was refused: rows that are added and never change. The oldest go with age, or because
//! there are too many; an entry states the second. A chain of digests shows whether a row was changed.

pub(super) mod chain;

use std::sync::Arc;

use jiff::Timestamp;
use sqlx::FromRow;

use super::StoreError;
use super::columns::{optional_time, project, time};
use super::database::{self, Connection, QueryBuilder};
use super::page::Page;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use crate::access::Project;
use chain::ChainedEntry;

/// What is written down of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditEntry {
    /// Who asked.
    pub who: String,
    /// In which project; nothing of a caller that is not known.
    pub project: Option<Project>,
    /// The address that the request came from.
    pub address: String,
    /// The method.
    pub method: String,
    /// The path, without its query.
    pub path: String,
    /// The status of the answer.
    pub status: u16,
    /// The identifier of the request, as the log has it.
    pub request_id: String,
    /// Requests of the same caller before this one that changed nothing and were too many to be written down
    /// singly; of an entry that states a loss, how many entries were lost.
    pub left_out: u64,
}

/// The time of entries that were let go because the log had too many.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Loss {
    /// When the first of them was written.
    pub from: Timestamp,
    /// When the last of them was written.
    pub to: Timestamp,
}

/// An entry as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditRow {
    /// The number of the entry; later entries have larger numbers.
    pub id: i64,
    /// When the entry was written.
    pub at: Timestamp,
    /// The request and its caller.
    pub entry: AuditEntry,
    /// The loss that the entry states, if any.
    pub loss: Option<Loss>,
    /// The digest of the entry and of the entry before it; nothing of an entry from before there was a chain.
    pub chain: Option<String>,
}

#[derive(FromRow)]
struct AuditColumns {
    id: i64,
    at: String,
    who: String,
    project: Option<String>,
    address: String,
    method: String,
    path: String,
    #[sqlx(try_from = "i64")]
    status: u16,
    request_id: String,
    left_out: i64,
    lost_from: Option<String>,
    lost_to: Option<String>,
    chain: Option<String>,
}

impl AuditColumns {
    fn read(self) -> Result<AuditRow, StoreError> {
        let of = format!("audit entry {}", self.id);
        let lost_from = optional_time(&of, self.lost_from.as_deref())?;
        let lost_to = optional_time(&of, self.lost_to.as_deref())?;
        let loss = lost_from.zip(lost_to).map(|(from, to)| Loss { from, to });
        Ok(AuditRow {
            id: self.id,
            at: time(&of, &self.at)?,
            loss,
            chain: self.chain,
            entry: AuditEntry {
                who: self.who,
                project: self.project.map(|name| project(&of, &name)).transpose()?,
                address: self.address,
                method: self.method,
                path: self.path,
                status: self.status,
                request_id: self.request_id,
                left_out: self.left_out.unsigned_abs(),
            },
        })
    }
}

/// The audit log.
#[derive(Clone)]
pub struct AuditLog {
    pub(super) database: Arc<Database>,
}

impl AuditLog {
    /// Adds an entry to the log. The answer means that it is on disk.
    pub async fn add(&self, entry: AuditEntry) -> Result<(), StoreError> {
        in_transaction!(self.database, |tx| add(tx, entry)).await
    }

    /// Entries of a project, newest first, before the one of a number; with `strangers` those of
    /// callers that are not known too. Losses are of all projects.
    pub async fn list(
        &self,
        project: &Project,
        strangers: bool,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Page<AuditRow, i64>, StoreError> {
        let mut query = QueryBuilder::new(
            "select id, at, who, project, address, method, path, status, request_id, left_out, \
             lost_from, lost_to, chain from audit where (project = ",
        );
        query.push_bind(project.as_str());
        if strangers {
            query.push(" or project is null");
        } else {
            query.push(" or lost_up_to is not null");
        }
        query.push(")");
        if let Some(before) = before {
            query.push(" and id < ").push_bind(before);
        }
        query
            .push(" order by id desc limit ")
            .push_bind(i64::from(limit) + 1);
        let rows: Vec<AuditColumns> = query
            .build_query_as()
            .fetch_all(&self.database.readers)
            .await?;
        let rows = rows.into_iter().map(AuditColumns::read);
        let rows = rows.collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.id))
    }
}

impl AuditEntry {
    /// The entry of a command of the operator, which names the project that it is about, where there is one.
    pub(super) fn of_command(command: String, project: Option<Project>) -> Self {
        Self {
            who: "operator".to_owned(),
            project,
            address: String::new(),
            method: "COMMAND".to_owned(),
            path: command,
            status: 200,
            request_id: String::new(),
            left_out: 0,
        }
    }
}

/// Adds an entry in a transaction in which no other connection writes.
pub(super) async fn add(tx: &mut Connection, entry: AuditEntry) -> Result<(), StoreError> {
    let entry = ChainedEntry {
        at: Timestamp::now().to_string(),
        who: entry.who,
        project: entry.project.map(|project| project.to_string()),
        address: entry.address,
        method: entry.method,
        path: entry.path,
        status: entry.status.into(),
        request_id: entry.request_id,
        left_out: entry.left_out.cast_signed(),
        lost_from: None,
        lost_to: None,
        lost_up_to: None,
    };
    entry.append(tx).await
}

/// Lets some of the oldest entries go that were written before `cutoff`. Says how many went. An entry that is younger
/// by its time keeps the entries after it.
pub(super) async fn forget_before(
    tx: &mut Tx,
    cutoff: &str,
    at_once: i64,
) -> Result<u64, StoreError> {
    let up_to: Option<i64> = database::query_scalar(
        "select max(id) from (select id from audit where id < coalesce( \
         (select id from audit where at >= $1 order by id limit 1), $2) order by id limit $3) as oldest",
    )
    .bind(cutoff)
    .bind(i64::MAX)
    .bind(at_once)
    .fetch_one(&mut **tx)
    .await?;
    match up_to {
        Some(up_to) => chain::forget(tx, up_to).await,
        None => Ok(0),
    }
}

/// The numbers of the first and the last entry; nothing of an empty log.
pub(super) async fn numbers(connection: &mut Connection) -> Result<Option<(i64, i64)>, StoreError> {
    let (first, last): (Option<i64>, Option<i64>) =
        database::query_as("select (select min(id) from audit), (select max(id) from audit)")
            .fetch_one(connection)
            .await?;
    Ok(first.zip(last))
}

/// Lets the oldest entries go where there are more than `most`, some at a time, and states the loss in an entry.
/// Says how many went.
pub(super) async fn shorten(tx: &mut Tx, most: u64, at_once: i64) -> Result<u64, StoreError> {
    let Some((first, last)) = numbers(tx).await? else {
        return Ok(0);
    };
    let most = i64::try_from(most).unwrap_or(i64::MAX);
    let too_many = last - first + 1 - most;
    if too_many <= 0 {
        return Ok(0);
    }
    // Some more go, so that the entry of the loss is not soon too many.
    let going = (too_many + 1 + most / 10).min(at_once);
    let up_to = first + going - 1;
    let loss: StatedLoss = database::query_as(
        "select cast(sum(left_out + case when lost_up_to is null then 1 else 0 end) as bigint) as entries, \
         min(coalesce(lost_from, at)) as lost_from, max(coalesce(lost_to, at)) as lost_to \
         from audit where id <= $1",
    )
    .bind(up_to)
    .fetch_one(&mut **tx)
    .await?;
    loss.entry(up_to).append(tx).await?;
    chain::forget(tx, up_to).await
}

/// Entries that are let go because there are too many.
#[derive(FromRow)]
struct StatedLoss {
    entries: i64,
    lost_from: Option<String>,
    lost_to: Option<String>,
}

impl StatedLoss {
    /// The entry that states the loss of the entries up to a number.
    fn entry(self, up_to: i64) -> ChainedEntry {
        ChainedEntry {
            at: Timestamp::now().to_string(),
            who: "greybox".to_owned(),
            project: None,
            address: String::new(),
            method: "DELETE".to_owned(),
            path: "/v1/audit".to_owned(),
            status: 204,
            request_id: String::new(),
            left_out: self.entries,
            lost_from: self.lost_from,
            lost_to: self.lost_to,
            lost_up_to: Some(up_to),
        }
    }
}
