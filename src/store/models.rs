//! Models that users wrote: each document kept once, under a reference that never means another.

use jiff::Timestamp;
use serde_json::Value;
use sqlx::{FromRow, QueryBuilder, Sqlite};

use super::jobs::{from_json, time};
use super::writer::Tx;
use super::{Store, StoreError};
use crate::job::JobId;

/// The models that no job was made with that one server keeps at the most. One more takes the place
/// of the oldest of the client that has the most of them.
pub const MAX_UNUSED_MODELS: i64 = 500;

/// A model to be stored.
#[derive(Clone, Debug)]
pub struct NewModel {
    /// `name@digest`, by which jobs name it.
    pub reference: String,
    /// The name that its author gave.
    pub name: String,
    /// The digest of its document.
    pub digest: String,
    /// The document.
    pub document: Value,
    /// Who brings it: the address that it comes from.
    pub client: String,
}

/// A stored model.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelRow {
    /// `name@digest`, by which jobs name it.
    pub reference: String,
    /// The digest of its document.
    pub digest: String,
    /// The document.
    pub document: Value,
    /// When it was stored.
    pub created_at: Timestamp,
}

/// What became of a model that was to be stored.
#[derive(Clone, Debug, PartialEq)]
pub enum ModelStored {
    /// It is new.
    Created(ModelRow),
    /// The same document came before.
    There(ModelRow),
}

/// What became of a wish to remove a model.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ModelRemoval {
    /// It is gone.
    Removed,
    /// There is no such model.
    NotFound,
    /// These jobs were made with it; the first few of them.
    InUse(Vec<JobId>),
}

#[derive(FromRow)]
struct Columns {
    reference: String,
    digest: String,
    document: String,
    created_at: String,
}

impl Columns {
    fn read(self) -> Result<ModelRow, StoreError> {
        Ok(ModelRow {
            document: from_json("document", &self.reference, &self.document)?,
            created_at: time(&self.reference, &self.created_at)?,
            reference: self.reference,
            digest: self.digest,
        })
    }
}

impl Store {
    /// Stores a model, or finds the one that has the same digest.
    pub async fn insert_model(&self, new: NewModel) -> Result<ModelStored, StoreError> {
        self.inner
            .writer
            .write(move |tx| Box::pin(insert(tx, new)))
            .await
    }

    /// A stored model. The names of the catalogue have no digest and are not looked for.
    pub async fn model(&self, reference: &str) -> Result<Option<ModelRow>, StoreError> {
        if !reference.contains('@') {
            return Ok(None);
        }
        let row: Option<Columns> = sqlx::query_as(
            "select reference, digest, document, created_at from models where reference = ?",
        )
        .bind(reference)
        .fetch_optional(self.readers())
        .await?;
        row.map(Columns::read).transpose()
    }

    /// All stored models, newest first.
    pub async fn models(&self) -> Result<Vec<ModelRow>, StoreError> {
        let rows: Vec<Columns> = sqlx::query_as(
            "select reference, digest, document, created_at from models \
             order by created_at desc, reference",
        )
        .fetch_all(self.readers())
        .await?;
        rows.into_iter().map(Columns::read).collect()
    }

    /// Removes a model that no job was made with.
    pub async fn delete_model(&self, reference: &str) -> Result<ModelRemoval, StoreError> {
        let reference = reference.to_owned();
        self.inner
            .writer
            .write(move |tx| Box::pin(delete(tx, reference)))
            .await
    }
}

pub(super) async fn insert(tx: &mut Tx, new: NewModel) -> Result<ModelStored, StoreError> {
    let same: Option<Columns> = sqlx::query_as(
        "select reference, digest, document, created_at from models where digest = ?",
    )
    .bind(&new.digest)
    .fetch_optional(&mut **tx)
    .await?;
    if let Some(same) = same {
        return Ok(ModelStored::There(same.read()?));
    }
    let created_at = Timestamp::now();
    sqlx::query(
        "insert into models (reference, name, digest, document, created_at, client) \
         values (?, ?, ?, ?, ?, ?)",
    )
    .bind(&new.reference)
    .bind(&new.name)
    .bind(&new.digest)
    .bind(new.document.to_string())
    .bind(created_at.to_string())
    .bind(&new.client)
    .execute(&mut **tx)
    .await?;
    make_room(tx, &new.reference).await?;
    Ok(ModelStored::Created(ModelRow {
        reference: new.reference,
        digest: new.digest,
        document: new.document,
        created_at,
    }))
}

/// Forgets an unused model where there are too many, and not the one that just came.
async fn make_room(tx: &mut Tx, but_not: &str) -> Result<(), StoreError> {
    const UNUSED: &str = "not exists (select 1 from jobs where jobs.model = models.reference)";
    let mut count = QueryBuilder::<Sqlite>::new("select count(*) from models where ");
    count.push(UNUSED);
    let count: i64 = count.build_query_scalar().fetch_one(&mut **tx).await?;
    if count <= MAX_UNUSED_MODELS {
        return Ok(());
    }
    let mut removal = QueryBuilder::<Sqlite>::new(
        "with unused as (select reference, client, created_at from models where reference <> ",
    );
    removal.push_bind(but_not).push(" and ").push(UNUSED).push(
        "), greediest as (select client from unused group by client \
             order by count(*) desc, client limit 1) \
             delete from models where reference = (select reference from unused \
             where client = (select client from greediest) order by created_at, reference limit 1)",
    );
    removal.build().execute(&mut **tx).await?;
    Ok(())
}

async fn delete(tx: &mut Tx, reference: String) -> Result<ModelRemoval, StoreError> {
    let users: Vec<String> =
        sqlx::query_scalar("select id from jobs where model = ? order by id limit 10")
            .bind(&reference)
            .fetch_all(&mut **tx)
            .await?;
    if !users.is_empty() {
        let users = users.iter().map(|job| super::jobs::parse_id(job));
        return Ok(ModelRemoval::InUse(users.collect::<Result<_, _>>()?));
    }
    let removed = sqlx::query("delete from models where reference = ?")
        .bind(&reference)
        .execute(&mut **tx)
        .await?
        .rows_affected();
    Ok(if removed == 0 {
        ModelRemoval::NotFound
    } else {
        ModelRemoval::Removed
    })
}
