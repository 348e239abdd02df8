//! Who changed what, and who was refused: rows that are added and never change. The oldest go with age, or because
//! there are too many; an entry states the second.

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
    /// What was asked, and by whom.
    pub entry: AuditEntry,
    /// The loss that the entry states, if any.
    pub loss: Option<Loss>,
}

#[derive(FromRow)]
struct Columns {
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
}

impl Columns {
    fn read(self) -> Result<AuditRow, StoreError> {
        let of = format!("audit entry {}", self.id);
        let lost_from = optional_time(&of, self.lost_from.as_deref())?;
        let lost_to = optional_time(&of, self.lost_to.as_deref())?;
        let loss = lost_from.zip(lost_to).map(|(from, to)| Loss { from, to });
        Ok(AuditRow {
            id: self.id,
            at: time(&of, &self.at)?,
            loss,
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
        in_transaction!(self.database, |tx| async move {
            database::query(
                "insert into audit (at, who, project, address, method, path, status, \
                         request_id, left_out) values ($1, $2, $3, $4, $5, $6, $7, $8, $9)",
            )
            .bind(Timestamp::now().to_string())
            .bind(entry.who)
            .bind(entry.project.as_ref().map(Project::as_str))
            .bind(entry.address)
            .bind(entry.method)
            .bind(entry.path)
            .bind(entry.status)
            .bind(entry.request_id)
            .bind(entry.left_out.cast_signed())
            .execute(&mut **tx)
            .await?;
            Ok(())
        })
        .await
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
             lost_from, lost_to from audit where (project = ",
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
        let rows: Vec<Columns> = query
            .build_query_as()
            .fetch_all(&self.database.readers)
            .await?;
        let rows = rows.into_iter().map(Columns::read);
        let rows = rows.collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.id))
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
    database::query(
        "insert into audit (at, who, address, method, path, status, request_id, left_out, lost_from, lost_to, \
         lost_up_to) \
         select $1, 'greybox', '', 'DELETE', '/v1/audit', 204, '', \
         cast(sum(left_out + case when lost_up_to is null then 1 else 0 end) as bigint), \
         min(coalesce(lost_from, at)), max(coalesce(lost_to, at)), $2 from audit where id <= $2",
    )
    .bind(Timestamp::now().to_string())
    .bind(up_to)
    .execute(&mut **tx)
    .await?;
    let removed = database::query("delete from audit where id <= $1")
        .bind(up_to)
        .execute(&mut **tx)
        .await?;
    Ok(removed)
}
