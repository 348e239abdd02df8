//! A job that is submitted, and the answer to its submission.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::access::Project;
use crate::store::columns;
use crate::store::database::Connection;
use crate::store::error::{QuotaExceeded, StoreError};
use crate::store::idempotency::{Earlier, Idempotency};
use crate::store::jobs::{self, JobRow};
use greybox::identification::{DatasetId, JobId};

/// A job to be stored.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// Whose it is.
    pub project: Project,
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

/// What became of a submission.
#[derive(Clone, Debug)]
pub enum Submitted<T = JobRow> {
    /// It is new.
    Created(T),
    /// What the same key and body made before, as it was when it was made.
    Replayed(T),
    /// The key came before with another body. Nothing was stored.
    KeyReused,
    /// What the same key and body made before has been deleted; its identifier. Nothing was stored.
    Forgotten(String),
    /// The model that it names is no longer there. Nothing was stored.
    NoModel(String),
    /// A recording that it reads is no longer there. Nothing was stored.
    NoDataset(DatasetId),
    /// The project has as much as it may. Nothing was stored.
    Refused(QuotaExceeded),
}

/// The answer to a submission whose key came before.
pub(super) async fn answer_again(
    connection: &mut Connection,
    earlier: Earlier,
) -> Result<Submitted, StoreError> {
    // Another body, or one that made something else than a job.
    if !earlier.is_same_body || !earlier.made.starts_with(JobId::PREFIX) {
        return Ok(Submitted::KeyReused);
    }
    let id = columns::parse_id(&earlier.made)?;
    Ok(match jobs::fetch(connection, id).await? {
        Some(row) => Submitted::Replayed(row.into_submitted()),
        None => Submitted::Forgotten(id.to_string()),
    })
}
