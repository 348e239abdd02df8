//! Taking in a job: its row, first event, queue entry and idempotency record in one transaction.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde_json::Value;
use sqlx::SqliteConnection;

use super::jobs::{self, JobRow};
use super::writer::Tx;
use super::{Change, Store, StoreError, events, models, queue};
use crate::job::{DatasetId, Event, JobId, Status};

/// A job to be stored.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// The name for people.
    pub name: Option<String>,
    /// Labels to find it by.
    pub labels: BTreeMap<String, String>,
    /// The model's name.
    pub model: String,
    /// The completed specification.
    pub spec: Value,
    /// The recordings that it reads.
    pub datasets: Vec<DatasetId>,
    /// Makes the submission safe to repeat.
    pub idempotency: Option<Idempotency>,
}

/// What makes two submissions the same one.
#[derive(Clone, Debug)]
pub struct Idempotency {
    /// The client's key.
    pub key: String,
    /// A digest of the body that came with it.
    pub body_digest: String,
}

/// What became of a submission.
#[derive(Clone, Debug)]
pub enum Submitted {
    /// A new job.
    Created(JobRow),
    /// The job that the same key and body made before, as it was when it was made.
    Replayed(JobRow),
    /// The key came before with another body. Nothing was stored.
    KeyReused,
    /// The job that the same key and body made before has been deleted. Nothing was stored.
    Forgotten(JobId),
    /// The model that the job names is no longer there. Nothing was stored.
    NoModel(String),
    /// A recording that the job reads is no longer there. Nothing was stored.
    NoDataset(DatasetId),
}

impl Store {
    /// Stores a job and its queue entry. The answer means that it is on disk.
    pub async fn submit(&self, job: NewJob) -> Result<Submitted, StoreError> {
        let queue = self.inner.queue.clone();
        self.inner
            .writer
            .write(move |tx| Box::pin(submit(queue, tx, job)))
            .await
    }

    /// What became of the submission that came with this key before, if one did: a client that
    /// repeats it gets the same answer, even where the job could not be submitted any more.
    pub async fn earlier_submission(
        &self,
        idempotency: &Idempotency,
    ) -> Result<Option<Submitted>, StoreError> {
        let mut connection = self.readers().acquire().await?;
        earlier_submission(&mut connection, idempotency).await
    }
}

async fn submit(
    queue: riverqueue::Client,
    tx: &mut Tx,
    new: NewJob,
) -> Result<Submitted, StoreError> {
    if let Some(idempotency) = &new.idempotency
        && let Some(earlier) = earlier_submission(tx, idempotency).await?
    {
        return Ok(earlier);
    }
    for dataset in &new.datasets {
        if !dataset_exists(tx, *dataset).await? {
            return Ok(Submitted::NoDataset(*dataset));
        }
    }
    if !models::is_there(tx, &new.model).await? {
        return Ok(Submitted::NoModel(new.model));
    }
    let id = JobId::new();
    let created_at = Timestamp::now();
    let entry = queue::enqueue(&queue, tx, id).await?;
    insert_row(tx, id, entry, &new, created_at).await?;
    let first = Event::State {
        status: Status::Queued,
    };
    events::insert(tx, id, 1, &[first]).await?;
    tx.announce(Change::Job(id));
    Ok(Submitted::Created(JobRow {
        id,
        name: new.name,
        labels: new.labels,
        model: new.model,
        spec: new.spec,
        status: Status::Queued,
        stop_request: None,
        progress: None,
        attempt: 0,
        error: None,
        created_at,
        started_at: None,
        finished_at: None,
        last_event: 1,
        revision: 1,
    }))
}

async fn earlier_submission(
    connection: &mut SqliteConnection,
    idempotency: &Idempotency,
) -> Result<Option<Submitted>, StoreError> {
    let earlier: Option<(String, String)> =
        sqlx::query_as("select body_digest, job from idempotency where key = ?")
            .bind(&idempotency.key)
            .fetch_optional(&mut *connection)
            .await?;
    let Some((body_digest, job)) = earlier else {
        return Ok(None);
    };
    if body_digest != idempotency.body_digest {
        return Ok(Some(Submitted::KeyReused));
    }
    let id = jobs::parse_id(&job)?;
    Ok(Some(match jobs::fetch(connection, id).await? {
        Some(row) => Submitted::Replayed(row.into_submitted()),
        None => Submitted::Forgotten(id),
    }))
}

async fn dataset_exists(tx: &mut Tx, dataset: DatasetId) -> Result<bool, StoreError> {
    Ok(
        sqlx::query_scalar("select exists (select 1 from datasets where id = ?)")
            .bind(dataset.to_string())
            .fetch_one(&mut **tx)
            .await?,
    )
}

async fn insert_row(
    tx: &mut Tx,
    id: JobId,
    entry: i64,
    new: &NewJob,
    created_at: Timestamp,
) -> Result<(), StoreError> {
    let id = id.to_string();
    sqlx::query(
        "insert into jobs (id, name, labels, model, spec, status, queue_entry, last_event, \
         created_at) values (?, ?, ?, ?, ?, 'queued', ?, 1, ?)",
    )
    .bind(&id)
    .bind(&new.name)
    .bind(jobs::json(&new.labels))
    .bind(&new.model)
    .bind(new.spec.to_string())
    .bind(entry)
    .bind(created_at.to_string())
    .execute(&mut **tx)
    .await?;
    for (label, value) in &new.labels {
        sqlx::query("insert into job_labels (job, label, value) values (?, ?, ?)")
            .bind(&id)
            .bind(label)
            .bind(value)
            .execute(&mut **tx)
            .await?;
    }
    for dataset in &new.datasets {
        sqlx::query("insert or ignore into job_datasets (job, dataset) values (?, ?)")
            .bind(&id)
            .bind(dataset.to_string())
            .execute(&mut **tx)
            .await?;
    }
    if let Some(idempotency) = &new.idempotency {
        sqlx::query("insert into idempotency (key, body_digest, job) values (?, ?, ?)")
            .bind(&idempotency.key)
            .bind(&idempotency.body_digest)
            .bind(&id)
            .execute(&mut **tx)
            .await?;
    }
    Ok(())
}
