//! A job that is submitted, and the answer to its submission.

use std::collections::BTreeMap;
use std::str::FromStr;

use crate::access::Project;
use crate::job::JobTask;
use crate::store::database::Connection;
use crate::store::error::{QuotaExceeded, StoreError, corrupt};
use crate::store::idempotency::{self, Earlier, Idempotency};
use crate::store::jobs::{self, JobRow};
use greybox::identification::{DatasetId, JobId};

/// A job to be stored.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// The project that the job belongs to.
    pub project: Project,
    /// The name for people.
    pub name: Option<String>,
    /// Labels to find the job by.
    pub labels: BTreeMap<String, String>,
    /// The model's name.
    pub model: String,
    /// What the job is asked to do.
    pub task: JobTask,
    /// The recordings that the job reads.
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

/// A row that a request with a key makes.
pub(in crate::store) trait Idempotent: Sized {
    /// The identifier of the row.
    type Id: FromStr<Err: ToString> + Send;
    /// What such identifiers begin with.
    const PREFIX: &'static str;

    /// The row as it stands; nothing where the row has been deleted.
    fn fetch(
        connection: &mut Connection,
        id: Self::Id,
    ) -> impl Future<Output = Result<Option<Self>, StoreError>> + Send;

    /// The row as the first request made it.
    fn into_made(self) -> Self {
        self
    }
}

impl Idempotent for JobRow {
    type Id = JobId;
    const PREFIX: &'static str = JobId::PREFIX;

    async fn fetch(connection: &mut Connection, id: JobId) -> Result<Option<Self>, StoreError> {
        jobs::fetch(connection, id).await
    }

    fn into_made(self) -> Self {
        self.into_submitted()
    }
}

/// What became of the request that came with this key before, if one did: a client that repeats it
/// gets the same answer.
pub(in crate::store) async fn earlier<T: Idempotent>(
    connection: &mut Connection,
    idempotency: &Idempotency,
) -> Result<Option<Submitted<T>>, StoreError> {
    match idempotency::earlier(connection, idempotency).await? {
        None => Ok(None),
        Some(earlier) => answer_again(connection, earlier).await.map(Some),
    }
}

/// The answer to a request whose key came before.
pub(super) async fn answer_again<T: Idempotent>(
    connection: &mut Connection,
    earlier: Earlier,
) -> Result<Submitted<T>, StoreError> {
    let Earlier { is_same_body, made } = earlier;
    // Another body, or a request that made something else.
    if !is_same_body || !made.starts_with(T::PREFIX) {
        return Ok(Submitted::KeyReused);
    }
    let id = made
        .parse()
        .map_err(|why| corrupt("identifier", &made, why))?;
    Ok(match T::fetch(connection, id).await? {
        Some(row) => Submitted::Replayed(row.into_made()),
        None => Submitted::Forgotten(made),
    })
}
