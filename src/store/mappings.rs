//! Mappings: where the series that collecting agents write go, and which series came that no rule names.
//!
//! What one request writes is one transaction: the samples of all its streams and the list of series are on
//! disk together, or nothing is.

use std::collections::{BTreeMap, HashSet};
use std::sync::Arc;

use jiff::Timestamp;
use sqlx::FromRow;

use super::columns::{from_json, json, time};
use super::database::{self, QueryBuilder, Row};
use super::sealed::{MAPPINGS, UNMAPPED_SERIES};
use super::shared_database::Database;
use super::streams::{self, BatchOutcome, NewBatch};
use super::writer::{Tx, in_transaction};
use super::{StoreError, named_rows};
use crate::access::Project;
use greybox::intake::spread::{LastValue, MAX_UNMAPPED, Mapping, UnmappedSeries};

/// Mappings that a project can have.
pub const MAX_MAPPINGS: i64 = 50;
/// Rows that are written with one statement.
const ROWS_TOGETHER: usize = 100;

/// A mapping as it stands.
#[derive(Clone, Debug, PartialEq)]
pub struct MappingRow {
    /// The database or bucket that agents name.
    pub name: String,
    /// The rules.
    pub mapping: Mapping,
    /// Samples of series that no rule names and that are not listed, because the list is full.
    pub unlisted: u64,
    /// When the mapping was made.
    pub created_at: Timestamp,
    /// When the rules were last changed.
    pub changed_at: Timestamp,
}

/// What became of a mapping that was to be stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MappingPut {
    /// The mapping is new.
    Created,
    /// The rules took the place of others; the list of series begins anew.
    Replaced,
    /// The project has [`MAX_MAPPINGS`] already.
    TooMany,
}

/// What one request of an agent writes.
pub struct NewWrite {
    /// Whose the mapping and the streams are.
    pub project: Project,
    /// The name of the mapping.
    pub mapping: String,
    /// The samples, one batch for each stream.
    pub batches: Vec<NewBatch>,
    /// Series that no rule names.
    pub unmapped: Vec<UnmappedSeries>,
    /// Samples of further series that no rule names.
    pub unlisted: u64,
}

#[derive(FromRow)]
struct MappingColumns {
    name: String,
    rules: String,
    unlisted: i64,
    created_at: String,
    changed_at: String,
}

impl MappingColumns {
    fn read(self) -> Result<MappingRow, StoreError> {
        let of = &self.name;
        Ok(MappingRow {
            mapping: from_json("rules", of, &self.rules)?,
            unlisted: self.unlisted.unsigned_abs(),
            created_at: time(of, &self.created_at)?,
            changed_at: time(of, &self.changed_at)?,
            name: self.name,
        })
    }
}

/// A series as its row names it.
type SeriesName = (String, BTreeMap<String, String>, String);

#[derive(FromRow)]
struct UnmappedColumns {
    series: String,
    samples: i64,
    last_value: String,
    last_ns: i64,
}

impl UnmappedColumns {
    fn read(self) -> Result<UnmappedSeries, StoreError> {
        let of = &self.series;
        let (measurement, tags, field): SeriesName = from_json("series", of, of)?;
        let last_value: LastValue = from_json("last_value", of, &self.last_value)?;
        Ok(UnmappedSeries {
            measurement,
            tags,
            field,
            samples: self.samples.unsigned_abs(),
            last_value,
            last_ns: self.last_ns,
        })
    }
}

/// The text by which a row names a series.
fn series_key(series: &UnmappedSeries) -> String {
    json(&(&series.measurement, &series.tags, &series.field))
}

fn read(row: &Row) -> Result<MappingRow, StoreError> {
    MAPPINGS.verify(row)?;
    row.read::<MappingColumns>()?.read()
}

/// Where the series of agents go.
#[derive(Clone)]
pub struct Mappings {
    pub(super) database: Arc<Database>,
}

impl Mappings {
    /// Stores a mapping, in the place of the one of its name where there is one.
    pub async fn put(
        &self,
        project: &Project,
        name: &str,
        mapping: Mapping,
    ) -> Result<MappingPut, StoreError> {
        let (project, name) = (project.clone(), name.to_owned());
        in_transaction!(self.database, |tx| put(tx, project, name, mapping)).await
    }

    /// The mappings of a project by name.
    pub async fn list(&self, project: &Project) -> Result<Vec<MappingRow>, StoreError> {
        let rows = named_rows::all(&self.database, &MAPPINGS, project).await?;
        rows.iter().map(read).collect()
    }

    /// A mapping of a project.
    pub async fn find(
        &self,
        project: &Project,
        name: &str,
    ) -> Result<Option<MappingRow>, StoreError> {
        let row = named_rows::find(&self.database, &MAPPINGS, project, name).await?;
        row.as_ref().map(read).transpose()
    }

    /// The series that came under a mapping and that no rule names, by measurement, tags and field.
    pub async fn unmapped(
        &self,
        project: &Project,
        name: &str,
    ) -> Result<Vec<UnmappedSeries>, StoreError> {
        let mut query = UNMAPPED_SERIES.select();
        query
            .push("unmapped_series where project = ")
            .push_bind(project.as_str());
        query.push(" and mapping = ").push_bind(name.to_owned());
        query.push(" order by series");
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let series = rows.iter().map(|row| {
            UNMAPPED_SERIES.verify(row)?;
            row.read::<UnmappedColumns>()?.read()
        });
        series.collect()
    }

    /// Removes a mapping with its list of series. Says whether there was one.
    pub async fn delete(&self, project: &Project, name: &str) -> Result<bool, StoreError> {
        named_rows::delete(&self.database, &MAPPINGS, project, name).await
    }

    /// Stores what a request writes. The answer means that it is on disk: what became of each batch, in their
    /// order; nothing where the mapping has gone.
    pub async fn write(&self, new: NewWrite) -> Result<Option<Vec<BatchOutcome>>, StoreError> {
        in_transaction!(self.database, |tx| write(tx, new)).await
    }
}

async fn put(
    tx: &mut Tx,
    project: Project,
    name: String,
    mapping: Mapping,
) -> Result<MappingPut, StoreError> {
    let now = Timestamp::now().to_string();
    let replaced = database::query(
        "update mappings set rules = $1, unlisted = 0, changed_at = $2 \
         where project = $3 and name = $4",
    )
    .bind(json(&mapping))
    .bind(&now)
    .bind(project.as_str())
    .bind(&name)
    .execute(&mut **tx)
    .await?;
    if replaced == 1 {
        database::query("delete from unmapped_series where project = $1 and mapping = $2")
            .bind(project.as_str())
            .bind(&name)
            .execute(&mut **tx)
            .await?;
        return Ok(MappingPut::Replaced);
    }
    let mappings: i64 = database::query_scalar("select count(*) from mappings where project = $1")
        .bind(project.as_str())
        .fetch_one(&mut **tx)
        .await?;
    if mappings >= MAX_MAPPINGS {
        return Ok(MappingPut::TooMany);
    }
    database::query(
        "insert into mappings (project, name, rules, created_at, changed_at) \
         values ($1, $2, $3, $4, $5)",
    )
    .bind(project.as_str())
    .bind(&name)
    .bind(json(&mapping))
    .bind(&now)
    .bind(&now)
    .execute(&mut **tx)
    .await?;
    Ok(MappingPut::Created)
}

async fn write(tx: &mut Tx, new: NewWrite) -> Result<Option<Vec<BatchOutcome>>, StoreError> {
    let NewWrite {
        project,
        mapping,
        batches,
        unmapped,
        unlisted,
    } = new;
    if !is_there(tx, &project, &mapping).await? {
        return Ok(None);
    }
    let mut outcomes = Vec::with_capacity(batches.len());
    for batch in batches {
        outcomes.push(streams::append(tx, batch).await?);
    }
    let unlisted = unlisted + list(tx, &project, &mapping, unmapped).await?;
    if unlisted > 0 {
        database::query(
            "update mappings set unlisted = unlisted + $1 where project = $2 and name = $3",
        )
        .bind(unlisted.cast_signed())
        .bind(project.as_str())
        .bind(&mapping)
        .execute(&mut **tx)
        .await?;
    }
    Ok(Some(outcomes))
}

/// Whether there is a mapping of a name.
pub(super) async fn is_there(
    tx: &mut Tx,
    project: &Project,
    name: &str,
) -> Result<bool, StoreError> {
    let is_there = database::query_scalar(
        "select exists (select 1 from mappings where project = $1 and name = $2)",
    );
    let is_there = is_there.bind(project.as_str()).bind(name);
    Ok(is_there.fetch_one(&mut **tx).await?)
}

/// Lists series under a mapping, [`MAX_UNMAPPED`] at the most. Says how many samples are of others.
async fn list(
    tx: &mut Tx,
    project: &Project,
    mapping: &str,
    unmapped: Vec<UnmappedSeries>,
) -> Result<u64, StoreError> {
    if unmapped.is_empty() {
        return Ok(0);
    }
    let listed: Vec<(String,)> = database::query_as(
        "select series from unmapped_series where project = $1 and mapping = $2",
    )
    .bind(project.as_str())
    .bind(mapping)
    .fetch_all(&mut **tx)
    .await?;
    let mut room = MAX_UNMAPPED.saturating_sub(listed.len());
    let listed: HashSet<String> = listed.into_iter().map(|(series,)| series).collect();
    let mut unlisted = 0;
    let mut rows = Vec::with_capacity(unmapped.len());
    for series in unmapped {
        let key = series_key(&series);
        if listed.contains(&key) {
            rows.push((key, series));
        } else if room > 0 {
            room -= 1;
            rows.push((key, series));
        } else {
            unlisted += series.samples;
        }
    }
    for rows in rows.chunks(ROWS_TOGETHER) {
        let mut query = QueryBuilder::new(
            "insert into unmapped_series (project, mapping, series, samples, last_value, last_ns) ",
        );
        query.push_values(rows, |mut row, (key, series)| {
            row.push_bind(project.as_str());
            row.push_bind(mapping);
            row.push_bind(key.clone());
            row.push_bind(series.samples.cast_signed());
            row.push_bind(json(&series.last_value));
            row.push_bind(series.last_ns);
        });
        query.push(
            " on conflict (project, mapping, series) do update set \
             samples = unmapped_series.samples + excluded.samples, \
             last_value = case when excluded.last_ns >= unmapped_series.last_ns \
             then excluded.last_value else unmapped_series.last_value end, \
             last_ns = case when excluded.last_ns >= unmapped_series.last_ns \
             then excluded.last_ns else unmapped_series.last_ns end",
        );
        query.build().execute(&mut **tx).await?;
    }
    Ok(unlisted)
}
