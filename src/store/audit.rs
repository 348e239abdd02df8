//! Who changed what, and who was refused: rows that are added and never change.

use jiff::Timestamp;
use sqlx::FromRow;

use super::database::{self, QueryBuilder};
use super::jobs::{Page, project, time};
use super::{Store, StoreError};
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
    /// Refusals before this one that were too many to be written down singly.
    pub left_out: u64,
}

/// An entry as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AuditRow {
    /// Its number; later entries have larger ones.
    pub id: i64,
    /// When it was written.
    pub at: Timestamp,
    /// What was asked, and by whom.
    pub entry: AuditEntry,
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
}

impl Columns {
    fn read(self) -> Result<AuditRow, StoreError> {
        let of = format!("audit entry {}", self.id);
        Ok(AuditRow {
            id: self.id,
            at: time(&of, &self.at)?,
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

impl Store {
    /// Adds an entry to the log. The answer means that it is on disk.
    pub async fn audit(&self, entry: AuditEntry) -> Result<(), StoreError> {
        self.inner
            .writer
            .write(move |tx| {
                Box::pin(async move {
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
            })
            .await
    }

    /// Entries of a project, newest first, before the one of a number; with `strangers` those of
    /// callers that are not known too.
    pub async fn audit_log(
        &self,
        project: &Project,
        strangers: bool,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Page<AuditRow, i64>, StoreError> {
        let mut query = QueryBuilder::new(
            "select id, at, who, project, address, method, path, status, request_id, left_out \
             from audit where (project = ",
        );
        query.push_bind(project.as_str());
        if strangers {
            query.push(" or project is null");
        }
        query.push(")");
        if let Some(before) = before {
            query.push(" and id < ").push_bind(before);
        }
        query
            .push(" order by id desc limit ")
            .push_bind(i64::from(limit) + 1);
        let rows: Vec<Columns> = query.build_query_as().fetch_all(self.readers()).await?;
        let rows = rows.into_iter().map(Columns::read);
        let rows = rows.collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.id))
    }
}
