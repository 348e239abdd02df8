//! Versions of recordings: what people marked as bad in a recording, each with a reason. A version never changes.

use std::collections::{BTreeMap, BTreeSet};

use jiff::Timestamp;
use sqlx::FromRow;

use super::columns::{from_json, json, project, time};
use super::database::{self, QueryBuilder, Row};
use super::datasets::Datasets;
use super::page::Page;
use super::sealed::DATASET_VERSIONS;
use super::writer::{Tx, in_transaction};
use super::{StoreError, corrupt, quota_checks};
use greybox::identification::DatasetId;
use greybox::identification::spec::{MAX_VERSION, NewVersion, RecordingVersions};
use greybox::recording::Mark;

/// A version of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetVersionRow {
    /// Which version, from 1.
    pub number: u32,
    /// Everything that the version marks.
    pub marks: Vec<Mark>,
    /// Who made the version.
    pub made_by: String,
    /// When the version was made.
    pub created_at: Timestamp,
}

/// The outcome of storing a version.
#[derive(Clone, Debug, PartialEq)]
pub enum VersionAdded {
    /// The version is on disk.
    Created(DatasetVersionRow),
    /// The newest version marks the same; nothing where the recording has no version.
    Unchanged(Option<DatasetVersionRow>),
    /// The client changed another version than the newest, whose number this is; nothing is stored.
    NotNewest(u32),
    /// The recording has [`MAX_VERSION`] versions.
    TooMany,
    /// There is no such recording.
    NotFound,
}

#[derive(FromRow)]
struct VersionColumns {
    dataset: String,
    number: i64,
    marks: String,
    made_by: String,
    created_at: String,
}

impl VersionColumns {
    fn read(self) -> Result<DatasetVersionRow, StoreError> {
        let of = &self.dataset;
        Ok(DatasetVersionRow {
            number: u32::try_from(self.number).unwrap_or(u32::MAX),
            marks: from_json("marks", of, &self.marks)?,
            created_at: time(of, &self.created_at)?,
            made_by: self.made_by,
        })
    }
}

/// A statement that reads the versions of a recording, up to a further condition.
fn select(id: DatasetId) -> QueryBuilder {
    let mut select = DATASET_VERSIONS.select();
    select.push("dataset_versions where dataset = ");
    select.push_bind(id.to_string());
    select
}

fn read(row: &Row) -> Result<DatasetVersionRow, StoreError> {
    DATASET_VERSIONS.verify(row)?;
    row.read::<VersionColumns>()?.read()
}

impl Datasets {
    /// Stores a version of a recording, unless the newest version marks the same or is not the one that was changed.
    pub async fn add_version(
        &self,
        id: DatasetId,
        new: NewVersion,
        made_by: String,
    ) -> Result<VersionAdded, StoreError> {
        in_transaction!(self.database, |tx| add(tx, id, new, made_by)).await
    }

    /// Versions of a recording, newest first, older than `before`.
    pub async fn versions(
        &self,
        id: DatasetId,
        before: Option<u32>,
        limit: u32,
    ) -> Result<Page<DatasetVersionRow, u32>, StoreError> {
        let mut query = select(id);
        if let Some(before) = before {
            query.push(" and number < ").push_bind(i64::from(before));
        }
        query.push(" order by number desc limit ");
        query.push_bind(i64::from(limit) + 1);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.number))
    }

    /// One version of a recording.
    pub async fn version(
        &self,
        id: DatasetId,
        number: u32,
    ) -> Result<Option<DatasetVersionRow>, StoreError> {
        let mut query = select(id);
        query.push(" and number = ").push_bind(i64::from(number));
        let row = query.build().fetch_optional(&self.database.readers).await?;
        row.as_ref().map(read).transpose()
    }

    /// The newest version of a recording, and those of the numbers.
    pub async fn versions_named(
        &self,
        id: DatasetId,
        numbers: BTreeSet<u32>,
    ) -> Result<RecordingVersions, StoreError> {
        let mut query = select(id);
        query.push(" and (number = (select max(number) from dataset_versions where dataset = ");
        query.push_bind(id.to_string()).push(")");
        for number in numbers {
            query.push(" or number = ").push_bind(i64::from(number));
        }
        query.push(")");
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let marks: BTreeMap<u32, Vec<Mark>> = rows
            .into_iter()
            .map(|row| (row.number, row.marks))
            .collect();
        Ok(RecordingVersions {
            newest: marks.keys().next_back().copied().unwrap_or(0),
            marks,
        })
    }

    /// The numbers of the newest versions of those of the recordings that have any.
    pub async fn newest_versions(
        &self,
        ids: &[DatasetId],
    ) -> Result<BTreeMap<DatasetId, u32>, StoreError> {
        if ids.is_empty() {
            return Ok(BTreeMap::new());
        }
        let mut query = QueryBuilder::new(
            "select dataset, max(number) from dataset_versions where dataset in (",
        );
        let mut places = query.separated(", ");
        for id in ids {
            places.push_bind(id.to_string());
        }
        query.push(") group by dataset");
        let rows: Vec<(String, i64)> = query
            .build_query_as()
            .fetch_all(&self.database.readers)
            .await?;
        let newest = rows.into_iter().map(|(dataset, number)| {
            let id = dataset
                .parse()
                .map_err(|why| corrupt("identifier", &dataset, why))?;
            Ok((id, u32::try_from(number).unwrap_or(u32::MAX)))
        });
        newest.collect()
    }
}

async fn add(
    tx: &mut Tx,
    id: DatasetId,
    new: NewVersion,
    made_by: String,
) -> Result<VersionAdded, StoreError> {
    let key = id.to_string();
    let owner: Option<String> =
        database::query_scalar("select project from datasets where id = $1")
            .bind(&key)
            .fetch_optional(&mut **tx)
            .await?;
    let Some(owner) = owner else {
        return Ok(VersionAdded::NotFound);
    };
    let mut newest = select(id);
    newest.push(" order by number desc limit 1");
    let newest = newest.build().fetch_optional(&mut **tx).await?;
    let newest = newest.as_ref().map(read).transpose()?;
    let number = newest.as_ref().map_or(0, |row| row.number);
    if newest.as_ref().map_or(&[][..], |row| &row.marks) == new.marks {
        return Ok(VersionAdded::Unchanged(newest));
    }
    if new.based_on.is_some_and(|based_on| based_on != number) {
        return Ok(VersionAdded::NotNewest(number));
    }
    if number >= MAX_VERSION {
        return Ok(VersionAdded::TooMany);
    }
    let row = DatasetVersionRow {
        number: number + 1,
        marks: new.marks,
        made_by,
        created_at: Timestamp::now(),
    };
    let marks = json(&row.marks);
    let bytes = marks.len() as u64;
    quota_checks::check_bytes(tx, &project(&key, &owner)?, bytes).await?;
    let stored = database::query(
        "insert into dataset_versions (dataset, number, marks, made_by, created_at) \
         values ($1, $2, $3, $4, $5) on conflict (dataset, number) do nothing",
    )
    .bind(&key)
    .bind(i64::from(row.number))
    .bind(marks)
    .bind(row.made_by.clone())
    .bind(row.created_at.to_string())
    .execute(&mut **tx)
    .await?;
    if stored == 0 {
        // Another node stored a version of this number since the transaction began.
        return Ok(VersionAdded::NotNewest(row.number));
    }
    database::query("update datasets set bytes = bytes + $1, state_seal = null where id = $2")
        .bind(i64::try_from(bytes).unwrap_or(i64::MAX))
        .bind(&key)
        .execute(&mut **tx)
        .await?;
    Ok(VersionAdded::Created(row))
}
