//! What people call a job: its name, its labels and its note, which change at any time.

use std::collections::BTreeMap;

use super::columns::json;
use super::jobs::{self, JobRow, Jobs};
use super::sealed::JOBS;
use super::writer::{Tx, in_transaction};
use super::{Change, StoreError, database};
use greybox::identification::JobId;
use greybox::identification::spec::MAX_LABELS;

/// A change of what a job is called. What is left out stays.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JobWords {
    /// The name, or that the name goes.
    pub name: Option<Option<String>>,
    /// The change of the labels.
    pub labels: LabelChange,
    /// The note, or that the note goes.
    pub note: Option<Option<String>>,
}

/// A change of a job's labels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LabelChange {
    /// Labels by their names, each with its new value or `None` for its removal; other labels stay.
    Each(BTreeMap<String, Option<String>>),
    /// Every label goes.
    RemoveAll,
}

impl Default for LabelChange {
    fn default() -> Self {
        Self::Each(BTreeMap::new())
    }
}

impl LabelChange {
    fn apply(self, labels: &mut BTreeMap<String, String>) {
        let Self::Each(changes) = self else {
            return labels.clear();
        };
        for (label, value) in changes {
            match value {
                Some(value) => labels.insert(label, value),
                None => labels.remove(&label),
            };
        }
    }
}

/// What became of a change.
#[derive(Clone, Debug, PartialEq)]
pub enum Renamed {
    /// The change is on disk: the job as it stands.
    Done(Box<JobRow>),
    /// There is no such job.
    NotFound,
    /// The job would have more than [`MAX_LABELS`]; nothing is changed.
    TooManyLabels,
}

impl Jobs {
    /// Changes what a job is called, whatever state the job is in.
    pub async fn rename(&self, id: JobId, words: JobWords) -> Result<Renamed, StoreError> {
        in_transaction!(self.database, |tx| rename(tx, id, words)).await
    }
}

async fn rename(tx: &mut Tx, id: JobId, words: JobWords) -> Result<Renamed, StoreError> {
    let Some(mut row) = jobs::fetch(&mut *tx, id).await? else {
        return Ok(Renamed::NotFound);
    };
    if let Some(name) = words.name {
        row.name = name;
    }
    words.labels.apply(&mut row.labels);
    if row.labels.len() > MAX_LABELS {
        return Ok(Renamed::TooManyLabels);
    }
    let note = words
        .note
        .unwrap_or_else(|| row.task.note().map(str::to_owned));
    row.task.call(row.name.clone(), row.labels.clone(), note);
    write(tx, &row).await?;
    tx.announce(Change::Job(id));
    let row = jobs::fetch(&mut *tx, id).await?;
    Ok(row.map_or(Renamed::NotFound, |row| Renamed::Done(Box::new(row))))
}

async fn write(tx: &mut Tx, row: &JobRow) -> Result<(), StoreError> {
    let id = row.id.to_string();
    database::query(
        "update jobs set name = $1, labels = $2, spec = $3, revision = revision + 1 where id = $4",
    )
    .bind(row.name.clone())
    .bind(json(&row.labels))
    .bind(json(&row.task))
    .bind(&id)
    .execute(&mut **tx)
    .await?;
    let mut written = JOBS.select();
    written.push("jobs where id = ").push_bind(id.clone());
    let written = written.build().fetch_all(&mut **tx).await?;
    JOBS.seal_rows(tx, &written).await?;
    database::query("delete from job_labels where job = $1")
        .bind(&id)
        .execute(&mut **tx)
        .await?;
    for (label, value) in &row.labels {
        database::query("insert into job_labels (job, label, value) values ($1, $2, $3)")
            .bind(&id)
            .bind(label)
            .bind(value)
            .execute(&mut **tx)
            .await?;
    }
    Ok(())
}
