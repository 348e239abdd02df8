//! Sources: what collectors beside historians say of what they read.

use std::sync::Arc;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use sqlx::FromRow;
use utoipa::ToSchema;

use super::columns::{from_json, json, time};
use super::database::{self, Row};
use super::sealed::SOURCES;
use super::shared_database::Database;
use super::writer::{Tx, in_transaction};
use super::{StoreError, named_rows};
use crate::access::Project;

/// Sources that a project can have.
pub const MAX_SOURCES: i64 = 200;

/// What a collector says of a source.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(example = json!({"kind": "postgresql", "every_s": 60.0, "away": null, "series": [
    {"series": "process.press", "stream": "press-4", "reached": "2026-03-02T08:15:00Z", "fault": null}
]}))]
pub struct SourceState {
    /// The kind of the source, such as `postgresql`.
    #[schema(example = "postgresql")]
    pub kind: String,
    /// How often the source is asked `[s]`.
    #[schema(example = 60.0)]
    pub every_s: f64,
    /// Why the source or the server was away in the last pass; `null` where neither was.
    pub away: Option<String>,
    /// The series that are read.
    pub series: Vec<SeriesState>,
}

/// What a collector says of a series of a source.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct SeriesState {
    /// How the source calls the series: a tag, a measurement, a table.
    #[schema(example = "process.press")]
    pub series: String,
    /// The stream to which its samples go.
    #[schema(example = "press-4")]
    pub stream: String,
    /// The samples up to this instant are in the stream; `null` before the first are.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub reached: Option<Timestamp>,
    /// Why the last pass ended early; `null` where it came to its end.
    pub fault: Option<String>,
}

/// A source as it was last heard of.
#[derive(Clone, Debug, PartialEq)]
pub struct SourceRow {
    /// The name of the source.
    pub name: String,
    /// What the collector said last.
    pub state: SourceState,
    /// When the source was first heard of.
    pub first_heard_at: Timestamp,
    /// When the source was last heard of.
    pub heard_at: Timestamp,
}

#[derive(FromRow)]
struct SourceColumns {
    name: String,
    state: String,
    first_heard_at: String,
    heard_at: String,
}

fn read(row: &Row) -> Result<SourceRow, StoreError> {
    SOURCES.verify(row)?;
    let row: SourceColumns = row.read()?;
    let of = &row.name;
    Ok(SourceRow {
        state: from_json("state", of, &row.state)?,
        first_heard_at: time(of, &row.first_heard_at)?,
        heard_at: time(of, &row.heard_at)?,
        name: row.name,
    })
}

/// Sources by name.
#[derive(Clone)]
pub struct Sources {
    pub(super) database: Arc<Database>,
}

impl Sources {
    /// Notes what a collector says of a source. Says whether there is room for the source.
    pub async fn put(
        &self,
        project: &Project,
        name: &str,
        state: SourceState,
    ) -> Result<bool, StoreError> {
        let (project, name) = (project.clone(), name.to_owned());
        in_transaction!(self.database, |tx| put(tx, project, name, state)).await
    }

    /// The sources of a project by name.
    pub async fn list(&self, project: &Project) -> Result<Vec<SourceRow>, StoreError> {
        let rows = named_rows::all(&self.database, &SOURCES, project).await?;
        rows.iter().map(read).collect()
    }

    /// A source of a project.
    pub async fn find(
        &self,
        project: &Project,
        name: &str,
    ) -> Result<Option<SourceRow>, StoreError> {
        let row = named_rows::find(&self.database, &SOURCES, project, name).await?;
        row.as_ref().map(read).transpose()
    }

    /// Forgets a source until it is heard of again. Says whether there was one.
    pub async fn delete(&self, project: &Project, name: &str) -> Result<bool, StoreError> {
        named_rows::delete(&self.database, &SOURCES, project, name).await
    }
}

async fn put(
    tx: &mut Tx,
    project: Project,
    name: String,
    state: SourceState,
) -> Result<bool, StoreError> {
    let sources: i64 =
        database::query_scalar("select count(*) from sources where project = $1 and name <> $2")
            .bind(project.as_str())
            .bind(&name)
            .fetch_one(&mut **tx)
            .await?;
    if sources >= MAX_SOURCES {
        return Ok(false);
    }
    let now = Timestamp::now().to_string();
    database::query(
        "insert into sources (project, name, state, first_heard_at, heard_at) \
         values ($1, $2, $3, $4, $5) on conflict (project, name) \
         do update set state = excluded.state, heard_at = excluded.heard_at",
    )
    .bind(project.as_str())
    .bind(&name)
    .bind(json(&state))
    .bind(&now)
    .bind(&now)
    .execute(&mut **tx)
    .await?;
    Ok(true)
}
